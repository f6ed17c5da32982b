#!/bin/bash
# apsm verify tells every disagreement between a model folder, its inputs and its manifest.
# $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"

# verify CODE WORDS [FOLDER]: exit code, and words in what is said (both streams).
verify() {
    "$apsm" verify "${3:-x}" >said 2>&1
    local got=$?
    [ $got -eq "$1" ] || fail "verify ${3:-x}: exit code $got, not $1: $(cat said)"
    grep -qF -- "$2" said || fail "verify ${3:-x} does not say '$2': $(cat said)"
}

# only N: as many lines besides the summary.
only() {
    [ "$(wc -l <said)" -eq $(($1 + 1)) ] || fail "not $1 lines: $(cat said)"
}

fresh() {
    rm -rf x cohort
    cp -r kept x
    cp -r kept_cohort cohort
}

# flip FILE: one bit of the byte in its middle.
flip() {
    local at=$(($(stat -c %s "$1") / 2)) byte
    byte=$(od -An -t u1 -j $at -N 1 "$1")
    printf "\\$(printf %03o $((byte ^ 1)))" | dd of="$1" bs=1 seek=$at conv=notrunc 2>/dev/null
}

mkdir cohort
for i in 0 1 2; do "$synthetic" bump cohort/s$i.ply index $i level 2; done
"$apsm" run cohort -o x -J 32 --faces 400 --stage1-epochs 3 --stage2-epochs 3 --quiet \
    --original-frame --unit mm || fail "run"
cp -r x kept
cp -r cohort kept_cohort
cksum "$(find x -type f | sort)" >before 2>/dev/null
find x -type f -exec cksum {} + | sort >before
verify 0 "files and 3 inputs agree"
only 0
find x -type f -exec cksum {} + | sort | cmp -s - before || fail "verify wrote something"
(cd / && "$apsm" verify "$folder/x" >/dev/null) || fail "verify from another folder"

# Every file that a run writes: a flipped bit is told with its name, and so is its absence.
while read -r file; do
    fresh
    flip "x/$file"
    verify 1 "$file"
    [ "$file" = manifest.json ] || grep -q "^$file: changed since" said ||
        fail "flipped $file: $(cat said)"
    [ "$file" = manifest.json ] && continue
    fresh
    rm "x/$file"
    verify 1 "$file: missing"
    only 1
done < <(cd x && find . -type f | sed 's|^\./||' | sort)
[ "$(cd x && find . -type f | wc -l)" -gt 20 ] || fail "too few files were tried"

fresh
echo "a,b" >x/notes.txt
cp x/meshes/mean.ply x/meshes/other.ply
verify 1 "notes.txt: unexpected, not written by apsm"
grep -q "meshes/other.ply: unexpected, not of this model" said || fail "other.ply: $(cat said)"
only 2

# Inputs.
fresh
touch cohort/s1.ply
verify 0 "agree" # a date is no content
printf ' ' >>cohort/s1.ply
verify 1 "input s1: cohort/s1.ply: changed"
only 1
rm cohort/s2.ply
verify 1 "input s2: cohort/s2.ply: missing"
only 2
find x -type f -exec cksum {} + | sort >before
"$apsm" groom -o x --overwrite >said 2>&1 && fail "groom without an input"
grep -q "s2.ply" said || fail "a vanished input is not told: $(cat said)"
find x -type f -exec cksum {} + | sort | cmp -s - before || fail "a failed groom changed the model"
mv cohort elsewhere
verify 1 "input s0: cohort/s0.ply: missing; removed or moved"
rm -rf elsewhere both
fresh
mkdir both && mv cohort x both # moved together they still find each other
verify 0 "agree" both/x
rm -rf both

# Options, alone and so that the manifest's own sum fits again.
fresh
sed -i 's/"adaptivity": "0.5"/"adaptivity": "0.6"/' x/manifest.json
verify 1 "option adaptivity: 0.6 in manifest.json, 0.5 in project.swproj"
grep -q "manifest.json: changed" said || fail "an edited manifest: $(cat said)"
fresh
sed -i 's/"adaptivity": "0.5"/"adaptivity": "0.6"/' x/project.swproj
verify 1 "project.swproj: changed"
"$apsm" run -o x --resume >said 2>&1 && fail "--resume took an edited project"
grep -q "project.swproj: changed or damaged" said || fail "--resume: $(cat said)"

