#!/bin/bash
# A part that is missing is completed from the others: parts that grow together, by a factor that the model has not seen.
#   test_joint_missing.sh APSM MAKE_SYNTHETIC
# shellcheck source=tests/cli/head.sh
. "$(dirname "$0")/head.sh"
mkdir in new both
"$synthetic" ellipsoid a.ply level 3 index 1 count 6 wobble 0.05 seed 3 || exit 1
"$synthetic" ellipsoid b.ply level 3 index 3 count 6 wobble 0.05 seed 8 shift 60 || exit 1
k=0
for size in 0.80 0.86 0.93 0.97 1.04 1.10 1.21; do
    for part in a b; do "$synthetic" $part.ply in/s${k}_$part.ply scale $size wobble 0.012 seed $((k + 20)) || exit 1; done
    k=$((k + 1))
done
rm in/s6_b.ply # it says so, and is left out
for part in a b; do "$synthetic" $part.ply grown_$part.ply scale 1.13 turn 50 wobble 0.012 seed 77 || exit 1; done
cp grown_a.ply new/n_a.ply && cp grown_a.ply both/n_a.ply && cp grown_b.ply both/n_b.ply
expect 0 "s6: has no b; it is in the models of its parts, not in that of the joint" run in -o m --parts a=_a,b=_b -J 24 --faces 800 --stage1-epochs 4 --stage2-epochs 2 --threads 1
expect 0 "1 of 2 parts are what the others let expect" fit m new -o fit
expect 0 "" fit m both -o whole
# Their particles lie in the frame of the joint: no model of a part takes them for its own.
expect 1 "these are fits of the parts of a joint" norm m/parts/a fit
expect 2 "is another model" norm m/parts/a m
expect 2 "is another model" norm m/parts/a m/parts/b/particles/*_world.particles
expect 1 "these are fits of the parts of a joint" norm m whole/particles/*_a_world.particles
volume() { "$apsm" info "$1" | sed -n 's/.*volume \([0-9.e+]*\)$/\1/p'; }
awk -v is="$(volume fit/meshes/n_b_fit.ply)" -v true="$(volume grown_b.ply)" 'BEGIN { exit !(is / true > 0.95 && is / true < 1.05) }' ||
    fail "the completed part has a volume of $(volume fit/meshes/n_b_fit.ply), not $(volume grown_b.ply)"
off=$(paste fit/particles/n_b_original.particles whole/particles/n_b_original.particles |
    awk '{ d += sqrt(($1 - $4)^2 + ($2 - $5)^2 + ($3 - $6)^2) / 24 } END { print d }')
awk -v d="$off" 'BEGIN { exit !(d < 9) }' || fail "the completed part is $off away" # where the pose is taken from the mean: 23
# With nothing missing the same scores, to what a fit is sure of.
awk -F, 'FNR == 1 { for (k = 1; k <= NF; k++) if ($k == "mode_1") c = k; next } { x[n++] = $c } END { d = x[0] - x[1]; if (d < 0) d = -d; exit !(d < 8) }' \
    fit/joint_fit.csv whole/joint_fit.csv || fail "scores: $(tail -qn 1 fit/joint_fit.csv whole/joint_fit.csv)"
exit $failed
