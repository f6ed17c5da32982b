# Every figure of `apsm test`, `asymmetry`, `predict`, `norm` and `measure` computed again from the particles, by other
# arithmetic: lm's QR, full enumeration, fits without the shape that is judged, triangles of the meshes.  $1: the folder of
# statistics.sh.
source("r/apsm.R")
here <- commandArgs(TRUE)[1]
at <- function(...) file.path(here, ...)
m <- read_apsm(at("model"))
known <- read.csv(at("table.csv"), stringsAsFactors = FALSE)
rownames(known) <- known$name
known <- known[m$names, ]
J <- nrow(m$mean)
checked <- 0

near <- function(got, want, what, tolerance = 1e-8) {
  got <- as.vector(unlist(got))
  want <- as.vector(unlist(want))
  scale <- max(abs(want[is.finite(want)]), 1e-300)
  same <- length(got) == length(want) && identical(is.finite(got), is.finite(want)) &&
    all(abs(got - want)[is.finite(want)] <= tolerance * scale)
  if (!same) stop(what, ": apsm says ", paste(signif(head(got, 4), 10), collapse = " "), ", R ", paste(signif(head(want, 4), 10), collapse = " "))
  checked <<- checked + length(want)
}
# The first number of that key.
figure <- function(text, key) as.numeric(sub(paste0('(?s)^.*?"', key, '": ([-0-9.e+]+).*'), "\\1", text, perl = TRUE))
shapes <- shape_matrix(m$particles)
orthonormal <- function(X) {
  q <- qr(X)
  qr.Q(q)[, seq_len(q$rank), drop = FALSE]
}

# ---- linear models ----

# Lawley and Hotelling's trace of each variable (w columns of Y), sums of squares, for reduced and full designs.
explained <- function(Y, Z, X, w) {
  less <- qr.resid(qr(Z), Y)
  more <- qr.resid(qr(X), Y)
  V <- ncol(Y) / w
  trace <- sapply(seq_len(V), function(v) {
    k <- (v - 1) * w + seq_len(w)
    E <- crossprod(more[, k, drop = FALSE])
    sum(diag(solve(E, crossprod(less[, k, drop = FALSE]) - E)))
  })
  each <- function(e) colSums(matrix(colSums(e^2), w))
  list(trace = trace, ratio = sum(less^2 - more^2) / sum(more^2), share = 1 - each(more) / each(less))
}

# Six nearest of the mean, both ways.
graph <- local({
  d <- as.matrix(dist(m$mean))
  g <- matrix(FALSE, J, J)
  for (j in seq_len(J)) g[j, order(d[j, ])[2:7]] <- TRUE
  g | t(g)
})

# Threshold-free cluster enhancement by its integral: exact between heights, which is where clusters change.
enhance <- function(x) {
  out <- numeric(J)
  heights <- c(0, sort(unique(x)))
  for (k in seq_len(length(heights) - 1)) {
    on <- which(x >= heights[k + 1])
    of <- seq_along(on)
    g <- graph[on, on, drop = FALSE]
    diag(g) <- TRUE
    repeat {
      least <- apply(g, 1, function(near) min(of[near]))
      if (identical(least, of)) break
      of <- least
    }
    out[on] <- out[on] + sqrt(tabulate(of, length(on))[of] / J) * (heights[k + 1]^3 - heights[k]^3) / 3
  }
  out
}

