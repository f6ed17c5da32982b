#!/bin/bash
# Nothing that a project says is lost: every key and column is used, kept, or refused by name.
# $1 is the program, $2 make_synthetic.
. "$(dirname "$0")/head.sh"
quick=(-J 16 --faces 200 --stage1-epochs 2 --stage2-epochs 2 --fidelity-rounds 2
    --specificity-samples 10 --threads 2)

# has FILE WORDS...: each is in it.
has() {
    local file=$1 words
    shift
    for words in "$@"; do
        grep -qF -- "$words" "$file" || fail "$file has no $words"
    done
}

for i in 0 1 2 3; do
    mkdir -p in/p$i
    "$synthetic" bump in/p$i/bone.ply index $i level 2 || exit 1
done
row() { # row NAME INDEX MORE
    printf '{"name": "%s", "shape_1": "in/p%d/bone.ply"%s}' "$1" "$2" "$3"
}

# ---- equal file names, distinct names; groups, notes and what is nobody's business are kept ----
cat >a.swproj <<END
{"data": [$(row zeta 0 ', "group_sex": "f", "age": 41, "notes": "thin", "image_ct": "ct/z.nrrd"'),
 $(row alpha 1 ', "excluded": "yes", "group_sex": "m"'),
 $(row beta 2 ', "group_sex": "m", "landmarks_file_1": "lm/b.csv", "excluded": "no"'),
 $(row "gamma delta" 3 '')],
 "groom": {"1": {"fill": "true"}}, "optimize": {"number_of_particles": "64", "use_normals": "0"},
 "studio": {"zoom_state": "2"}, "analysis": {"a": "1"}, "deepssm": {"train_epochs": "100"},
 "landmarks": [], "project": {"version": "2"}}
END
expect 0 "1 shape is excluded: alpha" run a.swproj -o sub/m "${quick[@]}"
grep -q "number_of_particles is 64" said || fail "the project's particles are not told: $(cat said)"
ls sub/m/groomed | tr '\n' , | grep -qx "beta.ply,gamma delta.ply,zeta.ply," || fail "$(ls sub/m/groomed)"
has sub/m/project.swproj '"group_sex": "f"' '"age": "41"' '"notes": "thin"' \
    '"image_ct": "../../ct/z.nrrd"' '"landmarks_file_1": "../../lm/b.csv"' '"excluded": "yes"' \
    '"shape_1": "../../in/p1/bone.ply"' '"fill": "true"' '"number_of_particles": "16"' \
    '"zoom_state": "2"' '"train_epochs": "100"' '"analysis"' '"use_normals": "0"'
expect 0 "agree" verify sub/m
cp sub/m/project.swproj first.swproj
expect 0 "" groom -o sub/m --overwrite # again, from the folder's own project
has sub/m/project.swproj '"group_sex": "f"' '"notes": "thin"' '"excluded": "yes"' '"zoom_state": "2"'
expect 0 "" run --resume -o sub/m
cmp first.swproj sub/m/project.swproj >&2 || fail "groomed anew, the project is another"
expect 0 "" run a.swproj --resume -o sub/m
expect 0 "" convert a.swproj -o a.xlsx
expect 0 "" run a.xlsx -o x "${quick[@]}"
has x/project.swproj '"group_sex": "f"' '"notes": "thin"' '"zoom_state": "2"'
has x/project.swproj '"excluded": "yes"'
expect 0 "" groom in -o files --overwrite
grep -q group_sex files/project.swproj && fail "a model of files has another's groups"

