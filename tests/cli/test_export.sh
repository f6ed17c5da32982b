#!/bin/bash
# apsm export --to: every format, read by other readers than ours where they are installed.
# $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
readers=$here/read_exports.py

# export CODE WORDS ARGUMENT...
export_() {
    local code=$1 words=$2
    shift 2
    "$apsm" export "$@" >said 2>&1
    local got=$?
    [ $got -eq "$code" ] || fail "export $*: exit code $got, not $code: $(cat said)"
    grep -qF -- "$words" said || fail "export $* does not say '$words': $(cat said)"
}

mkdir cohort
for i in 0 1 2 3 4 5; do "$synthetic" bump cohort/s$i.ply index $i count 8 level 3; done
"$apsm" run cohort -o model -J 32 --faces 800 --stage1-epochs 3 --stage2-epochs 3 --quiet || fail run
find model -type f -exec cksum {} + | sort >before

for format in vtp ply stl obj monai slicermorph csv; do
    export_ 0 "$format of model" model --to $format -o $format
    [ -s $format/export.json ] || fail "$format has no export.json"
done
export_ 0 "npz of model" model --to npz -o model.npz
export_ 0 "gltf of model" model --to gltf -o model.glb --modes 3
export_ 0 "scalismo of model" model --to scalismo -o model.h5
export_ 0 "statismo of model" model --to statismo -o again.h5
cmp -s model.h5 again.h5 || fail "the same HDF5 file has other bytes"
# Back as a model folder that is fitted; without scores its shapes are drawn, of the same mean and variance.
expect 0 "imported: 6 shapes of 128 particles; report" import model.h5 -o back
"$apsm" compare model back >said 2>&1 && grep -q '6 shapes, 32 particles; B: 6 shapes, 128' said || fail "compare: $(cat said)"
awk '/mode 1:/ { good = $3 + 0 > 98 } END { exit !good }' said || fail "mode 1 is not what it was: $(cat said)"
expect 0 "refused: 0; failed: 0" fit back cohort/s1.ply --force -o fits # its surface is finer than the model's
cases=$here/../data/cases/hdf5
expect 0 "imported: 4 shapes of 12 particles; report" import "$cases/old.h5" -o shapes
sed 's/scores/scorez/' "$cases/old.h5" >noscores.h5
expect 0 "imported: 3 shapes of 12 particles, drawn" import noscores.h5 -o drawn
grep -q 'drawn from a model' drawn/manifest.json || fail "the manifest does not say that shapes are nobody's"
"$apsm" compare shapes drawn >said 2>&1 && sed -n 's/^variance of a point: A \(.*\), B \(.*\)/\1 \2/p' said |
    awk '{ d = $1 - $2; good = d * d < 0.0025 * $1 * $1 } END { exit !good }' || fail "drawn shapes vary otherwise: $(cat said)"
expect 0 "imported: 4 shapes of 12 particles; report" import "$cases/scalismo.h5.json" -o json
cmp -s shapes/particles/shape_001_world.particles json/particles/shape_001_world.particles || fail "HDF5/JSON gives other shapes"
head -c 3000 model.h5 >cut.h5
expect 1 "is cut short" import cut.h5 -o none
for word in pcaBasis pcaVariance cells points mean; do
    sed "s/$word/${word%?}_/" "$cases/old.h5" >other.h5
    expect 1 "$word; a model file of Scalismo" import other.h5 -o none
done
expect 2 "is imported alone" import model.h5 model.h5 -o none
[ -e none ] && fail "a refused import left a folder"

# The same model gives the same bytes.
export_ 0 "npz of model" model --to npz -o again.npz
cmp -s model.npz again.npz || fail "the same .npz has other bytes"

# Modes and deviations as asked for; an earlier export makes room, what is not ours does not.
export_ 1 "give --overwrite" model --to ply -o ply
export_ 0 "ply of model" model --to ply -o ply --overwrite --modes 1 --sd 1,3
[ "$(ls ply/modes | tr '\n' ' ')" = "mode_01_minus1sd.ply mode_01_minus3sd.ply mode_01_plus1sd.ply mode_01_plus3sd.ply " ] ||
    fail "modes: $(ls ply/modes)"
echo mine >ply/modes/mode_02_plus1sd.ply
export_ 1 "is not of an earlier call" model --to ply -o ply --overwrite --modes 2 --sd 1
[ "$(cat ply/modes/mode_02_plus1sd.ply)" = mine ] || fail "a file of somebody else was replaced"
[ -s ply/mean.ply ] || fail "a refused export removed an earlier one"
# An export that was killed is cleared up by the next, wherever it was; what is not of it stays.
for seconds in 0.01 0.05 0.1; do
    (timeout -s KILL $seconds "$apsm" export model --to stl -o killed --quiet) >said 2>&1
    [ ! -d killed ] || [ -z "$(ls killed)" ] || [ -e killed/export.json ] || [ -e killed/export.json.unfinished ] ||
        fail "a killed export leaves no list: $(ls killed)"
    [ -e killed/export.json ] && rm -r killed # it was faster
done
[ ! -d killed ] || export_ 0 "" model --to stl -o killed
rm -rf killed
mkdir killed && printf 'export.json\nmean.stl\n' >killed/export.json.unfinished
echo half >killed/mean.stl.77.tmp && echo half >killed/mean.stl
echo mine >killed/notes.txt
export_ 1 "notes.txt: is not of an earlier call" model --to stl -o killed
rm killed/notes.txt
export_ 0 "files of an interrupted call are replaced" model --to stl -o killed
[ -s killed/export.json ] && [ ! -e killed/export.json.unfinished ] && [ -z "$(find killed -name '*.tmp')" ] ||
    fail "after an interruption: $(ls killed)"
mkdir other && echo mine >other/notes.txt
export_ 1 "other files" model --to csv -o other --overwrite
export_ 1 "give --overwrite" model --to npz -o model.npz
export_ 2 "is a file" model --to csv -o model.npz
export_ 2 "is a folder" model --to npz -o csv
export_ 2 "--to bmp: give vtp" model --to bmp -o x
export_ 2 "--sd 0" model --to ply -o x --sd 0,1
export_ 2 "--modes 0" model --to ply -o x --modes 0
export_ 2 "needs a format and an output" model
export_ 2 "needs an output" model --to ply
export_ 2 ".glb" model --to gltf -o model.gltf
export_ 1 "no such file" nothing --to ply -o x
[ -e x ] && fail "a refused export left x"
find model -type f -exec cksum {} + | sort | cmp -s before - || fail "export changed the model"

for python in python3 /usr/bin/python3; do
    command -v $python >/dev/null && $python -c 'import numpy' 2>/dev/null && break
    python=
done
if [ -n "$python" ]; then
    "$python" "$readers" . || fail "what other readers see of the exports"
else
    echo "NOT TESTED: exports read by others; there is no Python with NumPy (python3-numpy)"
fi
# Khronos' validator and three.js, where `make test-readers` has put them.
packages=${READERS:-$here/../../build/readers}
if command -v node >/dev/null && [ -d "$packages/node_modules/three" ]; then
    cp "$here/../readers/read_exports.mjs" "$packages" && node "$packages/read_exports.mjs" . || fail "what three.js sees of the exports"
else
    echo "NOT TESTED: exports read by Khronos' validator and three.js (make test-readers)"
fi
exit $failed
