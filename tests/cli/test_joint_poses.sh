#!/bin/bash
# Two ellipsoids side by side, which are the same after half a turn each: where one lies from the other tells how a
# subject is turned, in whatever pose it comes.
#   test_joint_poses.sh APSM MAKE_SYNTHETIC
# shellcheck source=tests/cli/head.sh
. "$(dirname "$0")/head.sh"
mkdir turned
for i in 0 1 2 3 4 5; do
    "$synthetic" ellipsoid a.ply level 3 index $i && "$synthetic" ellipsoid b.ply level 3 index $((6 - i)) shift 60 || exit 1
    for part in a b; do "$synthetic" $part.ply turned/${i}_$part.ply turn $((70 * i)) || exit 1; done
done
run=(--parts a=_a,b=_b -J 16 --faces 600 --stage1-epochs 4 --stage2-epochs 2 --threads 1)
expect 0 "all parts together tell how 6 of 6 subjects are turned" run turned -o model "${run[@]}"
share=$(sed -n 's/^joint of 2 parts.* \([0-9]*\) % of the variance is pose/\1/p' said)
[ "$share" -lt 5 ] || fail "$share % of the variance is pose"
grep -q 'another pose' model/certificate.json && fail "a pose is in doubt: $(tail -n 5 said)"
# Going on changes nothing.
cp model/parts/a/project.swproj before
expect 0 "" run --resume turned -o model "${run[@]}"
cmp -s before model/parts/a/project.swproj || fail "--resume has aligned anew"

# A new subject's ellipsoid, which is the same after half a turn, is turned as its other part says: scores are those of the
# cohort's subjects, of which these are turned ones.
mkdir told new
for i in 0 1 2 3 4 5; do
    "$synthetic" ellipsoid a.ply level 3 index $i wobble 0.08 seed 3 && "$synthetic" ellipsoid b.ply level 3 index $((6 - i)) shift 60 || exit 1
    for part in a b; do cp $part.ply told/${i}_$part.ply && "$synthetic" $part.ply new/${i}_$part.ply turn $((50 * i + 40)) || exit 1; done
done
expect 0 "" run told -o told.model "${run[@]}"
expect 0 "refused: 0; failed: 0" fit told.model new -o fit
awk -F, 'FNR == 1 { for (k = 1; k <= NF; k++) if ($k == "mode_1") c = k; next } NR == FNR { x[$1] = $c; next } { sub(/,".*",/, ",,"); d = $c - x[$1]; s += d * d } END { exit !(s < 30) }' \
    told.model/scores.csv fit/joint_fit.csv || fail "scores: $(cat told.model/scores.csv fit/joint_fit.csv)"

# Where a cohort came in one orientation, a new shape of the other side is expected in it, too, once it is mirrored.
mkdir in mirrored
for i in 0 1 2 3 4 5; do
    "$synthetic" ellipsoid in/e$i.ply level 3 index $i wobble 0.04 seed $((i + 5)) && "$synthetic" in/e$i.ply mirrored/e$i.ply mirror 1 || exit 1
done
expect 0 "" run in -o m -J 24 --faces 600 --threads 1 --stage1-epochs 4 --stage2-epochs 2
expect 0 "" fit m in -o same --hand same
expect 0 "" fit m mirrored -o other --hand other
awk -F, '{ sub(/,".*",/, ",,") } FNR == 1 { for (k = 1; k <= NF; k++) if ($k == "mode_1") c = k; next } { for (k = 0; k < 3; k++) if (NR < 9) x[$1, k] = $(c + k); else s += ($(c + k) - x[$1, k])^2 } END { exit !(s > 0 && s < 14) }' \
    same/fit.csv other/fit.csv || fail "mirrored shapes lie otherwise: $(cat same/fit.csv other/fit.csv)"
exit $failed
