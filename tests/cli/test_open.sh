#!/bin/bash
# Open surfaces and constraints, from the command line.  $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
quick=(-J 16 --faces 400 --stage1-epochs 1 --stage2-epochs 1 --fidelity-rounds 2
    --specificity-samples 10 --threads 2)

# below AXIS BOUND FILE...: no particle's coordinate (1 to 3) is above the bound; some is near it.
below() {
    awk -v a="$1" -v b="$2" '$a > b { bad++ } $a > b - 3 { near++ } END { exit bad > 0 || near == 0 }' \
        "${@:3}" || fail "particles are not below $2 along axis $1, or none is near: ${*:3}"
}

# ---- openings: a question, left, or closed ----
mkdir -p bowl/shapes
for i in 0 1 2 3; do
    "$synthetic" bump bowl/shapes/b$i.ply index $i level 3 open .7 || exit 1
done
expect 1 "--open" groom bowl/shapes -o q
expect 1 "--fill" check bowl/shapes
[ -e q ] && fail "a refused opening left a folder"
expect 0 "holes closed" groom bowl/shapes -o q --fill --faces 400
grep -q '"text": "an opening was closed' q/manifest.json || fail "a large lid is no note"
expect 0 "" run bowl/shapes -o bowl/m --open "${quick[@]}"
grep -q '"openings": 1' bowl/m/manifest.json || fail "openings are not in the manifest"
expect 0 "agree" verify bowl/m
expect 0 "" run bowl/shapes -o bowl/m2 --open "${quick[@]}" --threads 1
cmp bowl/m/model.json bowl/m2/model.json || fail "threads change an open model"

# ---- planes: a folder, a project, the frame of mirrored shapes ----
plane='{"planes": [{"points": [[0, 0, 6], [0, 1, 6], [1, 0, 6]]}, {"normal": [0, -2, 0], "point": [3, 9, 5]}]}'
mkdir in limits
for i in 0 1 2 3; do
    "$synthetic" ellipsoid in/e$i.ply index $i level 2 || exit 1
    echo "$plane" >limits/e$i.json