# A test by Freedman and Lane over the given orders, the first of which is the given one.
by_orders <- function(Y, Z, X, w, orders, clusters = FALSE) {
  left <- qr.resid(qr(Z), Y)
  fitted <- Y - left
  all <- apply(orders, 2, function(o) {
    one <- explained(fitted + left[o, , drop = FALSE], Z, X, w)
    c(one$ratio, one$trace)
  })
  ratio <- all[1, ]
  trace <- all[-1, , drop = FALSE]
  reached <- function(x, x0) mean(x >= x0 * (1 - 1e-9))
  most <- apply(trace, 2, max)
  p <- sapply(seq_len(nrow(trace)), function(v) reached(trace[v, ], trace[v, 1]))
  result <- list(p_ratio = reached(ratio, ratio[1]), p = p, q = p.adjust(p, "BH"),
                 familywise = sapply(trace[, 1], function(x) reached(most, x)))
  if (clusters) {
    high <- apply(sqrt(trace), 2, enhance)
    peak <- apply(high, 2, max)
    result$cluster <- sapply(high[, 1], function(x) reached(peak, x))
  }
  result
}
compare <- function(folder, stem, Y, Z, X, w, orders, clusters = FALSE) {
  text <- read_text(at(folder, paste0(stem, ".json")))
  csv <- read.csv(at(folder, paste0(stem, ".csv")), check.names = FALSE)
  given <- explained(Y, Z, X, w)
  near(figure(text, "ratio"), given$ratio, paste(stem, "ratio"))
  near(csv$statistic, given$trace, paste(stem, "statistic"))
  near(csv$share, given$share, paste(stem, "share"))
  if (is.null(orders)) return(invisible(csv))
  near(figure(text, "permutations"), ncol(orders), paste(stem, "orders"))
  want <- by_orders(Y, Z, X, w, orders, clusters)
  near(figure(text, "p"), want$p_ratio, paste(stem, "p"), 1e-12)
  near(csv$p, want$p, paste(stem, "p of variables"), 1e-12)
  near(csv$p_familywise, want$familywise, paste(stem, "family-wise p"), 1e-12)
  near(csv$q, want$q, paste(stem, "q"), 1e-12)
  if (clusters) near(csv$p_cluster, want$cluster, paste(stem, "cluster p"), 1e-12)
  invisible(csv)
}

# Two of the twelve belong to no group: they are left out of every test of it.
grouped <- known$group != ""
group <- ifelse(known$group == "a", 1, -1)[grouped]
some <- shapes[grouped, ]
one <- matrix(1, sum(grouped), 1)
# All ways to deal ten into two groups of five, the given one first.
orders <- apply(combn(10, sum(group == 1)), 2, function(set) {
  o <- integer(10)
  o[group == 1] <- set
  o[group == -1] <- setdiff(1:10, set)
  o
})
orders <- orders[, order(colSums(orders != 1:10))]
csv <- compare("a", "group_form", some, one, cbind(one, group), 3, orders, clusters = TRUE)
tested <- nrow(read.csv(at("a", "group_modes.csv")))
compare("a", "group_modes", m$scores[grouped, seq_len(tested), drop = FALSE], one, cbind(one, group), 1, orders)
held <- cumsum(m$variances) / sum(m$variances)
near(which(held >= 0.95)[1], tested, "modes that are tested")
size <- centroid_size(m$particles)
compare("a", "group_size", matrix(size[grouped]), one, cbind(one, group), 1, orders)

# Size out: Procrustes of our own; sums of squares do not depend on the frame.
gpa <- procrustes(m$particles[, , grouped])
found <- explained(shape_matrix(gpa$coords), one, cbind(one, group), 3)
near(figure(read_text(at("a", "group_shape.json")), "ratio"), found$ratio, "ratio of shape", 1e-6)
near(read.csv(at("a", "group_shape.csv"))$statistic, found$trace, "statistic of shape", 1e-5)

