# An analysis as geomorph and shapes do it, of a model of apsm:
#   Rscript r/analysis.R MODEL_DIR [COLUMN]
# COLUMN is one of the subjects' table (`apsm test MODEL --subjects table.csv ...` leaves it in the folder).
args <- commandArgs(trailingOnly = TRUE)
here <- sub("^--file=", "", grep("^--file=", commandArgs(), value = TRUE))
source(file.path(dirname(here), "apsm.R"))
if (length(args) < 1) stop("usage: Rscript r/analysis.R MODEL_DIR [COLUMN]")

m <- read_apsm(args[1])
cat(length(m$names), "shapes,", nrow(m$mean), "particles;", sum(m$certified), "certified\n")

# The model's modes are the principal components of the particles.
pca <- prcomp(shape_matrix(m$particles))
cat("variance of mode 1:", m$variances[1], "; prcomp:", pca$sdev[1]^2, "\n")

# Form to shape: size taken out, as in most papers of geometric morphometrics.
gpa <- procrustes(m$particles)
shape <- prcomp(shape_matrix(gpa$coords))
cat("shape space, share of the first components:", round(shape$sdev[1:3]^2 / sum(shape$sdev^2), 3), "\n")
allometry <- procrustes_anova(gpa$coords, log(centroid_size(m$particles)))
cat("allometry: share", round(allometry$share, 4), "p", allometry$p, "\n")

column <- if (length(args) > 1) args[2] else NA
if (!is.na(column)) {
  if (is.null(m$subjects) || is.null(m$subjects[[column]])) stop("no column '", column, "' in statistics/subjects.csv")
  known <- !is.na(m$subjects[[column]])
  found <- procrustes_anova(gpa$coords[, , known], m$subjects[[column]][known])
  cat(column, ": share", round(found$share, 4), "p", found$p, "\n")
}

if (requireNamespace("geomorph", quietly = TRUE)) {
  theirs <- geomorph::gpagen(unname(m$particles), print.progress = FALSE)
  cat("geomorph's gpagen: mean shape differs by", max(abs(dist(theirs$consensus) - dist(gpa$mean))), "\n")
} else {
  cat("geomorph is not installed: its gpagen and procD.lm take m$particles as it is\n")
}
