#!/bin/bash
# Nothing that the program did not write is ever replaced, nothing changed is taken for unchanged,
# and a run that fails leaves nothing.  $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
quick=(-J 16 --faces 300 --stage1-epochs 2 --stage2-epochs 2 --fidelity-rounds 2
    --specificity-samples 10 --threads 2)

snapshot() {
    find "$1" \( -type f -exec cksum {} + \) -o \( -type l -printf '%p -> %l\n' \) | sort
}

# unharmed CODE WORDS FOLDER ARGUMENT...: as expect, and not a byte of the folder is another.
unharmed() {
    local code=$1 words=$2 where=$3
    shift 3
    snapshot "$where" >before
    expect "$code" "$words" "$@"
    snapshot "$where" | diff before - >changes || fail "apsm $*: changed $(head -n 3 changes)"
}

mkdir cohort
for i in 0 1 2; do "$synthetic" bump cohort/s$i.ply index $i level 2; done
expect 0 "" run cohort -o model "${quick[@]}"

# ---- inputs that lie where something would be written ----
mkdir -p m/groomed && cp cohort/*.ply m/groomed
for verb in run groom; do
    unharmed 1 "m/groomed/s0.ply" m $verb m/groomed -o m "${quick[@]}"
    unharmed 1 "m/groomed/s0.ply" m $verb m/groomed -o m "${quick[@]}" --overwrite
done
mkdir n given && cp cohort/*.ply given && ln -s ../given n/groomed
unharmed 1 "given/s0.ply" given run given -o n "${quick[@]}"
mkdir -p h/groomed && ln cohort/s1.ply h/groomed/other.ply
unharmed 1 "h/groomed/other.ply" h run cohort -o h "${quick[@]}"
mkdir -p i/meshes && cp cohort/s0.ply i/meshes/mean.ply
unharmed 1 "i/meshes/mean.ply" i run cohort/s1.ply i/meshes/mean.ply -o i "${quick[@]}"
# A model's own files, which --overwrite may replace, are no inputs of the model that replaces it.
unharmed 1 "would replace" model run model/groomed -o model "${quick[@]}" --overwrite
unharmed 1 "would replace" model run model/groomed/s0.ply model/meshes/mean.ply -o model \
    "${quick[@]}" --overwrite
expect 0 "" run model/groomed -o elsewhere "${quick[@]}"
# Beside the folders of a run they may lie in the model folder.
mkdir beside && cp cohort/*.ply beside
expect 0 "" run beside -o beside "${quick[@]}"
cmp -s cohort/s0.ply beside/s0.ply || fail "an input beside the model was changed"
expect 0 "" run beside -o beside "${quick[@]}" --overwrite

# ---- two at once in a new folder: one of them makes the model, whoever comes first ----
for k in 1 2 3 4 5 6 7 8; do
    rm -rf race
    "$apsm" groom cohort -o race --faces 300 --threads 1 -q 2>one &
    "$apsm" groom cohort -o race --faces 300 --threads 1 -q 2>two
    here=$?
    wait $!
    there=$?
    [ $((here + there)) -eq 1 ] && [ -s race/manifest.json ] || fail "two at once: $here, $there: $(cat one two)"
done

# ---- a folder that this run made goes again where it cannot be locked: no file more may be open ----
mkdir pairs
for k in 1 2 3; do
    for part in a b; do "$synthetic" ellipsoid pairs/s${k}_$part.ply index $k count 4 || exit 1; done
done
# unlocked WHAT VERB ARGUMENT...
unlocked() {
    bash -c 'exec 3>&- 4>&- 5>&- 6>&- 7>&- 8>&- 9>&-; ulimit -n 4; exec "$@"' - "$apsm" "${@:2}" -o unlocked/model -q 2>said &&
        fail "$1 without a lock"
    if grep -q "cannot be locked" said; then
        [ -e unlocked ] && fail "$1 that could not lock its folder left it"
    else
        echo "SKIPPED: $(tail -n 1 said)"
    fi
}
unlocked "a run" groom cohort --faces 300
unlocked "a run of a joint" run pairs --parts 'a=_a,b=_b' --faces 300

# ---- whatever is asked of a folder that is no model, or is not there: no file is made in it ----
mkdir stranger && echo mine >stranger/notes.txt && echo '{"measurements": []}' >measures.json && echo 'name,x,y,z' >points.csv
for verb in report initialize optimize evaluate; do
    unharmed 1 "stranger: no project here" stranger $verb stranger
    expect 1 "missing/deep/er: no project here" $verb missing/deep/er
done
unharmed 1 "stranger: no manifest.json in this folder" stranger verify stranger
expect 1 "missing: no such folder" verify missing
expect 1 "points.csv: is a file" verify points.csv
for call in "add @ cohort/s0.ply" "exclude @ s0" "test @ --formula size" "asymmetry @ --of a --within b" "measure @ measures.json" \
    "landmarks @ points.csv -o out" "norm @ model" "predict @ --of age" "compare @ @" "export @ --to vtp -o out" "render @" \
    "render @ -o out" "fit @ cohort/s0.ply -o out"; do
    # shellcheck disable=SC2086 # words of a call
    unharmed 1 "stranger: " stranger ${call//@/stranger}
    # shellcheck disable=SC2086
    expect 1 "missing/deep: " ${call//@/missing\/deep}
    [ -e out ] && fail "apsm $call: leaves a folder" && rm -rf out
done
expect 1 "" render stranger -o missing/pictures
expect 1 "" run nothing.ply -o missing/model
[ -e missing ] && fail "a folder that is not there was made"
expect 2 "is the folder of the whole system" report /

# ---- a folder whose name no project can hold ----
bad=$(printf 'bad\377')
mkdir "$bad" && cp cohort/*.ply "$bad"
expect 2 "its path is not UTF-8" run "$bad" -o out "${quick[@]}"
expect 2 "its path is not UTF-8" check "$bad"
[ -e out ] && fail "a folder is left where a path is not UTF-8"
model=$PWD/out
cd "$bad" || exit 1
expect 2 "not UTF-8" run s0.ply s1.ply s2.ply -o "$model" "${quick[@]}"
expect 0 "" groom s0.ply s1.ply -o model --faces 300
cd ..
[ -e out ] && fail "a folder is left where a folder above is not UTF-8"

# ---- a folder that is no model, with files of the user ----
for file in scores.csv model.json report.html history.csv evaluation.json evaluation.csv \
    certificate.json project.swproj manifest.json groomed/mine.ply particles/mine.particles \
    meshes/mine.ply state/initial.ckpt state/optimize.ckpt state/work.journal; do
    rm -rf d && mkdir -p "$(dirname "d/$file")"
    echo "my own $file" >"d/$file"
    for more in "" --overwrite --resume; do
        unharmed 1 "d/$file" d run cohort -o d "${quick[@]}" $more
    done
done
rm -rf d && mkdir d && printf '{"data": [{"name": "a", "shape_1": "../cohort/s0.ply"}]}' >d/project.swproj
unharmed 1 "another folder" d groom -o d
unharmed 1 "another folder" d run d/project.swproj -o d "${quick[@]}"
expect 0 "" groom d/project.swproj -o of_d "${quick[@]}"
echo "notes" >d/notes.txt && rm d/project.swproj
expect 0 "" run cohort -o d "${quick[@]}"
[ "$(cat d/notes.txt)" = notes ] || fail "notes.txt was changed"
# In a model, too, what a later step would replace.
expect 0 "" groom cohort -o later "${quick[@]}"
echo "mine" >later/scores.csv
for step in initialize optimize; do expect 0 "" $step later; done
unharmed 1 "later/scores.csv" later evaluate later
unharmed 1 "later/scores.csv" later run --resume -o later
rm later/scores.csv
expect 0 "" run --resume -o later
echo "mine" >of_d/report.html
unharmed 1 "of_d/report.html" of_d run --resume -o of_d
mkdir foreign && cp cohort/s0.ply foreign
printf '{"data": [{"name": "a", "shape_1": "s0.ply"}]}' >foreign/project.swproj
echo mine >foreign/report.html
unharmed 1 "" foreign report foreign
# What a killed run had begun is its own: the manifest says which steps have begun.
cp -r later killed
expect 0 "" run cohort -o killed "${quick[@]}" --overwrite
expect 0 "" groom cohort -o killed "${quick[@]}" --overwrite
grep -q '"begun"' killed/manifest.json || fail "begun steps are not told"
expect 0 "" run --resume -o killed
grep -q '"begun"' killed/manifest.json && fail "finished steps are told as begun"
expect 0 "agree" verify killed

# ---- the lock ----
rm -rf x && cp -r model x && echo precious >precious.txt && ln -s "$PWD/precious.txt" x/.apsm.lock
unharmed 1 ".apsm.lock: is a link" x evaluate x -q
[ "$(cat precious.txt)" = precious ] || fail "the target of a lock that is a link was changed"
rm x/.apsm.lock && ln -s nowhere x/.apsm.lock
unharmed 1 ".apsm.lock" x evaluate x
[ -e x/nowhere ] && fail "a dangling lock was followed"
rm x/.apsm.lock && ln precious.txt x/.apsm.lock
unharmed 1 ".apsm.lock" x evaluate x
rm x/.apsm.lock && echo precious >x/.apsm.lock
unharmed 1 ".apsm.lock" x evaluate x
rm x/.apsm.lock && mkfifo x/.apsm.lock
expect 1 ".apsm.lock" evaluate x
rm x/.apsm.lock && mkdir x/.apsm.lock
expect 1 ".apsm.lock" evaluate x
rmdir x/.apsm.lock && echo 999999 >x/.apsm.lock # of a process that is gone
expect 0 "" evaluate x
[ -e x/.apsm.lock ] && fail "the lock is left behind"

# ---- an input that changes between groom and --resume ----
cp -r cohort changing
expect 0 "" groom changing -o k "${quick[@]}"
cp k/manifest.json kept.json
cp changing/s1.ply changing/s0.ply
unharmed 1 "input s0: " k run --resume -o k
unharmed 1 "input s0: " k run changing --resume -o k
cp -r cohort moved && mv changing/s2.ply away.ply
unharmed 1 "s0" k run --resume -o k
cp cohort/s0.ply changing/s0.ply
expect 0 "1 of 3 inputs" run --resume -o k
cp away.ply changing/s2.ply
expect 0 "" run changing --resume -o k

# ---- a verdict is not that of other particles ----
rm -rf y && cp -r model y
expect 0 "" initialize y --seed 3
expect 0 "" optimize y
expect 0 "do not belong together" info y
grep -q "^verdict: not evaluated yet" said || fail "the verdict of former particles: $(cat said)"
expect 0 "" evaluate y
expect 0 "verdict: not judged" info y

# ---- a manifest that was changed is not sealed anew ----
rm -rf y && cp -r model y && sed -i 's/"bytes": [0-9]*/"bytes": 7/' y/manifest.json
for verb in initialize optimize evaluate; do
    unharmed 1 "manifest.json: changed since" y $verb y
done
unharmed 1 "manifest.json: changed since" y run --resume -o y
unharmed 1 "manifest.json: changed since" y run cohort -o y --overwrite "${quick[@]}"
expect 1 "manifest.json: changed" verify y
expect 0 "" report y # makes no model, and does not vouch for the manifest
expect 1 "manifest.json: changed" verify y
rm -rf y && cp -r model y && sed -i 's/"name": "s1"/"nome": "s1"/; s/"path"/"poth"/' y/manifest.json
expect 1 "" verify y
grep -q "(null)" said && fail "verify says (null): $(cat said)"

# ---- a first run that fails leaves nothing ----
echo "no mesh" >broken.ply
for inputs in broken.ply "cohort broken.ply" missing.ply "cohort --exclude ."; do
    "$apsm" run $inputs -o none "${quick[@]}" >said 2>&1 && fail "run $inputs"
    [ -e none ] && fail "run $inputs left $(find none)"
    rm -rf none
done
expect 1 "" evaluate none
[ -e none ] && fail "evaluate made a folder"
mkdir none && expect 1 "" run cohort broken.ply -o none "${quick[@]}"
[ -d none ] || fail "a folder that was there is gone"
exit $failed