# Effects: differences of means, in standard deviations, and bands by bootstraps of our own.
difference <- colMeans(some[group == 1, ]) - colMeans(some[group == -1, ])
text <- read_text(at("a", "group_form.json"))
near(json_numbers(text, "effect"), difference, "effect")
inside <- rbind(scale(some[group == 1, ], scale = FALSE), scale(some[group == -1, ], scale = FALSE))
near(csv[["a minus b, standardised"]], sapply(seq_len(J), function(j) {
  k <- 3 * j - 2:0
  sqrt(difference[k] %*% solve(crossprod(inside[, k]) / (nrow(inside) - 2), difference[k]))
}), "standardised effect")
near(figure(text, "one_variable"), (qnorm(0.975) + qnorm(0.8)) * sqrt(1 / 5 + 1 / 5), "detectable shift", 1e-6)
near(figure(text, "any_of_all"), (qnorm(1 - 0.025 / J) + qnorm(0.8)) * sqrt(1 / 5 + 1 / 5), "detectable shift of any", 1e-6)
set.seed(1)
sizes <- read.csv(at("a", "group_size.csv"), check.names = FALSE)
large <- size[grouped]
drawn <- replicate(4000, mean(sample(large[group == 1], 5, TRUE)) - mean(sample(large[group == -1], 5, TRUE)))
band <- quantile(drawn, c(0.025, 0.975))
near(c(sizes[["a minus b, low"]], sizes[["a minus b, high"]]) / diff(band), band / diff(band), "bootstrap band", 0.1)

# A slope with a covariate, 10,000 random orders: figures are exact, p within its error of 200 orders of our own.
Z <- cbind(1, group)
age <- known$age - mean(known$age)
young <- age[grouped]
slope <- compare("c", "age_form", some, Z, cbind(Z, young), 3, NULL)
near(json_numbers(read_text(at("c", "age_form.json")), "effect"), coef(lm(some ~ group + young))["young", ], "slope")
ours <- by_orders(some, Z, cbind(Z, young), 3, cbind(1:10, replicate(200, sample(10))))
theirs <- c(figure(read_text(at("c", "age_form.json")), "p"), slope$p, slope$p_familywise)
error <- sqrt((theirs * (1 - theirs) + 0.005) / 200)
if (any(abs(theirs - c(ours$p_ratio, ours$p, ours$familywise)) > 5 * error)) stop("p of random orders")
near(figure(read_text(at("c", "age_form.json")), "p_standard_error"), sqrt(theirs[1] * (1 - theirs[1]) / 10001), "error of p")

# Signs in place of orders: p within its error of 400 draws of our own.
text <- read_text(at("v", "group_form.json"))
left <- qr.resid(qr(one), some)
drawn <- replicate(400, explained(left * sample(c(-1, 1), 10, TRUE), one, cbind(one, group), 3)$ratio)
p <- figure(text, "p")
ours <- mean(c(1, drawn >= figure(text, "ratio")))
if (abs(p - ours) > 5 * sqrt((p * (1 - p) + 0.005) / 400)) stop("p by signs is ", p, ", not ", ours)
spreads <- sapply(c(1, -1), function(g) sum(scale(some[group == g, ], scale = FALSE)^2) / 4)
near(figure(text, "variance_ratio"), max(spreads) / min(spreads), "ratio of variances")

# Three groups and an interaction.
dose <- factor(known$dose)
contrasts(dose) <- contr.sum(3)
arms <- compare("d", "dose_form", shapes, cbind(1, age), cbind(1, age, contrasts(dose)[dose, ]), 3, NULL)
b <- coef(lm(shapes ~ age + dose))[c("dose1", "dose2"), ]
near(json_numbers(read_text(at("d", "dose_form.json")), "effect"), b[1, ], "effect of the first of three")
young <- young - mean(young)
compare("d", "group_age_form", some, cbind(1, group, young), cbind(1, group, young, group * young), 3, NULL)

# Within subjects, with a covariate: every subject's two rows change places or not.
person <- model.matrix(~ factor(known$person) - 1)
side <- ifelse(known$side == "left", 1, -1)
swaps <- apply(expand.grid(rep(list(c(FALSE, TRUE)), 6)), 1, function(swap) {
  o <- seq_len(12)
  for (s in which(swap)) {
    rows <- which(person[, s] == 1)
    o[rows] <- rev(rows)
  }
  o
})
compare("e", "side_form", shapes, person, cbind(person, side), 3, swaps)
compare("f", "side_form", shapes, cbind(person, age), cbind(person, age, side), 3, swaps)

# ---- left and right ----

