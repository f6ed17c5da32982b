#!/bin/bash
# Fixed subjects of several parts: all parts keep the particles that the project gives, byte for byte,
# and new subjects are optimised against them.  $1: program, $2: make_synthetic.
. "$(dirname "$0")/head.sh"
quick=(--faces 600 --stage1-epochs 2 --stage2-epochs 2 --fidelity-rounds 2
    --specificity-samples 10 --threads 2 --quiet)

mkdir shapes
for i in 0 1 2 3 4; do
    "$synthetic" bump shapes/s${i}_a.ply index $i level 3 count 5 || exit 1
    "$synthetic" ellipsoid shapes/s${i}_b.ply index $i level 3 count 5 shift 80 || exit 1
done
# rows FILE NAME...: a project of these subjects.
rows() {
    local file=$1 name list=
    shift
    for name in "$@"; do
        list+="{\"name\": \"$name\", \"shape_a\": \"shapes/${name}_a.ply\", \"shape_b\": \"shapes/${name}_b.ply\"}, "
    done
    printf '{"data": [%s]}' "${list%, }" >"$file"
}
rows old.swproj s0 s1 s2
expect 0 "" run old.swproj -o m -J 24 "${quick[@]}"

# The joint's own project, whose rows say where all parts lie, with two subjects more.
sed 's#"name": "s[0-9]"#&, "fixed": "yes"#; s#\(: "\)\(particles\|parts\)/#\1m/\2/#; s#"\.\./shapes#"shapes#' \
    m/project.swproj >f.swproj
awk -v more='{"name": "s3", "shape_a": "shapes/s3_a.ply", "shape_b": "shapes/s3_b.ply"},
    {"name": "s4", "shape_a": "shapes/s4_a.ply", "shape_b": "shapes/s4_b.ply"}' \
    '/^ *\],?$/ && !done { sub(/^ */, "&," more); done = 1 } { print }' f.swproj >g.swproj
expect 0 "" run g.swproj -o f "${quick[@]}"
for name in s0 s1 s2; do
    for part in a b; do
        given=m/particles/${name}_${part}_local.particles
        for file in f/parts/$part/particles/${name}_local.particles f/particles/${name}_${part}_local.particles; do
            cmp $given $file >&2 || fail "$file is not what was given"
        done
    done
done
for part in a b; do
    [ "$(wc -l <f/particles/s3_${part}_world.particles)" = 24 ] || fail "part $part of s3 has no 24 particles"
done
expect 0 "agree" verify f
cmp -s m/particles/s1_a_world.particles f/particles/s1_a_world.particles && fail "new subjects have no say in the frame"

# A part that a fixed subject has no particles of is named.
sed '0,/"local_particles_b"/s//"was_particles_b"/' g.swproj >lacks.swproj
expect 1 "local_particles_b" run lacks.swproj -o q "${quick[@]}"
exit $failed