fresh
seal x/manifest.json
cmp -s x/manifest.json kept/manifest.json || fail "the sum is not what docs/formats.md says"
sed -i 's/"adaptivity": "0.5"/"adaptivity": "0.6"/' x/project.swproj x/manifest.json
sum=$(sha256sum x/project.swproj | cut -d' ' -f1)
sed -i "s/\"project.swproj\": \[\(.*\), \"[0-9a-f]*\"\]/\"project.swproj\": [\1, \"$sum\"]/" \
    x/manifest.json
seal x/manifest.json
verify 1 "initial.ckpt: belongs to other options"

# What --resume builds on is looked at first.
fresh
sed -i '/^        "optimize": {/,/^        },*/d' x/manifest.json # optimize and evaluate to be done
flip x/groomed/s1.ply
"$apsm" run -o x --resume >said 2>&1 && fail "--resume took a changed mesh"
grep -q "groomed/s1.ply: changed or damaged since groom wrote it" said || fail "$(cat said)"

# Unfinished folders agree as far as they go.
fresh
"$apsm" groom cohort -o x --overwrite --quiet || fail "groom"
verify 0 "unfinished: initialize has not ended"
"$apsm" run -o x --resume --quiet || fail "run --resume"
verify 0 "agree"
"$apsm" evaluate x --definition paper --quiet || fail "evaluate"
verify 0 "report.html: may be older than the model"
"$apsm" report x --quiet >/dev/null || fail "report"
verify 0 "agree"

# Voxels in a file of their own belong to the input.
mkdir masks
for i in 0 1 2; do
    awk -v n=14 -v a=$((4 + i)) 'BEGIN { for (k = 0; k < n; k++) for (j = 0; j < n; j++) for (i = 0; i < n; i++)
        printf "%d", ((i - 6.5) / a) ^ 2 + ((j - 6.5) / 5) ^ 2 + ((k - 6.5) / 4) ^ 2 < 1 }' >masks/m$i.raw
    printf 'ObjectType = Image\nNDims = 3\nDimSize = 14 14 14\nElementSpacing = 1 1 1\nElementType = MET_UCHAR\nElementDataFile = m%d.raw\n' \
        $i >masks/m$i.mhd
done
"$apsm" groom masks -o m --label 49 --faces 400 --quiet || fail "groom masks"
verify 0 "agree" m
flip masks/m1.raw
verify 1 "input m1: " m

# Folders that are none, and manifests that are damaged.
verify 1 "no manifest.json in this folder" cohort
verify 1 "no such folder; check the name" nowhere
echo "{" >x/manifest.json
verify 1 "manifest.json:2:0"
"$apsm" verify >said 2>&1
[ $? -eq 2 ] || fail "verify without a folder: $(cat said)"
# Particles that were written by hand are not those of the model: nothing is answered from them.
fresh
sed -i '3{h;d};4{G}' x/particles/s1_world.particles
for call in "report x" "export x -o y.npz --to npz" "fit x cohort/s0.ply -o y"; do
    # shellcheck disable=SC2086
    expect 1 "particles have changed since the model was made of them" $call
done
expect 0 "" evaluate x
cmp x/project.swproj kept/project.swproj || fail "evaluate puts the project's options in another order"
expect 0 "" report x
# Of three shapes no mode holds for others: what cannot be told is not told as 0.
"$apsm" fit x cohort/s1.ply -o y --force >said 2>&1
grep -q "how unusual a new shape is cannot be told" said || fail "fit by three shapes: $(cat said)"
grep -q '"mahalanobis": null' y/fit.json && grep -q '"tail_probability": null' y/fit.json ||
    fail "fit by three shapes: $(grep -e mahalanobis -e tail y/fit.json)"
fresh # exchanged, they have the same mean
mv x/particles/s1_world.particles kept_s1
mv x/particles/s2_world.particles x/particles/s1_world.particles
mv kept_s1 x/particles/s2_world.particles
expect 1 "particles have changed since the model was made of them" report x
expect 1 "particles have changed since the model was made of them" export x -o y.npz --to npz
exit $failed