text <- read_text(at("e", "asymmetry_form.json"))
sums <- c(0, 0, 0)
for (k in seq_len(ncol(shapes))) {
  a <- anova(lm(shapes[, k] ~ factor(known$person) + factor(known$side)))
  sums <- sums + a[["Sum Sq"]]
}
df <- c(5, 1, 5)
blocks <- strsplit(text, '"source"')[[1]][-1]
near(sapply(blocks, figure, "sum_of_squares"), sums, "sums of squares of asymmetry")
near(figure(blocks[2], "f"), sums[2] / (sums[3] / 5), "F of directional asymmetry")
near(figure(blocks[2], "p"), by_orders(shapes, person, cbind(person, side), 3, swaps)$p_ratio, "p of directional asymmetry", 1e-12)
amounts <- read.csv(at("e", "asymmetry_form_subjects.csv"))
d <- t(sapply(unique(known$person), function(s) shapes[known$person == s & side == 1, ] - shapes[known$person == s & side == -1, ]))
near(sort(amounts$asymmetry), sort(sqrt(rowSums(d^2) / J)), "amounts of asymmetry")
near(sort(amounts$fluctuating_asymmetry), sort(sqrt(rowSums(scale(d, scale = FALSE)^2) / J)), "amounts of fluctuating asymmetry")
replicated <- known$pair # 5 subjects, one with both sides twice
text <- read_text(at("g", "asymmetry_size.json"))
blocks <- strsplit(text, '"source"')[[1]][-1]
errors <- tapply(size, paste(replicated, side), function(x) sum((x - mean(x))^2))
near(figure(blocks[4], "sum_of_squares"), sum(errors), "error of replicates")

# ---- told apart ----

fold <- integer(10)
for (g in c(1, -1)) fold[group == g] <- (seq_len(sum(group == g)) - 1) %% 5
score <- numeric(10)
for (f in 0:4) {
  other <- which(fold != f)
  pca <- prcomp(some[other, ])
  K <- min(which(cumsum(pca$sdev^2) >= 0.9 * sum(pca$sdev^2))[1], floor(length(other) / 3))
  b <- pca$x[, seq_len(K), drop = FALSE]
  g <- group[other]
  means <- rbind(colMeans(b[g == 1, , drop = FALSE]), colMeans(b[g == -1, , drop = FALSE]))
  S <- crossprod(rbind(sweep(b[g == 1, , drop = FALSE], 2, means[1, ]), sweep(b[g == -1, , drop = FALSE], 2, means[2, ]))) / (length(other) - 2)
  way <- solve(S + diag(1e-9 * pca$sdev[1]^2, K), means[2, ] - means[1, ])
  way <- way / sqrt(sum(way * (means[2, ] - means[1, ])))
  mine <- predict(pca, some[fold == f, , drop = FALSE])[, seq_len(K), drop = FALSE]
  score[fold == f] <- sweep(mine, 2, colMeans(means)) %*% way
}
first <- score[group == 1]
second <- score[group == -1]
wins <- outer(second, first, ">") + 0.5 * outer(second, first, "==")
spread <- sqrt(var(rowMeans(wins)) / 5 + var(colMeans(wins)) / 5)
text <- read_text(at("a", "group_form.json"))
near(figure(text, "auc"), mean(wins), "area under the ROC curve")
near(c(figure(text, "auc_low"), figure(text, "auc_high")), c(max(0, mean(wins) - qnorm(0.975) * spread), min(1, mean(wins) + qnorm(0.975) * spread)), "DeLong's interval")
near(figure(text, "balanced_accuracy"), mean(c(first <= 0, second > 0)), "balanced accuracy")

# ---- a column from the shape: ten subjects, so that every fold is one ----

