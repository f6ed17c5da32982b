#!/bin/bash
# check looks at every domain of a project, as run does: what is wrong is told once, and the exit code says so.
#   test_check_joint.sh APSM MAKE_SYNTHETIC
# shellcheck source=tests/cli/head.sh
. "$(dirname "$0")/head.sh"
"$synthetic" joint . count 3 angle 10 || exit 1
project() {
    printf '{"data": ['
    for i in 0 1 2; do
        [ $i = 0 ] || printf ', '
        printf '{"name": "s%d", "shape_a": "shapes/s0%d_a.ply", "shape_b": "%s"}' $i $i "${1:-shapes/s0${i}_b.ply}"
    done
    printf ']}\n'
}
project >whole.swproj
expect 0 "no problems found" check whole.swproj
[ "$(grep -cx '[ab]:' said)" = 2 ] || fail "not both parts are named: $(cat said)"
expect 0 "no problems found" check --domain b whole.swproj
grep -q '^a:' said && fail "a part that was not asked for: $(cat said)"
project shapes/nope.ply >gap.swproj
expect 1 "s1: shape_b: shapes/nope.ply does not exist" check gap.swproj
[ "$(grep -c 's1: shape_b' said)" = 1 ] || fail "told twice: $(cat said)"
# A finished joint is looked at part by part.
"$apsm" run shapes -o m --parts a=_a,b=_b -J 16 --faces 500 -q >said 2>&1 || fail "no joint: $(cat said)"
expect 0 "no problems found" check m
rm m/parts/b/groomed/s01_b.ply
expect 1 "s01_b: its groomed mesh m/parts/b/groomed/s01_b.ply does not exist" check m
# A model of one part beside somebody's folder called parts is none.
"$apsm" run shapes/s0?_a.ply -o one -J 16 --faces 500 -q >said 2>&1 || fail "no model: $(cat said)"
mkdir one/parts
expect 0 "no problems found" check one
# Wrong only in the part that comes second.
printf 'ply\n' >shapes/torn.ply
project shapes/torn.ply >torn.swproj
expect 1 "torn.ply" check torn.swproj
exit $failed
