# Models of apsm in R, with base R alone:
#   source("r/apsm.R")
#   m <- read_apsm("model")
#   m$particles     # J x 3 x I, as geomorph and shapes have landmarks
#   m$part          # of a joint: the part of each particle
#   m$scores        # a row a shape; m$variances, m$modes (J x 3 x K), m$mean (J x 3)
#   m$certified     # which shapes may be trusted
# A model folder that `apsm run` or `apsm evaluate` has made; nothing in it is changed.

# All numbers behind a key of our JSON, in their order.
json_numbers <- function(text, key) {
  at <- regexpr(paste0('"', key, '": '), text, fixed = TRUE)
  if (at < 0) stop("no \"", key, "\" in the file")
  rest <- substring(text, at + attr(at, "match.length"))
  depth <- cumsum(c("[" = 1, "]" = -1)[ch <- strsplit(gsub("[^][]", "", rest), "")[[1]]])
  end <- gregexpr("[][]", rest)[[1]][which(depth == 0)[1]]
  block <- gsub("[][,]", " ", substring(rest, 1, end))
  scan(text = block, quiet = TRUE)
}

read_text <- function(path) paste(readLines(path, warn = FALSE, encoding = "UTF-8"), collapse = "\n")

read_particles <- function(path) as.matrix(unname(read.table(path)))

# The parts of a joint, in the order of their particles; none of a model of one part.
part_names <- function(model) {
  list <- regmatches(model, regexpr('"parts": \\[[^]]*\\]', model))
  if (length(list) == 0) return(character(0))
  sub('.*"name": "(.*)"$', "\\1", regmatches(list, gregexpr('"name": "[^"]*"', list))[[1]])
}

read_apsm <- function(folder, frame = "world") {
  file <- function(name) {
    path <- file.path(folder, name)
    if (!file.exists(path)) stop(path, ": is not there; give a model folder that has been evaluated")
    path
  }
  scores <- read.csv(file("scores.csv"), check.names = FALSE, fileEncoding = "UTF-8")
  names <- as.character(scores[[1]])
  model <- read_text(file("model.json"))
  part <- part_names(model)
  shapes <- lapply(names, function(name) {
    paths <- file.path(folder, "particles", paste0(name, if (length(part)) paste0("_", part), "_", frame, ".particles"))
    if (!all(file.exists(paths))) stop("no particles of ", name, " in the frame '", frame, "'")
    sets <- lapply(paths, read_particles)
    structure(do.call(rbind, sets), part = rep(part, vapply(sets, nrow, 1L)[seq_along(part)]))
  })
  J <- nrow(shapes[[1]])
  particles <- array(unlist(shapes), c(J, 3, length(names)), list(NULL, c("x", "y", "z"), names))
  variances <- json_numbers(model, "variances")
  K <- length(variances)
  list(
    particles = particles, part = attr(shapes[[1]], "part"), names = names, variances = variances,
    mean = matrix(json_numbers(model, "mean"), J, 3, byrow = TRUE),
    modes = aperm(array(json_numbers(model, "modes"), c(3, J, K)), c(2, 1, 3)),
    scores = `rownames<-`(as.matrix(scores[-1]), names),
    certified = read_certified(file("certificate.json"), names),
    subjects = read_subjects(folder, names)
  )
}

# Verdicts, in the order of names.
read_certified <- function(path, names) {
  text <- read_text(path)
  text <- substring(text, regexpr('"per_shape"', text))
  found <- regmatches(text, gregexpr('"name": "(\\\\.|[^"\\\\])*",\\s*"verdict": "[a-z ]*"', text, perl = TRUE))[[1]]
  verdict <- sub('.*"verdict": "([a-z ]*)"$', "\\1", found)
  of <- gsub('\\\\(.)', "\\1", sub('^"name": "(.*)",\\s*"verdict": "[a-z ]*"$', "\\1", found))
  at <- match(names, of) # parts of a joint have verdicts of their own
  if (anyNA(at)) stop(path, ": is of other shapes than scores.csv")
  setNames(verdict[at] == "certified", names)
}

# The table that `apsm test --subjects` has left, or NULL.
read_subjects <- function(folder, names) {
  path <- file.path(folder, "statistics", "subjects.csv")
  if (!file.exists(path)) return(NULL)
  table <- read.csv(path, stringsAsFactors = TRUE, check.names = FALSE, fileEncoding = "UTF-8")
  rownames(table) <- as.character(table[[1]])
  table[match(names, rownames(table)), -1, drop = FALSE]
}

# A row a shape, x1 y1 z1 x2 ...: what geomorph calls two.d.array.
shape_matrix <- function(particles) t(apply(particles, 3, function(p) as.vector(t(p))))

# Shapes on the line of mode k, sd standard deviations from the mean.
mode_shape <- function(m, k, sd) m$mean + sd * sqrt(m$variances[k]) * m$modes[, , k]

# Centroid sizes.
centroid_size <- function(particles) apply(particles, 3, function(p) sqrt(sum(scale(p, scale = FALSE)^2)))

# Ordinary generalised Procrustes analysis of J x 3 x I: position, size (if wanted) and rotation removed.
procrustes <- function(particles, scale = TRUE, rounds = 50, tolerance = 1e-12) {
  for (i in seq_len(dim(particles)[3])) {
    p <- scale(particles[, , i], scale = FALSE)
    particles[, , i] <- if (scale) p / sqrt(sum(p^2)) else p
  }
  before <- Inf
  mean <- particles[, , 1]
  for (round in seq_len(rounds)) {
    for (i in seq_len(dim(particles)[3])) {
      s <- svd(crossprod(particles[, , i], mean))
      turn <- s$u %*% diag(c(1, 1, sign(det(s$u %*% t(s$v))))) %*% t(s$v)
      particles[, , i] <- particles[, , i] %*% turn
    }
    mean <- apply(particles, 1:2, mean)
    if (scale) mean <- mean / sqrt(sum(mean^2))
    now <- sum((particles - as.vector(mean))^2)
    if (before - now <= tolerance * now) break
    before <- now
  }
  list(coords = particles, mean = mean)
}

# Procrustes analysis of variance by permutation of the rows (as procD.lm of geomorph does for one term):
# share of the variance of the shapes that x explains, and p.
procrustes_anova <- function(particles, x, permutations = 999, seed = 1) {
  Y <- scale(shape_matrix(particles), scale = FALSE)
  share <- function(x) {
    q <- qr.Q(qr(model.matrix(~x)))
    sum((crossprod(q, Y))^2) / sum(Y^2)
  }
  set.seed(seed)
  seen <- share(x)
  drawn <- replicate(permutations, share(sample(x)))
  list(share = seen, p = (1 + sum(drawn >= seen - 1e-12)) / (1 + permutations))
}
