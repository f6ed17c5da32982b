#!/bin/bash
# apsm import and warp from outside.  $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"

# far FILE FILE: largest difference of numbers in the same places.
far() {
    paste -d' ' <(tr ',' ' ' <"$1") <(tr ',' ' ' <"$2") | awk '{ h = NF / 2
        for (i = 1; i <= h; i++) { d = $i - $(h + i); if (d < 0) d = -d; if (d > m) m = d } }
        END { printf "%.9f\n", m + 0 }'
}

mkdir cohort new
for i in 0 1 2 3 4 5 6; do "$synthetic" bump cohort/s$i.ply index $i count 8 level 3; done
"$synthetic" bump new/x.ply index 7 count 8 level 3
"$apsm" run cohort -o model -J 32 --faces 800 --stage1-epochs 3 --stage2-epochs 3 --quiet 2>said || fail "run: $(cat said)"

# ---- import: from a project, and from files ----

expect 0 "imported: 7 shapes of 32 particles" import model/project.swproj -o again
expect 0 "agree with" verify again
[ "$(sed -n 's/.*"verdict": "\([a-z ]*\)".*/\1/p' again/certificate.json | head -1)" = \
    "$(sed -n 's/.*"verdict": "\([a-z ]*\)".*/\1/p' model/certificate.json | head -1)" ] || fail "another verdict"
cmp -s model/scores.csv again/scores.csv || fail "import of our own project gives other scores"
expect 0 "refused: 0; failed: 0" fit again new/x.ply -o fits
expect 0 "csv of again" export again --to csv -o tables
expect 0 "excluded: 1" exclude again "$(sed -n '4s/,.*//p' model/scores.csv)"
expect 1 "holds a model already" import model/project.swproj -o again
expect 0 "imported: 7" import model/particles/*_local.particles model/groomed/*.ply -o local
mkdir elsewhere # another frame
for i in 0 1 2 3 4 5 6; do "$synthetic" model/groomed/s$i.ply elsewhere/s$i.ply shift 30; done
expect 1 "are not on it" import model/particles/*_world.particles elsewhere/*.ply -o mixed
expect 2 "needs a mesh for each shape" import model/particles/*_world.particles -o bare
expect 2 "needs a model folder" import model/project.swproj
[ -e mixed ] || [ -e bare ] && fail "a refused import left a folder"

# ---- warp: the reconstructions, landmarks, tetrahedra with their labels ----

template=$(sed -n 's/.*"template": "\(.*\)",/\1/p' model/evaluation.json)
other=$(ls model/particles/*_local.particles | grep -v "/${template}_" | head -1)
name=$(basename "$other" _local.particles)
own=model/particles/${template}_local.particles
expect 0 "warped: 1 shape" warp "model/groomed/$template.ply" "$own" "$other" -o warped --to obj
"$apsm" warp "model/groomed/$template.ply" "$own" "$own" "$other" -o both --quiet || fail "warp of two"
[ "$(ls both | wc -l)" = 3 ] || fail "two particle sets gave $(ls both)"
"$apsm" info "both/${name}_local.ply" >got && "$apsm" info "model/meshes/${name}_reconstructed.ply" >want
cmp -s got want || fail "warp is not the reconstruction: $(diff got want)"
{
    echo name,x,y,z
    awk 'NR <= 3 { print "mark" NR "," $1 "," $2 "," $3 }' "$own"
} >marks.csv
{
    printf '# vtk DataFile Version 3.0\ntwo\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS 5 float\n'
    head -5 "$own"
    printf 'CELLS 2 10\n4 0 1 2 3\n4 1 2 3 4\nCELL_TYPES 2\n10 10\nCELL_DATA 2\nSCALARS tissue int 1\nLOOKUP_TABLE default\n7 9\n'
} >solid.vtk
expect 0 "warped: 1 shape" warp "model/groomed/$template.ply" "$own" "$other" -o carried --attach marks.csv,solid.vtk
head -3 "$other" | awk '{ print $1, $2, $3 }' >want
tr -d '\n' <"carried/${name}_local_marks.mrk.json" | grep -o '"position": *\[[^]]*\]' | sed 's/.*\[//; s/\]//; s/,/ /g' >got
[ "$(wc -l <got)" = 3 ] && [ "$(far got want)" \< 0.000001 ] || fail "landmarks at particles are not there: $(cat got)"
sed -n '6,10p' "carried/${name}_local_solid.vtk" >got
head -5 "$other" >want
[ "$(far got want)" \< 0.000001 ] || fail "points of the tetrahedra at particles are not there"
grep -q '^7 9$' "carried/${name}_local_solid.vtk" || fail "labels are lost"
awk '{ print -$1, $2, $3 }' "$own" >mirror.particles
expect 0 "2 tetrahedra are inside out: 0, 1" warp "model/groomed/$template.ply" "$own" mirror.particles -o turned --attach solid.vtk
tr -d ' \n' <turned/warp.json | grep -q '"mirror_solid.vtk":\[0,1\]' || fail "warp.json does not list them: $(cat turned/warp.json)"
expect 0 "warped: 7 shapes" warp model model/project.swproj -o all --to vtp
expect 1 "files of an earlier call" warp model model/project.swproj -o all
expect 0 "warped: 7 shapes" warp model model/project.swproj -o all --overwrite
awk '{ print $1 + 999, $2, $3 }' "$own" >off.particles
expect 1 "is not on it" warp "model/groomed/$template.ply" off.particles "$other" -o x
expect 1 "no such file" warp model "$other" -o x --attach nothing.vtk
expect 2 "give landmarks" warp model "$other" -o x --attach new/x.ply
expect 2 "give ply, vtp" warp model "$other" -o y --to bmp
head -c 200 solid.vtk >cut.vtk
expect 1 "cut.vtk" warp model "$other" -o z --attach cut.vtk
exit $failed