# ---- what is asked for and not done ----
refused() { # refused WORD MORE-COLUMNS MORE-GROUPS
    printf '{"data": [%s, %s, %s]%s}' "$(row a 0 "$2")" "$(row b 1 '')" "$(row c 2 '')" "$3" >r.swproj
    rm -rf r
    local verbs=("groom r.swproj -o r" "groom r.swproj -o r --dry-run")
    # run makes a joint model, and check looks at its parts
    [ "$1" = domains ] || verbs+=("check r.swproj" "run r.swproj -o r" "run r.swproj -o r --dry-run")
    for verb in "${verbs[@]}"; do
        expect 1 "--ignore $1" $verb
    done
    [ -e r ] && fail "$1: a refused run left a folder"
    expect 0 "ignored, as asked for" run r.swproj -o r --ignore "$1" "${quick[@]}"
    has r/manifest.json '"ignored": ' "\"ignore\": \"$1\""
    expect 0 "" run --resume -o r
}
refused fixed ', "fixed": "yes"' '' # and no particles; with them: test_fixed.sh
refused domains ', "shape_2": "in/p1/bone.ply"' ''
refused landmarks '' ', "optimize": {"use_landmarks": true}'
refused reflect '' ', "groom": {"1": {"reflect": "true"}}'
refused landmarks,reflect '' ', "optimize": {"use_landmarks": true}, "groom": {"1": {"reflect": "true"}}'
expect 1 "go on without by --ignore reflect,landmarks" groom r.swproj -o q --ignore reflect
expect 2 "'nonsense' is none of" groom r.swproj -o q --ignore nonsense
[ -e q ] && fail "a wrong --ignore left a folder"
# Of several domains, too, a project that is refused leaves nothing.
for name in a b c; do row $name 0 ', "shape_2": "in/p1/bone.ply", "fixed": "yes"'; echo -n ", "; done >rows
printf '{"data": [%s]}' "$(sed 's/, $//' rows)" >j.swproj
expect 1 "--ignore fixed" run j.swproj -o j
[ -e j ] && fail "a refused joint left $(find j)"
printf '{"data": [{"name": "a", "contour_1": "c.vtp"}]}' >c.swproj
expect 1 "is a contour" groom c.swproj -o q
# In the folder of the user's project nothing is replaced (test_harm.sh), and check tells.
mkdir theirs && cp r.swproj theirs/project.swproj
expect 1 "--ignore landmarks,reflect" check theirs

# ---- what is missing, and what does not belong together ----
printf '{"data": [%s, %s, %s]}' "$(row a 0 ', "landmarks_file_1": "no/a.csv", "image_ct": "no/ct.nrrd"')" \
    '{"name": "b", "shape_1": "no/b.ply"}' '{"name": "c", "shape_1": "in/p2/bone.ply", "shape_2": "no/c.ply"}' >m.swproj
expect 1 "" check m.swproj
for file in landmarks_file_1 image_ct shape_1 shape_2; do
    grep -q ": $file: .*no/.* does not exist" said || fail "check does not name the missing $file: $(cat said)"
done
expect 0 "" info sub/m
grep -q "belong together\|absent" said && fail "info of a sound folder: $(cat said)"
awk '{ print $1 + 1, $2, $3 }' sub/m/particles/beta_world.particles >moved
cp moved sub/m/particles/beta_world.particles
expect 0 "have changed since the model was made of them" info sub/m
rm sub/m/particles/beta_world.particles
expect 0 "particle files of 1 shapes are absent" info sub/m
expect 0 "do not belong together" info sub/m

# ---- any project ----
if command -v python3 >/dev/null; then
    python3 "$here/any_project.py" "$apsm" "$PWD" 10 || failed=1
    rm -rf joints && mkdir -p joints/in
    for i in 0 1 2 3 4 5; do
        k=0
        for part in a b c; do
            "$synthetic" ellipsoid joints/in/n${i}_$part.ply level 2 index $(((i + 2 * k) % 6)) wobble 0.03 seed $((3 + k)) shift $((60 * k)) || exit 1
            k=$((k + 1))
        done
    done
    python3 "$here/any_joint.py" "$apsm" "$PWD/joints" 2 7 10 || failed=1
else
    echo "SKIPPED: no python3, so no generated projects were tried"
fi
exit $failed