ridge <- function(X, y, penalty) {
  mean <- colMeans(X)
  Xc <- sweep(X, 2, mean)
  K <- tcrossprod(Xc)
  slope <- crossprod(Xc, solve(K + diag(penalty, nrow(K)), y - mean(y)))
  function(x) mean(y) + drop(sweep(x, 2, mean) %*% slope)
}
# The penalty: of the grid that with the least error of shapes left out, the mean being that of all.
grid <- 1e-4 * 10^((0:27) / 3)
choose_penalty <- function(X, y) {
  Xc <- scale(X, scale = FALSE)
  K <- tcrossprod(Xc)
  unit <- sum(diag(K)) / nrow(K)
  errors <- sapply(grid * unit, function(l) {
    H <- 1 / nrow(K) + K %*% solve(K + diag(l, nrow(K)))
    mean(((y - H %*% y) / (1 - diag(H)))^2)
  })
  c(grid[which.min(errors)], unit)
}
use <- !is.na(known$luck)
X <- shapes[use, ]
y <- known$luck[use]
left_out <- sapply(seq_along(y), function(i) {
  l <- choose_penalty(X[-i, ], y[-i])
  ridge(X[-i, ], y[-i], l[1] * l[2])(X[i, , drop = FALSE])
})
text <- read_text(at("p", "luck_prediction.json"))
table <- read.csv(at("p", "luck_prediction.csv"))
near(table$predicted[table$how == "left out"], left_out, "values predicted without a shape", 1e-6)
near(figure(text, "share_explained"), 1 - sum((y - left_out)^2) / sum((y - mean(y))^2), "share explained", 1e-6)
near(figure(text, "root_mean_square_error"), sqrt(mean((y - left_out)^2)), "root mean square error", 1e-6)
near(figure(text, "mean_absolute_error"), mean(abs(y - left_out)), "mean error", 1e-6)
near(figure(text, "correlation"), cor(y, left_out), "correlation", 1e-6)
best <- choose_penalty(X, y)
near(figure(text, "penalty"), best[1], "penalty", 1e-9)
added <- t(sapply(c("new1", "new2"), function(n) as.vector(t(read_particles(at(paste0(n, "_world.particles")))))))
near(table$predicted[table$how == "new"], ridge(X, y, best[1] * best[2])(added), "values of new shapes", 1e-6)
near(json_numbers(text, "pattern"), crossprod(X, y - mean(y)) / sum((y - mean(y))^2), "shape for values of a column")

# ---- norms: every shape left out in truth ----