done
expect 0 "constraints leave" run in -o m --constraints limits "${quick[@]}" --original-frame
below 3 6.01 m/particles/*_original.particles
below 2 9.01 m/particles/*_original.particles
grep -q '"kept": 0\.' m/manifest.json || fail "the manifest does not say what constraints left"
[ -e m/groomed/whole/e0.ply ] || fail "the whole surface is not kept"
expect 0 "agree" verify m
expect 0 "" run in -o mirrored --constraints limits "${quick[@]}" --original-frame --reflect-match 'e[13]'
below 3 6.01 mirrored/particles/*_original.particles
below 2 9.01 mirrored/particles/*_original.particles
{
    echo '{"data": ['
    for i in 0 1 2 3; do
        printf '{"name": "e%s", "shape_1": "in/e%s.ply", "constraints_1": "limits/e%s.json"}' $i $i $i
        [ $i = 3 ] || echo ,
    done
    echo ']}'
} >p.swproj
expect 0 "constraints leave" groom p.swproj -o p --faces 400
grep -qF '"constraints_1": "../limits/e0.json"' p/project.swproj || fail "the project lost its constraints"
cmp m/groomed/e1.ply p/groomed/e1.ply || fail "constraints of a project are others than those of a folder"
expect 0 "ignored, as asked for" groom p.swproj -o ignored --ignore constraints --faces 400
[ -e ignored/groomed/whole ] && fail "ignored constraints cut surfaces"

# ---- new shapes meet such models: open ones are whole, closed ones are refused ----
"$synthetic" ellipsoid closed.ply index 1 level 2
for of in bowl/m:bowl/shapes/b1.ply m:m/groomed/e1.ply; do
    timeout $((60 * slower)) "$apsm" fit "${of%:*}" "${of#*:}" closed.ply -o fits --overwrite --hand same >said 2>&1
    grep -q "closed: refused: is a closed surface, and the model's shapes are open ones" said || fail "fit ${of%:*}: $(cat said)"
    grep -q '"partial": false' fits/fit.json || fail "an open shape is a part of an open model: $of: $(cat said)"
    grep -q '"partial": true' fits/fit.json && fail "an open shape is a part of an open model: $of: $(cat said)"
done
"$synthetic" bowl/shapes/b1.ply half.ply scale .5
timeout $((60 * slower)) "$apsm" fit bowl/m half.ply bowl/shapes/b2.ply -o fits --overwrite --hand same >said 2>&1
grep -q "half: refused: .*(of a part say --extent part)" said || fail "nothing is said of parts: $(cat said)"
[ "$(grep -c "extent part" said)" = 1 ] || fail "parts are spoken of where nothing is refused: $(cat said)"

# ---- one shape's, carried to the others ----
mkdir one && cp limits/e2.json one
expect 0 "3 of 4 shapes have no constraints: those of e2 are carried" run in -o c --constraints one \
    "${quick[@]}" --original-frame
below 3 6.01 c/particles/e2_original.particles
below 3 8 c/particles/*_original.particles
cp limits/e2.json mine.json
expect 2 "is called like none" groom in -o q2 --constraints mine.json
expect 0 "those of e1 are carried" groom in -o q2 --constraints mine.json --template e1 --faces 400

# ---- two parts that touch ----
mkdir peanut
for i in 0 1 2; do
    "$synthetic" ellipsoid peanut/s${i}_lo.ply index $i level 2 open .55 || exit 1
    "$synthetic" ellipsoid peanut/s${i}_up.ply index $i level 2 open -.55 || exit 1
done
parts=(--parts lo=_lo,up=_up --fill)
expect 0 "lo-up: what lo and up share" run peanut -o peanut/m "${parts[@]}" --shared-boundary lo,up,.2 "${quick[@]}"
for part in lo up lo-up; do
    grep -q '"openings": 1' peanut/m/parts/$part/manifest.json || fail "part $part is not open"
done
expect 0 "agree" verify peanut/m
expect 2 "is not two parts" run peanut -o q3 "${parts[@]}" --shared-boundary lo,middle
expect 2 "no number" run peanut -o q3 "${parts[@]}" --shared-boundary lo,up,wide
mkdir apart && cp peanut/s*_lo.ply apart
for i in 0 1 2; do "$synthetic" peanut/s${i}_up.ply apart/s${i}_up.ply shift 100; done
expect 1 "do not touch" run apart -o q3 "${parts[@]}" --shared-boundary lo,up --faces 400
[ -e q3 ] && fail "a shared boundary that is refused left $(find q3 | head -n 3)"

# ---- what cannot be followed ----
bad() { # bad WORDS JSON
    echo "$2" >one/e2.json
    expect 1 "$1" groom in -o bad --constraints one
    [ -e bad ] && fail "refused constraints left a folder: $2"
}
bad "leave nothing" '{"planes": [{"points": [[0, 0, 99], [1, 0, 99], [0, 1, 99]]}]}'
bad "not in a line" '{"planes": [{"points": [[0, 0, 0], [1, 0, 0], [2, 0, 0]]}]}'
bad "not known here" '{"cylinders": []}'
bad "no \"radius\" above 0" '{"spheres": [{"center": [0, 0, 0]}]}'
bad "no \"radius\" above 0" '{"spheres": [{"center": [0, 0, 0], "radius": -1}]}'
bad "query_point" '{"free_form_constraints": {"boundaries": [{"points": [[0,0,0],[1,0,0],[0,1,0]]}]}}'
bad "do not part" '{"free_form_constraints": {"query_point": [1,2,3], "boundaries": [{"points": [[0,0,14],[0,0,14.1],[0,0.1,14]]}]}}'
bad "as many" '{"free_form_constraints": {"field": {"points": [[0,0,0]], "scalars": []}}}'
bad "one/e2.json:2" '{"planes": '
expect 2 "no file that is called like a shape" groom in -o bad --constraints bowl
expect 1 "cannot be read" groom in -o bad --constraints nowhere.json --template e1
expect 1 "cannot be read" check in --constraints nowhere.json --template e1
[ -e bad ] && fail "refused constraints left a folder"
exit $failed
