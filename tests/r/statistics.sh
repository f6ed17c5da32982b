#!/bin/sh
# Statistics of a small cohort, and all of them again in R.  $1 program, $2 make_synthetic.  77: there is no R.
set -u
apsm=$1 synthetic=$2
command -v Rscript >/dev/null || {
    echo "NOT TESTED: statistics by other arithmetic; there is no R (r-base-core)"
    exit 77
}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir "$folder/cohort"
i=0
while [ $i -lt 12 ]; do
    "$synthetic" ellipsoid "$folder/cohort/s$i.ply" index $((i * 5 % 12)) count 12 wobble 0.03 seed $((i + 1)) level 3 || exit 1
    i=$((i + 1))
done
run() {
    "$apsm" "$@" --quiet 2>"$folder/said" || {
        cat "$folder/said"
        echo "FAILED: apsm $*"
        exit 1
    }
}
run run "$folder/cohort" -o "$folder/model" -J 32 --faces 800 --stage1-epochs 2 --stage2-epochs 1
{
    echo "name,group,age,dose,person,side,luck,pair"
    i=0
    while [ $i -lt 12 ]; do
        luck=$((i * i % 7 + i))
        pair=q$((i / 2))
        [ $i -gt 9 ] && luck='' pair=q0
        side=left
        [ $((i % 2)) -eq 1 ] && side=right
        group=a
        [ $((i * 7 % 12)) -gt 5 ] && group=b
        [ $i -gt 9 ] && group=
        echo "s$i,$group,$((20 + i * i * 7 % 13)).5,d$((i % 3)),p$((i / 2)),$side,$luck,$pair"
        i=$((i + 1))
    done
} >"$folder/table.csv"
for on in form shape size modes; do run test "$folder/model" --subjects "$folder/table.csv" --formula '~ group' --on $on -o "$folder/a"; done
run test "$folder/model" --formula '~ age + group' --subjects "$folder/table.csv" -o "$folder/c" --bootstraps 0
run test "$folder/model" --formula '~ group' --subjects "$folder/table.csv" -o "$folder/v" --bootstraps 0 --variances unequal
run test "$folder/model" --formula '~ dose + age' --subjects "$folder/table.csv" -o "$folder/d" --bootstraps 0 --permutations 99
run test "$folder/model" --formula '~ group*age' --of group:age --subjects "$folder/table.csv" -o "$folder/d" --bootstraps 0 --permutations 99
run test "$folder/model" --formula '~ side' --within person --subjects "$folder/table.csv" -o "$folder/e"
run test "$folder/model" --formula '~ side + age' --within person --subjects "$folder/table.csv" -o "$folder/f"
run asymmetry "$folder/model" --of side --within person --subjects "$folder/table.csv" -o "$folder/e"
run asymmetry "$folder/model" --of side --within pair --on size --subjects "$folder/table.csv" -o "$folder/g"
world=$folder/model/particles
awk '{ print $1 * 1.03 + 0.1 * sin(NR), $2, $3 * 0.98 }' "$world/s3_world.particles" >"$folder/new1_world.particles"
awk '{ print $1, $2 * 1.1, $3 + (NR == 5) }' "$world/s7_world.particles" >"$folder/new2_world.particles"
run predict "$folder/model" --of luck --subjects "$folder/table.csv" "$folder/new1_world.particles" "$folder/new2_world.particles" -o "$folder/p"
(cat "$folder/table.csv" && echo "new1,a,25,d1,,,," && echo "new2,a,31,d1,,,,") >"$folder/all.csv"
run norm "$folder/model" "$folder/new1_world.particles" "$folder/new2_world.particles" --subjects "$folder/all.csv" --formula '~ age' -o "$folder/n"
cp -r "$folder/model" "$folder/bare" && rm -r "$folder/bare/meshes" # no normals: in all directions
run norm "$folder/bare" "$folder/new1_world.particles" "$folder/new2_world.particles" --subjects "$folder/all.csv" --formula '~ age' -o "$folder/n3"
cat >"$folder/define.json" <<'JSON'
{"measurements": [{"name": "across", "kind": "distance", "points": [0, 7]},
 {"name": "bend", "kind": "angle", "points": [0, 3, 7]}, {"name": "turn", "kind": "angle", "points": [0, 3, 7, 11]},
 {"name": "height", "kind": "plane-distance", "points": [0, 1, 4, 8, 13]},
 {"name": "ball", "kind": "sphere", "points": [0, 4, 8, 13, 19, 26]}, {"name": "volume", "kind": "volume"},
 {"name": "area", "kind": "area"}, {"name": "middle", "kind": "section", "points": [0, 7, 19], "whole": true}]}
JSON
run measure "$folder/model" "$folder/define.json" -o "$folder/q"
Rscript tests/r/statistics.R "$folder" || {
    [ -n "${KEEP-}" ] && cp -r "$folder" "$KEEP"
    exit 1
}
