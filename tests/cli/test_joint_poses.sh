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
exit $failed
