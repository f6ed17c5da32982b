#!/bin/sh
# The readers for R and Octave against a model.  $1 program, $2 make_synthetic.  77: there is neither.
set -u
apsm=$1 synthetic=$2 here=$(pwd) failed=0 some=no
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/cohort"
i=0
while [ $i -lt 7 ]; do
    "$synthetic" bump "$folder/cohort/s, \"$i\".ply" index $i count 8 level 3 || exit 1
    i=$((i + 1))
done
"$apsm" run "$folder/cohort" -o "$folder/model" -J 32 --faces 800 --stage1-epochs 3 --stage2-epochs 3 -q 2>/dev/null || exit 1
(echo name,group && awk -F'"' 'NR > 1 { printf "\"%s\",%s\n", substr($0, 2, index($0, "\",") - 2), NR % 2 ? "a" : "b" }' "$folder/model/scores.csv") >"$folder/table.csv"
"$apsm" test "$folder/model" --subjects "$folder/table.csv" --formula '~ group' --permutations 100 --bootstraps 0 -q || failed=1
"$synthetic" joint "$folder/made" count 4 angle 10 || exit 1
"$apsm" run "$folder/made/shapes" -o "$folder/joint" --parts a=_a,b=_b -J 16 --faces 500 -q 2>/dev/null || exit 1

if command -v Rscript >/dev/null; then
    some=yes
    Rscript r/analysis.R "$folder/model" group || failed=1
    Rscript - "$folder/model" "$folder/joint" <<'R' || failed=1
source("r/apsm.R")
m <- read_apsm(commandArgs(TRUE)[1])
near <- function(a, b, what, tolerance = 1e-9) {
  if (!identical(dim(a), dim(b)) || max(abs(a - b)) > tolerance * max(1, abs(b))) stop(what)
}
stopifnot(length(m$names) == 7, m$names[3] == "s, \"2\"", is.logical(m$certified), !is.null(m$subjects$group))
rebuilt <- m$particles
for (i in 1:7) rebuilt[, , i] <- m$mean + apply(sweep(m$modes, 3, m$scores[i, ], "*"), 1:2, sum)
near(rebuilt, m$particles, "mean + scores x modes are not the particles", 1e-6)
near(prcomp(shape_matrix(m$particles))$sdev[1:6]^2, m$variances, "variances are not prcomp's", 1e-6)
turned <- m$particles
a <- qr.Q(qr(matrix(c(1, 2, 3, 4, 5, 7, 8, 1, 2), 3)))
turned[, , 2] <- 3 * turned[, , 2] %*% (a * sign(det(a))) + 5
near(dist(procrustes(turned)$mean), dist(procrustes(m$particles)$mean), "Procrustes depends on the pose", 1e-6)
joint <- read_apsm(commandArgs(TRUE)[2])
stopifnot(dim(joint$particles) == c(32, 3, 4), joint$part[c(16, 17)] == c("a", "b"), length(joint$certified) == 4)
near(apply(joint$particles, 1:2, mean), unname(joint$mean), "the mean of a joint", 1e-6)
cat("R: ok\n")
R
else
    echo "NOT TESTED: r/apsm.R; there is no R (r-base-core)"
fi
if command -v octave-cli >/dev/null; then
    some=yes
    octave-cli --quiet --eval "addpath('$here/octave'); m = read_apsm('$folder/model');
        r = m.mean; for k = 1:numel(m.variances), r = r + m.scores(3, k) * m.modes(:, :, k); end
        assert(r, m.particles(:, :, 3), 1e-6); assert(m.names{3}, 's, \"2\"'); assert(size(m.particles), [32 3 7]);
        j = read_apsm('$folder/joint'); assert(mean(j.particles, 3), j.mean, 1e-6); assert(j.part([16 17]), {'a'; 'b'}); disp('Octave: ok')" || failed=1
else
    echo "NOT TESTED: octave/read_apsm.m; there is no Octave"
fi
[ $some = no ] && exit 77
exit $failed
