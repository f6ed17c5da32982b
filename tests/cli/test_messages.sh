#!/bin/bash
# What people type and what their files hold: answered in one plain line, in time.
# $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"

# expect CODE WORDS ARGUMENT...: exit code, and words in what the program says (both streams).
expect() {
    local code=$1 words=$2
    shift 2
    timeout -s KILL $((20 * slower)) "$apsm" "$@" >said 2>&1 </dev/null
    local got=$?
    if [ $got -ne "$code" ]; then
        fail "apsm $*: exit code $got, not $code: $(tail -n 3 said)"
    elif [ -n "$words" ] && ! grep -qF -- "$words" said; then
        fail "apsm $*: does not say '$words': $(tail -n 3 said)"
    fi
    LC_ALL=C grep -q $'[\001-\010\013-\037\177]' said && fail "apsm $*: control characters: $(cat -v said)"
}

mkdir in
for i in 0 1 2 3; do "$synthetic" bump in/s$i.ply index $i level 2 || exit 1; done

# ---- words ----
expect 2 "a whole number from 7" run in -o m -J abc
expect 2 "at least 7" run in -o m -J 6
expect 2 "evaluate makes model and figures" analyze m
expect 0 "apsm " version
for unit in 2G 2g 2GB 2GiB 2gb 2048M; do expect 0 "" run in -o m --memory $unit --dry-run; done
expect 2 "number with a unit" run in -o m --memory 2GX

# ---- --dry-run fails where the run would, and a wrong name is told before the long part ----
expect 2 "none of the 4 shapes" run in -o m --template NOPE
expect 2 "none of the 4 shapes" run in -o m --template NOPE --dry-run
awk 'BEGIN { for (k = 0; k < 12; k++) for (j = 0; j < 12; j++) for (i = 0; i < 12; i++)
    printf "%d ", (i > 1 && i < 10 && j > 1 && j < 10 && k > 1 && k < 10) * (1 + (i > 5)) }' >two.raw
printf 'NRRD0004\ntype: uchar\ndimension: 3\nsizes: 12 12 12\nspacings: 1 1 1\nencoding: ascii\n\n' >two.nrrd
cat two.raw >>two.nrrd
expect 1 "1, 2" run two.nrrd in/s0.ply -o m
expect 1 "1, 2" run two.nrrd in/s0.ply -o m --dry-run
mkdir bad && cp in/s0.ply in/s1.ply bad && head -c 300 in/s2.ply >bad/s2.ply
expect 1 "s2.ply" run bad -o m --dry-run
[ -e m ] && fail "something was written"
mkdir -p mine && echo x >mine/scores.csv
expect 1 "mine/scores.csv" run in -o mine --dry-run

# ---- names and contents that are commands to a terminal ----
mkdir esc && printf 'x \033]0;pwned\007\033[2J y\n' >"esc/a.ply"
expect 1 "a.ply" check esc
cp in/s0.ply "$(printf 'esc/\033[31mred.ply')"
expect 2 "control character" check esc
expect 1 "" info "$(printf 'no\033[31mthing')"
expect 2 "" run in -o m "$(printf -- '--x\033[31m')"
printf '{"data": [{"name": "\\u001b]0;x\\u0007", "shape_1": "in/s0.ply"}]}' >e.swproj
expect 0 "" run e.swproj -o m --dry-run
printf '{"\\u001b[31mfoo": 3}' >e.json
expect 2 "unknown option" run in -o m --config e.json
printf '1 2 \033[31m3\n' >e.particles
expect 1 "finite" info e.particles

# ---- what never ends ----
for name in f.particles f.csv f.npy f.mrk.json f.swproj f.xlsx f.ply f.vtk f.nrrd f.nii.gz f.mha f.xml; do
    mkfifo $name
    expect 1 "$name" info $name
    expect 1 "$name" check $name
done
mkfifo f.json
expect 1 "pipe or device" run in -o m --config f.json
expect 1 "pipe or device" run in -o m --config /dev/zero
expect 1 "f.swproj" run f.swproj -o m
expect 1 "f.particles" convert f.particles -o p.csv
mkdir fifo && cp in/s0.ply in/s1.ply fifo && mkfifo fifo/p.ply fifo/other
expect 1 "p.ply" run fifo -o m
[ -e m ] && fail "something was written"

# ---- numbers that are none ----
sed 's/^X//' >huge.ply <<'END'
Xply
Xformat ascii 1.0
Xelement vertex 4
Xproperty double x
Xproperty double y
Xproperty double z
Xelement face 4
Xproperty list uchar int vertex_indices
Xend_header
X0 0 0
X1e200 0 0
X0 1e200 0
X0 0 1e200
X3 0 2 1
X3 0 1 3
X3 1 2 3
X3 0 3 2
END
expect 1 "huge.ply" info huge.ply

# ---- what only the cohort shows ----
mkdir units && cp in/s0.ply in/s1.ply in/s2.ply units && cp in/s1.ply units/again.ply
for i in 3; do "$synthetic" bump units/metre.ply index $i level 2 scale 0.001 2>/dev/null; done
expect 1 "the same file as" check units
if [ -e units/metre.ply ]; then
    expect 1 "metre: about 1000 times smaller than the others: another unit?" check units
fi
# one of six images has slices of its own: its header may be wrong
"$synthetic" kidney spaced count 6 x 5 y 5 z 5 >/dev/null || failed=1
expect 0 "no problems found" check spaced/shapes
LC_ALL=C sed -i '1,/^$/s/(0,0,5)/(0,0,7.5)/' spaced/shapes/kidney_02.nrrd
expect 1 "kidney_02: its slices are 1.5 pixels apart, those of the others 1: is the spacing in its header right?" check spaced/shapes
# the same six, one of them stored with its axes in another order: nothing is wrong
LC_ALL=C sed -i '1,/^$/s/(0,0,7.5)/(0,0,5)/' spaced/shapes/kidney_02.nrrd
"$synthetic" kidney thick count 6 x 5 y 5 z 10 >/dev/null && "$synthetic" kidney other count 6 x 10 y 5 z 5 >/dev/null || failed=1
cp other/shapes/kidney_02.nrrd thick/shapes/
expect 0 "no problems found" check thick/shapes
# A program with sanitizers reserves more than any limit of memory.
limited=yes
(ulimit -v 1500000 && "$apsm" version) >/dev/null 2>&1 || limited=
[ -n "$limited" ] || echo "NOT TESTED: what a limit of memory (ulimit -v) does; this program has sanitizers" >&2
# a giant would fill the memory with its distance field
cp -r in giant && "$synthetic" bump giant/mm.ply index 3 level 2 scale 1000 || failed=1
[ -z "$limited" ] || (ulimit -v 1500000 && expect 1 "mm: about 1000 times as large as the template" run giant -o g -J 16; exit $failed) || failed=1

# ---- limits of the shell ----
quick=(-J 16 --faces 200 --stage1-epochs 2 --stage2-epochs 2 --fidelity-rounds 2
    --specificity-samples 10 --threads 2)
[ -z "$limited" ] || (ulimit -v 400000 && expect 1 "ulimit -v" run in -o v "${quick[@]}"; exit $failed) || failed=1
(ulimit -s 64 && expect 0 "" run in -o s "${quick[@]}"; exit $failed) || failed=1
exit $failed
