#!/bin/bash
# Constraints of ShapeWorks' old parameter files do what those of today's projects do, for one domain and for two.
#   test_old_projects.sh APSM MAKE_SYNTHETIC
# shellcheck source=tests/cli/head.sh
. "$(dirname "$0")/head.sh"
run=(--align none -J 16 --faces 600 --threads 1 -q)
for i in 0 1 2; do
    "$synthetic" ellipsoid a$i.ply index $i level 3 && "$synthetic" ellipsoid b$i.ply index $i level 3 shift 60 || exit 1
done

# same XML SWPROJ: both give one model
same() {
    rm -rf x y z
    expect 0 "" run "$1" -o x "${run[@]}"
    expect 0 "" run "$2" -o y "${run[@]}"
    cmp -s x/model.json y/model.json || fail "$1 and $2 give different models"
    expect 0 "" run x/project.swproj -o z "${run[@]}" --overwrite
    cmp -s x/model.json z/model.json || fail "the project made of $1 gives another model"
    expect 0 "" verify x
}
plane() { printf '{"planes": [{"points": [[0, 0, %s], [9, 0, %s], [0, 9, %s]]}]}' "$1" "$1" "$1"; }

# ---- planes ----
printf '<inputs> a0.ply a1.ply a2.ply </inputs>\n<num_planes_per_input> 1 0 1 </num_planes_per_input>
<cutting_planes> 0 0 5 9 0 5 0 9 5\n0 0 4 9 0 4 0 9 4 </cutting_planes>\n<number_of_particles> 16 </number_of_particles>' >planes.xml
plane 5 >p0.json && plane 4 >p2.json
printf '{"data": [{"name": "a0", "shape_1": "a0.ply", "constraints_1": "p0.json"}, {"name": "a1", "shape_1": "a1.ply"},
{"name": "a2", "shape_1": "a2.ply", "constraints_1": "p2.json"}]}' >planes.swproj
same planes.xml planes.swproj
[ -e x/constraints/a0_1.json ] && [ ! -e x/constraints/a1_1.json ] || fail "wrong files of constraints: $(ls x/constraints)"
grep -q '"constraints_1": "constraints/a2_1.json"' x/project.swproj || fail "x/project.swproj does not name its constraints"
grep -q cutting_planes x/project.swproj && fail "constraints are parameters as well"
expect 0 "ignored, as asked for" run planes.xml -o i "${run[@]}" --ignore constraints
mkdir sub
expect 0 "" convert planes.xml -o sub/planes.swproj
expect 0 "" run sub/planes.swproj -o c "${run[@]}"
cmp -s x/model.json c/model.json || fail "a converted parameter file gives another model"

# ---- spheres and a free form, two domains ----
circle() { # circle RADIUS BETWEEN: 16 points in the plane z = 0
    awk -v r="$1" -v between="$2" 'BEGIN { for (k = 0; k < 16; k++) print r * cos(k / 8 * 3.14159265) between r * sin(k / 8 * 3.14159265) between 0 }'
}
for i in 0 1 2; do
    "$synthetic" sphere s$i.ply index $i level 3 && "$synthetic" sphere t$i.ply index $i level 3 lift 60 || exit 1
    { printf 'query\n0 0 -30\nboundary_pts\n' && circle $((20 + i)) " "; } >form$i.ffc
    printf '{"free_form_constraints": {"boundaries": [{"points": [%s]}], "query_point": [0, 0, -30]}}' \
        "$(circle $((20 + i)) ", " | sed 's/.*/[&]/' | paste -sd,)" >form$i.json
done
: >empty.ffc
printf '<inputs> s0.ply t0.ply s1.ply t1.ply s2.ply t2.ply </inputs>\n<domains_per_shape> 2 </domains_per_shape>
<spheres_per_domain> 0 1 0 1 0 2 </spheres_per_domain>\n<sphere_radii> 8 8 8 7 </sphere_radii>
<sphere_centers> 0 0 80 0 0 81 0 0 82 0 0 38 </sphere_centers>
<ffcs> form0.ffc empty.ffc form1.ffc empty.ffc form2.ffc empty.ffc </ffcs>' >two.xml
for i in 0 1; do printf '{"spheres": [{"center": [0, 0, %s], "radius": 8}]}' $((80 + i)) >ball$i.json; done
printf '{"spheres": [{"center": [0, 0, 82], "radius": 8}, {"center": [0, 0, 38], "radius": 7}]}' >ball2.json
row() { printf '{"name": "s%s", "shape_1": "s%s.ply", "shape_2": "t%s.ply", "constraints_1": "form%s.json", "constraints_2": "ball%s.json"}' "$1" "$1" "$1" "$1" "$1"; }
printf '{"data": [%s, %s, %s]}' "$(row 0)" "$(row 1)" "$(row 2)" >two.swproj
same two.xml two.swproj
grep -q '"constraints_2": "constraints/s2_2.json"' x/project.swproj || fail "the joint does not name its constraints"

# ---- refused by name, before anything is written ----
refused() { # refused WORDS ELEMENTS
    printf '<inputs> a0.ply a1.ply </inputs>\n%s\n' "$2" >r.xml
    expect 1 "$1" run r.xml -o r "${run[@]}"
    expect 1 "$1" check r.xml
    [ -e r ] && fail "a refused file left a folder"
}
refused "'x' is no number" '<cutting_planes> 1 2 x </cutting_planes>'
refused "num_planes_per_input has 3 numbers for 2 inputs" '<num_planes_per_input> 1 1 1 </num_planes_per_input>'
refused "cutting_planes has 9 entries, where num_planes_per_input asks for 18" \
    '<num_planes_per_input> 1 1 </num_planes_per_input><cutting_planes> 0 0 1 9 0 1 0 9 1 </cutting_planes>'
refused "sphere_centers has 2 entries" '<spheres_per_domain> 1 0 </spheres_per_domain><sphere_radii> 1 </sphere_radii><sphere_centers> 1 2 </sphere_centers>'
refused "num_planes_per_input has 2 numbers" '<num_planes_per_input> -1 1 </num_planes_per_input>'
refused "cutting_plane_files are not read" '<cutting_plane_files> a b </cutting_plane_files>'
refused "absent.ffc" '<ffcs> absent.ffc empty.ffc </ffcs>'
refused "planes.xml: is no free form" '<ffcs> planes.xml empty.ffc </ffcs>'
refused "form0.ffc: is the second free form" '<num_ffcs_per_input> 2 0 </num_ffcs_per_input><ffcs> form0.ffc form0.ffc </ffcs>'
printf 'query\n1 2\n' >torn.ffc
refused "torn.ffc: is no free form" '<ffcs> torn.ffc empty.ffc </ffcs>'
printf '{"data": [{"name": "a0", "shape_1": "a0.ply", "constraints_1": "{torn"}]}' >torn.swproj
expect 1 "constraints/a0_1.json: 1:" run torn.swproj -o r "${run[@]}"
[ -e r ] && fail "a torn text left a folder"
exit $failed
