#!/bin/bash
# convert and info on particles: around all formats and back, a model to one array and back, and
# nothing written where something is wrong.  $1 is the program.
set -u
apsm=$1
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
failed=0
fail() {
    echo "$*"
    failed=1
}
convert() { "$apsm" convert --quiet "$@" || fail "convert $* fails"; }
refuse() { # WORDS ARGUMENT...
    local words=$1 said
    shift
    said=$("$apsm" convert "$@" 2>&1) && fail "convert $*: is not refused"
    grep -qF -- "$words" <<<"$said" || fail "convert $*: does not say '$words': $said"
    [ "$(wc -l <<<"$said")" -eq 1 ] || fail "convert $*: more than one line: $said"
}

# Around: the last file is the first.
printf '0.1 -2 3e-05\n4.5 123456.789 -6\n7 8 9.25\n' >start.particles
from=start.particles
for extension in csv npy mrk.json vtk vtp lpts wpts particles; do
    convert $from -o around.$extension
    "$apsm" info around.$extension | grep -qx 'particles: 3' || fail "info around.$extension"
    from=around.$extension
done
cmp start.particles around.particles || fail "the way around changes particles"

# A model to one array, in the order of the project, and back.
mkdir model
printf '1 2 3\n4 5 6\n' >model/zoe.particles
printf '7 8 9\n10 11 12.5\n' >model/adam.particles
cat >model/project.swproj <<'END'
{ "data": [ { "name": "zoe", "shape_1": "zoe.ply", "world_particles_1": "zoe.particles" },
            { "name": "adam", "shape_1": "adam.ply", "world_particles_1": "adam.particles" } ],
  "project": { "version": "2" } }
END
convert model -o all.npy
convert model/project.swproj -o same.npy
cmp all.npy same.npy || fail "folder and project differ"
"$apsm" info all.npy | grep -qx 'particles: 2 on each of 2 shapes' || fail "info all.npy"
[ "$(stat -c %s all.npy)" -eq $((128 + 2 * 2 * 3 * 8)) ] || fail "size of all.npy"
convert all.npy -o back --to particles
cmp model/zoe.particles back/all_1.particles || fail "first shape of all.npy"
cmp model/adam.particles back/all_2.particles || fail "second shape of all.npy"
convert back/all_1.particles back/all_2.particles -o again.npy
cmp all.npy again.npy || fail "files to one array"
convert model -o slicer --to .mrk.json
convert slicer/zoe.mrk.json -o zoe.particles
cmp model/zoe.particles zoe.particles || fail "Slicer's markups"

# evaluate reads any of them.
mkdir eval
for i in 0 1 2 3; do printf '0 0 %d\n1 0.5 %d\n0 1 2\n%d 1 3\n' $i $((i * i)) $((i + 1)) >eval/$i.lpts; done
for extension in lpts csv npy mrk.json; do
    [ $extension = lpts ] || convert eval/?.lpts -o eval --to $extension
    "$apsm" evaluate --quiet eval/?.$extension >eval_$extension || fail "evaluate *.$extension"
    cmp eval_lpts eval_$extension || fail "evaluate differs on .$extension"
done

# What is wrong leaves nothing behind.
before=$(find . | sort)
echo '1 2' >bad.particles
before="$before"$'\n'./bad.particles
refuse "bad.particles:1" start.particles bad.particles -o none --to csv
refuse "cannot hold 2 shapes" model -o none.csv
refuse "one array needs the same number" start.particles zoe.particles -o none.npy
refuse "two inputs would be written to none/start.csv" start.particles model/../start.particles \
    -o none --to csv
refuse "is an input" start.particles around.csv -o . --to particles
refuse "is a folder" start.particles -o model
refuse "no project.swproj" back -o none.npy
refuse "not a format of particles" start.particles -o none.json
refuse "none.ply" none.ply -o none.csv
[ "$(find . | sort)" = "$(sort <<<"$before")" ] || fail "something was left behind"
exit $failed
