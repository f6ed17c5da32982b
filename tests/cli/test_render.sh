#!/bin/bash
# Pictures of a model: all four, the same bytes for any number of threads, and nothing written where
# something is wrong.  $1 is the program, $2 make_synthetic.
set -u
apsm=$1
synthetic=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
unset DISPLAY WAYLAND_DISPLAY
failed=0
fail() {
    echo "FAILED: $*"
    failed=1
}
render() { "$apsm" render --quiet "$@" >said 2>&1 || fail "render $*: $(tail -n 1 said)"; }
refuse() { # CODE WORDS ARGUMENT...
    local code=$1 words=$2 said
    shift 2
    said=$("$apsm" render "$@" 2>&1)
    local got=$?
    [ $got -eq "$code" ] || fail "render $*: exit code $got, not $code: $said"
    grep -qF -- "$words" <<<"$said" || fail "render $*: does not say '$words': $said"
}
# WIDTH of a PNG, from its header.
width_of() { od -An -tu1 -j16 -N4 "$1" | awk '{ print (($1 * 256 + $2) * 256 + $3) * 256 + $4 }'; }

mkdir shapes
for i in 0 1 2 3; do
    "$synthetic" ellipsoid shapes/s$i.ply level 3 index $i count 4 || exit 1
done
"$apsm" run shapes -o model -J 32 --faces 800 --stage1-epochs 4 --stage2-epochs 2 --quiet \
    >said 2>&1 || fail "no model: $(tail -n 3 said)"

render model
for name in mean modes shape cohort; do
    [ "$(head -c 8 model/pictures/$name.png | od -An -tx1 | tr -d ' \n')" = 89504e470d0a1a0a ] ||
        fail "$name.png is no PNG"
done
[ "$(width_of model/pictures/mean.png)" -eq 800 ] || fail "width of mean.png"
render model -o one --threads 1
render model -o two --threads 2
for name in mean modes shape cohort; do
    cmp one/$name.png two/$name.png || fail "$name.png depends on the threads"
done

# One picture; options change it.
render model --what shape --shape s1 --width 200 -o s1.png
render model --what shape --shape s2 --width 200 -o s2.png
[ "$(width_of s1.png)" -eq 200 ] || fail "width of s1.png"
cmp -s s1.png s2.png && fail "two shapes look the same"
render model --what mean --view +z --width 200 -o top.png
render model --what mean --view 0,0,2.5 --width 200 -o above.png
render model --what mean --view -x --width 200 -o side.png
cmp top.png above.png || fail "+z and 0,0,2.5 differ"
cmp -s top.png side.png && fail "two views look the same"
render model --what cohort -o sheets
[ -e sheets/cohort.png ] && [ ! -e sheets/mean.png ] || fail "--what cohort into a folder"

before=$(find . -not -name said | sort)
refuse 2 "needs one model folder" model model
refuse 2 "needs one model folder"
refuse 2 "give mean, modes, shape or cohort" model --what average -o x.png
refuse 2 "from 64 to 8000" model --width 12
refuse 2 "from 64 to 8000" model --width 200px
refuse 2 "--view 0,0,0" model --view 0,0,0
refuse 2 "--view up" model --view up
refuse 2 "--view 1,2" model --view 1,2
refuse 2 "--view 1,2,3,4" model --view 1,2,3,4
refuse 2 "no shape 's9'" model --what shape --shape s9 -o x.png
refuse 2 "--shape is for" model --what mean --shape s1 -o x.png
refuse 2 "four pictures need a folder" model -o x.png
refuse 1 "nowhere: no such file or folder" nowhere -o x
refuse 2 "is no model folder" shapes/s0.ply --what mean -o x.png
refuse 1 "no project.swproj" shapes --what mean -o x.png
mkdir groomed_only
cp -r model/project.swproj groomed_only
refuse 1 "there is no model yet" groomed_only --what mean -o x.png
[ "$(find . -not -name said -not -path './groomed_only*' | sort)" = "$before" ] ||
    fail "something was left behind"

echo mine >mine.png && mkdir mine && echo mine >mine/shape.png
refuse 1 "mine.png: is there already" model --what mean -o mine.png
refuse 1 "shape.png: is there already" model -o mine
[ "$(ls mine)" = shape.png ] && [ "$(cat mine.png mine/shape.png | tr -d '\n')" = minemine ] || fail "a picture was replaced"
exit $failed
