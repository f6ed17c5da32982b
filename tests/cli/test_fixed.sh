#!/bin/bash
# Fixed shapes of a project: their particles stay, byte for byte, the others are optimised against
# them, and what contradicts that is refused before anything is made.  $1: program, $2: make_synthetic.
. "$(dirname "$0")/head.sh"
quick=(--faces 600 --stage1-epochs 3 --stage2-epochs 3 --fidelity-rounds 2
    --specificity-samples 10 --threads 2)

mkdir old new
for i in 0 1 2 3 4; do
    to=old
    [ $i -gt 2 ] && to=new
    "$synthetic" bump $to/s$i.ply index $i level 3 count 5 || exit 1
done
expect 0 "" run old -o m -J 24 "${quick[@]}" --quiet

# of KEY NAME: the text of a column in the model's project.
of() {
    awk -v key="\"$1\":" -v name="\"name\": \"$2\"" 'index($0, name) { in_row = 1 }
        in_row && index($0, key) { sub(/.*": "/, ""); sub(/".*/, ""); print; exit }' m/project.swproj
}
# row NAME MORE: one of the model's shapes.
row() {
    printf '{"name": "%s", "shape_1": "old/%s.ply", "alignment_1": "%s"' "$1" "$1" "$(of alignment_1 "$1")"
    printf ', "local_particles_1": "m/particles/%s_local.particles"' "$1"
    printf ', "world_particles_1": "m/particles/%s_world.particles"%s}, ' "$1" "$2"
}
# project FILE MORE0 MORE1 MORE2: the three shapes with more columns, and two new ones.
project() {
    printf '{"data": [%s%s%s{"name": "s3", "shape_1": "new/s3.ply"}, {"name": "s4", "shape_1": "new/s4.ply"}]}' \
        "$(row s0 "$2")" "$(row s1 "$3")" "$(row s2 "$4")" >"$1"
}
yes=', "fixed": "yes"'
project f.swproj "$yes" "$yes" "$yes"
same() { # same MODEL NAME...
    local model=$1 name frame
    shift
    for name in "$@"; do
        for frame in local world; do
            cmp m/particles/${name}_$frame.particles $model/particles/${name}_$frame.particles >&2 ||
                fail "$model: the particles of $name are others"
        done
    done
}

# ---- they stay, whatever is done with the folder; the template is one of them ----
expect 0 "24 particles, as the fixed shapes have" run f.swproj -o f "${quick[@]}"
same f s0 s1 s2
grep -q '"template_used": "s[012]"' f/project.swproj || fail "the template is not fixed"
expect 0 "agree" verify f
[ "$(cat f/particles/s3_local.particles | wc -l)" = 24 ] || fail "s3 has no 24 particles"
cp -r f/particles first
expect 0 "" run f.swproj -o t "${quick[@]}" --threads 1
diff -r first t/particles >&2 || fail "the number of threads changes a byte"

# ---- step by step, and by names instead of the column ----
project n.swproj "" "" ""
expect 0 "" groom n.swproj -o n --fixed s0,s1,s2 "${quick[@]}"
for step in initialize optimize evaluate; do expect 0 "" $step -o n; done
diff -r first n/particles >&2 || fail "--fixed differs from the column"
expect 0 "" run n.swproj -o a --fixed all "${quick[@]}" --quiet
diff -r first a/particles >&2 || fail "--fixed all differs from the column"
expect 0 "agree" verify n
# Groomed anew from its own project, it keeps them.
expect 0 "" run -o n --overwrite --quiet
diff -r first n/particles >&2 || fail "made again, the model is another"
# Some only; what is not fixed any more leaves no file.
expect 0 "" run n.swproj -o n --overwrite --fixed s0,s2 "${quick[@]}" --quiet
same n s0 s2
cmp -s m/particles/s1_world.particles n/particles/s1_world.particles && fail "s1 did not move"
[ -e n/fixed/s1_local.particles ] && fail "s1 is still among the fixed"
expect 0 "" run f.swproj -o i --ignore fixed -J 24 "${quick[@]}" --quiet
[ -e i/fixed ] && fail "what is ignored is fixed"

# ---- what contradicts it ----
refuse() { # refuse CODE WORDS ARGUMENT...
    local code=$1 words=$2
    shift 2
    expect $code "$words" run "$@" -o q "${quick[@]}"
    [ -e q ] && fail "$words: a refused run left $(find q)"
    rm -rf q
}
refuse 2 "'s9' is none of the 5 shapes" n.swproj --fixed s0,s9
refuse 1 "gives no particles of it" n.swproj --fixed s3
refuse 2 "only a project gives particles" old --fixed s0
refuse 2 "contradict each other" f.swproj --ignore fixed --fixed s0
refuse 2 "'s3' is not fixed" f.swproj --template s3
refuse 2 "drop -J" f.swproj -J 32
refuse 1 "method psm do not go together" f.swproj --method psm
refuse 1 "cropping do not go together" f.swproj --cuts crop
expect 1 "gives no particles of it" check n.swproj --fixed s3
printf '{"data": [%s%s]}' "$(row s0 "$yes")" "$(row s1 "$yes" | sed 's/, $//')" >all.swproj
refuse 2 "all 2 shapes are fixed" all.swproj
sed "s/\"alignment_1\": \"$(of alignment_1 s1)\", //" f.swproj >pose.swproj
refuse 2 "s1 is fixed and has no alignment" pose.swproj
sed 's#m/particles/s1_world#m/particles/s2_world#' f.swproj >world.swproj
refuse 1 "not the local particles moved" world.swproj
head -n 20 m/particles/s1_local.particles >short.particles
sed 's#m/particles/s1_local#short#' f.swproj >short.swproj
refuse 1 "other fixed shapes have" short.swproj
# Particles of another shape are found once that is groomed.
awk '{ print $1 + 40, $2, $3 }' m/particles/s1_local.particles >moved.particles
sed 's#m/particles/s1_local#moved#; s#, "world_particles_1": "m/particles/s1_world.particles"##' \
    f.swproj >other.swproj
expect 1 "spacings away from its groomed surface" run other.swproj -o q "${quick[@]}"
exit $failed