X <- cbind(1, known$age)
X0 <- cbind(1, c(25, 31))
rms <- function(e) sqrt(sum(e^2) / J)
expected <- function(X, Y, x) drop(x %*% qr.coef(qr(X), Y))
leverage <- function(X, x) drop(x %*% solve(crossprod(X), x))
# d coordinates a particle: 3, or the one along its normal.
particle_p <- function(X, Y, x, y, d, figures = FALSE) {
  e <- y - expected(X, Y, x)
  left <- qr.resid(qr(X), Y)
  nu <- nrow(X) - ncol(X)
  T2 <- sapply(seq_len(J), function(j) {
    k <- d * j - (d - 1):0
    e[k] %*% solve(crossprod(left[, k, drop = FALSE]) / nu, e[k]) / (1 + leverage(X, x))
  })
  p <- pf(T2 * (nu - d + 1) / (d * nu), d, nu - d + 1, lower.tail = FALSE)
  if (figures) list(T2 = T2, p = p) else p
}
judge <- function(folder, Y, Y0, d) {
  own <- sapply(1:12, function(i) rms(Y[i, ] - expected(X[-i, ], Y[-i, ], X[i, ])) / sqrt(1 + leverage(X[-i, ], X[i, ])))
  least <- sapply(1:12, function(i) min(particle_p(X[-i, ], Y[-i, ], X[i, ], Y[i, ], d)))
  norms <- read.csv(at(folder, "norm.csv"))
  text <- strsplit(read_text(at(folder, "norm.json")), '"name": "new[12]"')[[1]][-1]
  for (k in 1:2) {
    distance <- rms(Y0[k, ] - expected(X, Y, X0[k, ])) / sqrt(1 + leverage(X, X0[k, ]))
    near(norms$distance[k], distance, "distance from the norm")
    near(norms$percentile[k], 100 * mean(own < distance), "percentile", 1e-12)
    near(c(norms$percentile_low[k], norms$percentile_high[k]), 100 * prop.test(sum(own < distance), 12, correct = FALSE)$conf.int, "Wilson's interval", 1e-6)
    near(figure(text[k], "p"), (sum(own >= distance) + 1) / 13, "p of a shape", 1e-12)
    near(figure(text[k], "z"), (log(distance) - mean(log(own))) / sd(log(own)), "z of a shape")
    particles <- read.csv(at(folder, paste0(norms$name[k], "_norm.csv")))
    want <- particle_p(X, Y, X0[k, ], Y0[k, ], d, TRUE)
    near(particles$standardised, sqrt(want$T2), "T of particles")
    near(particles$p, want$p, "p of particles", 1e-7)
    near(particles$q, p.adjust(want$p, "BH"), "q of particles", 1e-7)
    near(figure(text[k], "p_particles"), (sum(least <= min(want$p)) + 1) / 13, "p of the most unusual particle", 1e-12)
  }
}
judge("n3", shapes, added, 3)
normals <- sub('(?s).*?"normals": \\[(.*?)\\][\\s]*\\].*', "\\1", read_text(at("n", "norm.json")), perl = TRUE)
normals <- matrix(as.numeric(regmatches(normals, gregexpr("[-0-9.e+]+", normals))[[1]]), ncol = 3, byrow = TRUE)
along <- function(Y) sapply(seq_len(J), function(j) Y[, 3 * j - 2:0] %*% normals[j, ])
judge("n", along(shapes), along(added), 1)
# The mean is nearly an ellipsoid about its centre: outward normals are those of its quadric.
half <- apply(m$mean, 2, function(x) diff(range(x)) / 2)
outward <- sweep(sweep(m$mean, 2, colMeans(m$mean)), 2, half^2, "/")
near(rowSums(normals^2), rep(1, J), "length of the normals", 1e-6)
stopifnot(rowSums(normals * outward) / sqrt(rowSums(outward^2)) > 0.9)
norms <- read.csv(at("n", "norm.csv"))
text <- strsplit(read_text(at("n", "norm.json")), '"name": "new[12]"')[[1]][-1]
modes <- t(apply(m$modes, 3, function(x) as.vector(t(x))))
scores <- sweep(added, 2, as.vector(t(m$mean))) %*% t(modes)
fit <- lm(size ~ known$age)
for (k in 1:2) {
  told <- sub('(?s).*"values"', "", text[k], perl = TRUE)
  own_size <- centroid_size(array(t(matrix(added[k, ], 3)), c(J, 3, 1)))
  expected_size <- sum(coef(fit) * X0[k, ])
  near(c(figure(told, "value"), figure(told, "expected")), c(own_size, expected_size), "centroid size and what is expected", 1e-6)
  near(figure(told, "z"), (own_size - expected_size) / (summary(fit)$sigma * sqrt(1 + leverage(X, X0[k, ]))), "z of the centroid size", 1e-5)
}
columns <- grep("^mode_", names(norms))
for (v in seq_along(columns)) {
  fit <- lm(m$scores[, v] ~ known$age)
  s <- summary(fit)$sigma
  for (k in 1:2) near(norms[k, columns[v]], (scores[k, v] - sum(coef(fit) * X0[k, ])) / (s * sqrt(1 + leverage(X, X0[k, ]))), "t of a mode", 1e-6)
}

# ---- measurements ----

