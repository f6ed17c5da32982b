#!/bin/bash
# What a project of ShapeWorks asks for by keys of groom and optimize: reflection and fixed shapes by columns, fields of the surface.
#   test_shapeworks_keys.sh APSM MAKE_SYNTHETIC
# shellcheck source=tests/cli/head.sh
. "$(dirname "$0")/head.sh"
mkdir in
for i in 0 1 2 3 4; do
    "$synthetic" bump in/s$i.ply level 3 index $i wobble 0.05 seed 3 patch $((60 + 5 * i)) || exit 1
done
for i in 1 3; do "$synthetic" bump in/m$i.ply level 3 index $i wobble 0.05 seed 3 mirror 1 patch $((60 + 5 * i)) || exit 1; done
run=(-J 16 --faces 500 --stage1-epochs 4 --stage2-epochs 2 --threads 1)
row() { printf '{"name": "%s", "shape_1": "in/%s.ply", "group_side": "%s", "held": "%s"}' "$@"; }
rows="$(row a s0 R yes), $(row b m1 L no), $(row c s2 R yes), $(row d m3 L no), $(row e s4 R yes)"
project() { printf '{"data": [%s], %s}' "$rows" "$1"; }
reflect='"reflect": "true", "reflect_column": "group_side", "reflect_choice": "L"'
project "\"groom\": {$reflect, \"reflect_axis\": \"X\"}" >p.swproj
expect 0 "5 shapes groomed, 2 of them mirrored" run p.swproj -o m "${run[@]}"
grep -q 'reflect_column' m/project.swproj || fail "the project has lost groom"
project "\"groom\": {\"1\": {$reflect}}" >d.swproj
expect 0 "2 of them mirrored" run d.swproj -o d "${run[@]}"
expect 0 "ignored, as asked for by --ignore: shapes reflected" run d.swproj -o i "${run[@]}" --ignore reflect
grep -q '"mirrored": "yes"' i/project.swproj && fail "reflected though it was to be ignored"
project "\"groom\": {$reflect, \"reflect_axis\": \"Y\"}" >y.swproj
expect 1 "about another axis than X" run y.swproj -o x "${run[@]}"
project "\"groom\": {${reflect/group_side/group_hand}}" >c.swproj
expect 1 "by a column that no shape has" run c.swproj -o x "${run[@]}"

project '"optimize": {"use_geodesics_to_landmarks": "true"}, "groom": {"shared_boundary": "true"}' >k.swproj
expect 1 "use_geodesics_to_landmarks); the boundary that two domains share" run k.swproj -o x "${run[@]}"
expect 0 "ignored" run k.swproj -o x "${run[@]}" --dry-run --ignore geodesics,shared

# ---- fields ----
project '"optimize": {"field_attributes": "heat", "field_attribute_weights": "100"}' >f.swproj
expect 0 "field_attributes (heat) must correspond" run f.swproj -o f "${run[@]}" --reflect-match '^m'
head -n 1 f/features.csv | grep -q heat || fail "the field was not sampled"
"$synthetic" bump in/new.ply level 3 index 2 wobble 0.05 seed 4 patch 70 || exit 1
expect 1 "its shapes correspond by 'heat', too" add f in/new.ply
expect 0 "field_attributes (heat) must correspond" run f.swproj -o x "${run[@]}" --reflect-match '^m' --features normals --dry-run
expect 0 "" run f.swproj -o x "${run[@]}" --reflect-match '^m' --features heat:2 --dry-run
grep -q 'must correspond' said && fail "--features heat:2: the project's weight is told"
expect 0 "" run f.swproj -o g "${run[@]}" --reflect-match '^m' --ignore fields
[ -e g/features.csv ] && fail "--ignore fields: the field was sampled"
cp g/groomed/* f/groomed/ # as grooming left them when fields were not followed
expect 1 "groom again, or --ignore fields" evaluate f
project '"optimize": {"field_attributes": "heat cold"}' >n.swproj
expect 1 "cold" run n.swproj -o x "${run[@]}"

# ---- fixed shapes by another column and choice ----
sed 's/"held": "yes"/"held": "old"/g' m/project.swproj | python3 -c '
import json, sys
p = json.load(sys.stdin)
for r in p["data"]: r["local_particles_1"] = "m/" + r["local_particles_1"]; r["world_particles_1"] = "m/" + r["world_particles_1"]; r["shape_1"] = r["shape_1"].replace("../", "")
p["optimize"].update(use_fixed_subjects="1", fixed_subjects_column="held", fixed_subjects_choice="old")
del p["apsm"]
json.dump(p, sys.stdout)' >q.swproj
expect 0 "" run q.swproj -o q "${run[@]}"
for name in a c e; do cmp -s m/particles/${name}_local.particles q/particles/${name}_local.particles || fail "$name was to stay"; done
sed 's/"fixed_subjects_choice": "old"/"fixed_subjects_choice": "new"/' q.swproj >none.swproj
expect 0 "none has 'new' in column 'held'" run none.swproj -o x "${run[@]}" --dry-run
exit $failed