read_ply <- function(path) {
  file <- file(path, "rb")
  on.exit(close(file))
  head <- character()
  while (!identical(tail(head, 1), "end_header")) head <- c(head, readLines(file, 1))
  count <- function(what) as.integer(sub(".* ", "", grep(paste("element", what), head, value = TRUE)))
  V <- t(matrix(readBin(file, "numeric", 3 * count("vertex"), 4, endian = "little"), 3))
  bytes <- matrix(readBin(file, "raw", 13 * count("face")), 13)
  stopifnot(all(bytes[1, ] == 3))
  list(V = V, F = t(matrix(readBin(as.vector(bytes[-1, ]), "integer", 3 * count("face"), 4, endian = "little"), 3)) + 1)
}
cross <- function(a, b) cbind(a[, 2] * b[, 3] - a[, 3] * b[, 2], a[, 3] * b[, 1] - a[, 1] * b[, 3], a[, 1] * b[, 2] - a[, 2] * b[, 1])
own_frame <- read_apsm(at("model"), "local")
measured <- read.csv(at("q", "measurements.csv"))
rownames(measured) <- measured$name
angle <- function(a, b) acos(sum(a * b) / sqrt(sum(a^2) * sum(b^2))) * 180 / pi
for (i in seq_along(m$names)) {
  P <- m$particles[, , i]
  row <- measured[m$names[i], ]
  near(row$across, sqrt(sum((P[1, ] - P[8, ])^2)), "distance", 1e-7)
  near(row$bend, angle(P[1, ] - P[4, ], P[8, ] - P[4, ]), "angle", 1e-7)
  near(row$turn, angle(P[4, ] - P[1, ], P[12, ] - P[8, ]), "angle of two lines", 1e-7)
  plane <- P[c(2, 5, 9, 14), ]
  normal <- svd(scale(plane, scale = FALSE))$v[, 3]
  near(abs(row$height), abs(sum((P[1, ] - colMeans(plane)) * normal)), "distance from a plane", 1e-6)
  ball <- P[c(1, 5, 9, 14, 20, 27), ]
  start <- c(colMeans(ball), mean(sqrt(rowSums(scale(ball, scale = FALSE)^2))))
  for (step in 1:200) { # Gauss and Newton
    d <- sweep(ball, 2, start[1:3])
    r <- sqrt(rowSums(d^2))
    start <- start - qr.coef(qr(cbind(-d / r, -1)), r - start[4])
  }
  near(row$ball, 2 * start[4], "sphere", 1e-5)
  mesh <- read_ply(at("model", "meshes", paste0(m$names[i], "_reconstructed.ply")))
  a <- mesh$V[mesh$F[, 1], ]
  b <- mesh$V[mesh$F[, 2], ]
  c <- mesh$V[mesh$F[, 3], ]
  near(row$volume, sum(a * cross(b, c)) / 6, "volume", 1e-5)
  near(row$area, sum(sqrt(rowSums(cross(b - a, c - a)^2))) / 2, "area", 1e-5)
  # Meshes are in each shape's own frame.  The plane through three particles: ends of the segments that triangles leave in it, by Green's theorem.
  P <- own_frame$particles[, , i]
  n <- as.vector(cross(t(P[8, ] - P[1, ]), t(P[20, ] - P[1, ])))
  n <- n / sqrt(sum(n^2))
  h <- drop(sweep(mesh$V, 2, P[1, ]) %*% n)
  area <- 0
  for (t in which(apply(matrix(h[mesh$F] > 0, ncol = 3), 1, function(s) any(s) && !all(s)))) {
    f <- mesh$F[t, ]
    ends <- NULL
    for (e in 1:3) {
      u <- f[e]
      v <- f[e %% 3 + 1]
      if ((h[u] > 0) == (h[v] > 0)) next
      x <- mesh$V[u, ] + h[u] / (h[u] - h[v]) * (mesh$V[v, ] - mesh$V[u, ])
      ends <- if (h[u] > 0) rbind(ends, x) else rbind(x, ends)
    }
    x <- sweep(ends, 2, P[1, ])
    area <- area + sum(n * c(x[1, 2] * x[2, 3] - x[1, 3] * x[2, 2], x[1, 3] * x[2, 1] - x[1, 1] * x[2, 3], x[1, 1] * x[2, 2] - x[1, 2] * x[2, 1])) / 2
  }
  near(row$middle, abs(area), "section", 1e-5)
}
cat("R: ", checked, " figures of statistics computed again: ok\n", sep = "")
