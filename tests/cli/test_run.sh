#!/bin/bash
# The program from shapes to a model: what is written, that it depends on nothing but shapes and
# options, that an interrupted run goes on, and what happens with shapes that are hard or broken.
# $1 is the program, $2 make_synthetic.
set -m # background jobs must not ignore SIGINT
. "$(dirname "$0")/head.sh"
trap 'chmod -R u+w "$folder"; rm -rf "$folder"' EXIT
limit=300
quick=(-J 64 --faces 1500 --stage1-epochs 12 --stage2-epochs 8)

# silent about errors of the program's own making
sound() {
    grep -qiE "segmentation|sanitizer|assert|core dumped" said && fail "$1: $(cat said)"
}

same_particles() {
    diff -rq "$1/particles" "$2/particles" >/dev/null || fail "$1 and $2 differ: $3"
}

# same_folder A B WHAT: every byte, but for times in the manifest and for what the report tells of
# them: both are levelled in copies first.
same_folder() {
    local side
    rm -rf level
    for side in "$1" "$2"; do
        mkdir -p "level/$side"
        cp -r "$side" "level/$side/m"
        sed -i 's/"\(wall_seconds\|cpu_seconds\|peak_memory_mb\|threads\)": [0-9.]*/"\1": 0/' \
            "level/$side/m/manifest.json"
        "$apsm" report "level/$side/m" >/dev/null 2>&1 || fail "report of $side"
    done
    diff -r "level/$1/m" "level/$2/m" >said || fail "$1 and $2 differ: $3: $(head -n 4 said)"
}

# particles FOLDER J SHAPES: so many files, of so many lines of three numbers.
particles() {
    local number='-?[0-9.]+(e[-+][0-9]+)?' n=0
    for file in "$1"/particles/*_world.particles "$1"/particles/*_local.particles; do
        n=$((n + 1))
        [ "$(grep -cE "^$number $number $number\$" "$file")" -eq "$2" ] &&
            [ "$(wc -l <"$file")" -eq "$2" ] || fail "$file: not $2 lines of three numbers"
    done
    [ $n -eq $((2 * $3)) ] || fail "$1: $n files of particles, not $((2 * $3))"
}

# snapshot FOLDER: names and contents of all its files
snapshot() {
    find "$1" -type f -exec cksum {} + | sort
}

mkdir cohort
for i in 0 1 2 3 4; do
    "$synthetic" bump cohort/s$i.ply index $i turn $((50 * i)) shift $((4 * i)) || exit 1
done

# ---- a run and what it leaves ----
expect 0 "about" run cohort -o model "${quick[@]}" --dry-run
expect 0 "12 fidelity rounds" run cohort -o model "${quick[@]}" --dry-run
expect 0 "MB of disk in model/state" run cohort -o model "${quick[@]}" --memory 64M --dry-run
expect 0 "1000 iterations a split" run cohort -o model --method psm --dry-run
# seconds OPTION...: the forecast
seconds() { "$apsm" run cohort -o model "$@" --dry-run | sed -n 's/^about \([0-9]*\) s on.*/\1/p'; }
plain=$(seconds --threads 1 --fidelity 0 -J 1024 --fidelity-rounds 400 --stage1-epochs 1)
[ "$(seconds --threads 1 -J 1024 --fidelity-rounds 400 --stage1-epochs 1)" -gt $((plain + 20)) ] ||
    fail "--dry-run: the fidelity stage costs nothing"
megabytes() { "$apsm" run cohort -o model "$@" --dry-run | sed -n 's/.*, \([0-9]*\) MB of memory.*/\1/p'; }
[ "$(megabytes -J 512 --stage2-epochs 1)" -gt "$(megabytes -J 512 --stage2-epochs 1 --adaptivity 0)" ] ||
    fail "--dry-run: the factors that stage 2 keeps take no memory"
[ "$(megabytes -J 512 --stage1-epochs 1)" -gt "$(megabytes -J 512)" ] ||
    fail "--dry-run: the distance fields of stage 1 take no memory"
[ "$(megabytes -J 512 --set initialize=fps)" -gt "$(megabytes -J 512 --set initialize=fps --settle-epochs 0)" ] ||
    fail "--dry-run: the distance fields of epochs to settle take no memory"
expect 0 "0 + 0 epochs, 12 fidelity rounds" run cohort -o model --stage1-epochs 0 --stage2-epochs 0 --dry-run
expect 2 "there is no fidelity stage" run cohort -o model --stage1-epochs 0 --stage2-epochs 0 --fidelity 0 --dry-run
[ -e model ] && fail "--dry-run wrote something"
expect 0 "verdict:" run cohort -o model "${quick[@]}" --threads 1
for file in project.swproj manifest.json history.csv model.json scores.csv evaluation.json \
    evaluation.csv certificate.json report.html state/initial.ckpt state/optimize.ckpt \
    meshes/mean.ply groomed/s0.ply meshes/s4_reconstructed.ply; do
    [ -s "model/$file" ] || fail "no model/$file"
done
find model -name '*.tmp' -o -name .apsm.lock | grep -q . && fail "left-overs in model"
particles model 64 5
[ "$(wc -l <model/scores.csv)" -eq 6 ] || fail "scores.csv has not one line a shape"
[ "$(wc -l <model/evaluation.csv)" -eq 6 ] || fail "evaluation.csv has not one line a shape"
grep -q '"format": "apsm-model"' model/model.json || fail "model.json without format"
grep -q '"definition": "standard"' model/evaluation.json || fail "evaluation.json: definition"
grep -q '"verdict"' model/certificate.json || fail "certificate.json without verdict"
[ "$(grep -c '^ \{12\}"sha256": "[0-9a-f]\{64\}"' model/manifest.json)" -eq 5 ] || fail "inputs' SHA-256"
expect 0 "particles a shape: 64" info model
expect 0 "no problems" check model/project.swproj

# ---- the same again, on other ways ----
expect 0 "" run cohort -o two "${quick[@]}" --threads 2
same_folder model two "1 and 2 threads"
expect 0 "" run cohort -o four "${quick[@]}" --threads 4
same_folder model four "1 and 4 threads"
# Memory that is not zero when it is new, no random addresses, another language and time zone, and
# settings that OpenMP and BLAS take from the environment.
environment=(MALLOC_PERTURB_=165 LC_ALL=de_DE.UTF-8 LANG=de_DE.UTF-8 TZ=Asia/Kathmandu
    OMP_NUM_THREADS=3 OMP_DYNAMIC=true OMP_SCHEDULE=static OPENBLAS_NUM_THREADS=2)
# On x86-64 with AVX2 the program takes OpenBLAS's kernels of Haswell whatever the processor: to ask for them changes nothing.
grep -qw avx2 /proc/cpuinfo && environment+=(OPENBLAS_CORETYPE=Haswell)
steady=(env)
setarch -R true 2>/dev/null && steady=(setarch -R env)
"${steady[@]}" "${environment[@]}" "$apsm" run cohort -o strange "${quick[@]}" --threads 2 \
    >said 2>&1 || fail "in a strange environment: $(cat said)"
same_folder model strange "the environment"
expect 0 "" run cohort/s3.ply cohort/s0.ply cohort/s4.ply cohort/s2.ply cohort/s1.ply \
    -o order "${quick[@]}"
same_folder model order "order on the command line"
expect 0 "" groom cohort -o steps "${quick[@]}"
for step in initialize optimize evaluate; do expect 0 "" $step -o steps; done
expect 0 "" report steps
same_folder model steps "run, and step by step"
# Without epochs: where particles are kept on the surfaces by fields, the first pass needs one; a
# bad start settles before it goes on to the fidelity rounds, without an epoch of stage 1.
for set in snap=field initialize=fps; do
    plain=(-J 32 --faces 1200 --set $set)
    rm -rf at_once by_steps
    expect 0 "" run cohort -o at_once "${plain[@]}"
    expect 0 "" groom cohort -o by_steps "${plain[@]}"
    expect 0 "" initialize -o by_steps "${plain[@]}"
    expect 0 "" optimize -o by_steps
    said=$(grep -c "first particles are mismatched" said)
    same_particles at_once by_steps "$set, run, and step by step"
    grep -q "^1,[0-9]" at_once/history.csv && fail "$set: an epoch of stage 1"
done
[ "$said" -eq 1 ] && grep -q "^1,-50," at_once/history.csv || fail "initialize=fps: does not settle once"
# One model has one surface distance, whoever reads it; another template gives another.
expect 0 "" evaluate -o steps
figures=$(sed -n 's/.*surface distance: mean \([0-9.]*\), .*template \(.*\))$/\1 \2/p' said)
expect 0 "" evaluate steps/project.swproj
again=$(sed -n 's/.*surface distance, two-way: mean \([0-9.]*\),.*/\1/p' said)
awk -v a="$again" -v b="${figures% *}" 'BEGIN { d = a - b; exit !(a > 0 && d * d < 1e-6 * a * a) }' ||
    fail "surface distance of the folder is ${figures% *}, of its project $again"
grep -q "(template ${figures#* })" said || fail "another template: $figures; $(cat said)"
grep -q "with 3 other shapes as template" said || fail "no other templates: $(cat said)"
other=s0 && [ "${figures#* }" = s0 ] && other=s1
expect 0 "(template $other)" evaluate steps/project.swproj --template $other --other-templates 0
grep -q "other shapes as template" said && fail "--other-templates 0: $(cat said)"
expect 2 "no such shape" evaluate steps/project.swproj --template nobody
expect 2 "its own template" evaluate -o steps --template $other
expect 0 "" run cohort -o again --config model/manifest.json
same_folder model again "options from the manifest"

# ---- a limit of memory changes no byte, and leaves nothing behind ----
mkdir handed
for i in 0 1 2 3; do
    "$synthetic" bump handed/m$i.ply index $i wobble 0.04 seed 1 mirror $((i == 3)) || exit 1
done
for memory in "" "--memory 64M"; do
    expect 0 "" run handed -o "free${memory:+_limit}" "${quick[@]}" --mirror-check fix $memory
    grep -q "m3: looks mirrored" said || fail "m3 is not found to be mirrored"
done
for part in particles meshes groomed model.json evaluation.json certificate.json history.csv; do
    diff -rq free_limit/$part free/$part >/dev/null || fail "--memory changed $part"
done
[ "$(ls free_limit/state)" = "$(ls model/state)" ] || fail "left-overs of --memory in state/"
expect 0 "" run -o free_limit --resume --memory 64M --definition paper
for step in initialize optimize evaluate; do expect 0 "" $step -o steps --memory 64M; done
same_particles model steps "step by step with --memory"
expect 2 "give a number with a unit" run cohort -o never --memory lots
[ -e never ] && fail "a wrong --memory made a folder"
for labels in 1,2 talus '>0.5'; do expect 2 "are meshes, which have no labels" run cohort -o labelled --label "$labels"; done
for option in align-parts shared-boundary; do expect 2 "--$option: is for subjects of several parts" run cohort -o labelled --$option a; done

# ---- bones cut off at different heights are cropped alike ----
"$synthetic" femur bones count 5 cut 1 coarse 2 fine 2 || exit 1
expect 0 "all are cropped there to what" run bones/shapes -o bones/a "${quick[@]}" --threads 1
grep -q '"cropped":' bones/a/manifest.json || fail "the manifest does not tell what was cropped"
expect 0 "" run bones/shapes -o bones/b "${quick[@]}" --threads 4 --memory 64M
same_particles bones/a bones/b "cropped, threads and --memory"
diff -rq bones/a/groomed bones/b/groomed || fail "cropped meshes depend on threads or --memory"
# New bones are cropped as those of the model were, and not refused for their length.
expect 0 "refused: 0; failed: 0" fit bones/a bones/shapes -o bones/fits
[ "$(grep -c '"cropped_share": 0\.[0-9]' bones/fits/fit.json)" -ge 2 ] || fail "new bones are not cropped"
rm -r bones/fits
expect 0 "" groom bones/shapes -o bones/b "${quick[@]}" --cuts keep --overwrite
grep -q "cropped" said && fail "--cuts keep says that it crops"
grep -qE '"cropped": 0*\.0*[1-9]' bones/b/manifest.json && fail "--cuts keep crops"
diff -rq bones/a/groomed bones/b/groomed >/dev/null && fail "cropping changes no mesh"
expect 2 "auto|crop|keep" groom bones/shapes -o never --cuts short

snapshot model >before
expect 1 "--resume" run cohort -o model "${quick[@]}"
snapshot model | cmp -s - before || fail "a refused run changed the model"
expect 0 "128 particles each" run cohort -o model --overwrite --dry-run
expect 0 "" run cohort -o model "${quick[@]}" --overwrite
same_folder model two "--overwrite"
expect 0 "" run -o model --resume
same_folder model two "--resume of a finished run"
expect 1 "drop the option" run -o model --resume -J 65
expect 1 "other shapes" run cohort/s0.ply -o model --resume
expect 0 "(paper)" run cohort -o model --resume --definition paper --original-frame
grep -q '"definition": "paper"' model/evaluation.json || fail "--resume --definition: not used"
grep -q '"definition": "paper"' model/project.swproj || fail "--resume --definition: not told"
[ -e model/particles/s4_original.particles ] || fail "--resume --original-frame: not used"
cmp -s model/particles/s4_world.particles two/particles/s4_world.particles ||
    fail "--resume --original-frame changed the particles"
expect 0 "" run cohort/s0.ply cohort/s1.ply -o model "${quick[@]}" --overwrite
find model -name '*s4*' -o -name '*mode_03*' | grep -q . && fail "left-overs of another model"
rm model/manifest.json # as if the project were another program's
expect 1 "holds a model" groom cohort -o model "${quick[@]}"

# ---- interrupted runs ----
slow=(-J 128 --faces 1500 --stage1-epochs 30 --stage2-epochs 60 --threads 2)
expect 0 "" run cohort -o whole "${slow[@]}"

# stop SIGNAL FOLDER OPTION...: sends the signal as soon as stage 2 has begun; code in $stopped.
stop() {
    local signal=$1 model=$2 tries=0
    shift 2
    : >progress # the last one's words are not this one's
    "$apsm" run cohort -o "$model" "${slow[@]}" --progress json "$@" >progress 2>said &
    local process=$!
    until grep -qs 'stage 2' progress || [ $((tries += 1)) -gt 3000 ]; do sleep 0.01; done
    kill -"$signal" $process
    wait $process 2>/dev/null
    stopped=$?
    [ -e "$model/model.json" ] && fail "$signal came too late to interrupt"
}

stop INT interrupted
[ $stopped -eq 130 ] || fail "SIGINT: exit code $stopped"
grep -qF "apsm run --resume -o interrupted" said || fail "SIGINT: no word on how to go on"
[ -s interrupted/state/optimize.ckpt ] || fail "SIGINT: no checkpoint"
cp -r interrupted damaged
expect 0 "resuming stage 2" run --resume -o interrupted
same_folder whole interrupted "SIGINT and --resume"

stop KILL killed --checkpoint-seconds 0
[ $stopped -eq 137 ] || fail "kill -9: exit code $stopped"
mv cohort away # groomed shapes are all that is needed now
expect 0 "resuming stage" run --resume -o killed --threads 1
mv away cohort
same_particles whole killed "kill -9 and --resume"
cmp -s whole/history.csv killed/history.csv || fail "kill -9 and --resume: history"

# While grooming: what is finished of single shapes is not made again, unless its input has changed.
# begin SIGNAL OPTION...: sends the signal as soon as the first shapes are groomed.
begin() {
    local signal=$1 tries=0
    shift
    rm -rf begun
    : >progress
    "$apsm" run many -o begun --threads 1 --progress json "$@" >progress 2>said &
    local process=$!
    until grep -qs '"groom","done":3' progress || [ $((tries += 1)) -gt 3000 ]; do sleep 0.01; done
    kill -"$signal" $process
    wait $process 2>/dev/null
    stopped=$?
}
mkdir many
for i in 0 1 2 3 4 5 6 7 8 9; do "$synthetic" bump many/s$i.ply index $i; done
begin INT --faces 3000 -J 64
[ $stopped -eq 130 ] || fail "SIGINT while grooming: $(cat said)"
grep -qF "go on with: apsm run --resume -o begun" said || fail "SIGINT while grooming: $(cat said)"
expect 1 "particles = 64" run -o begun --resume -J 65
mv many/s1.ply away.ply
expect 1 "has a shape s1" run -o begun --resume
cp away.ply many/s9b.ply
expect 1 "has a shape s1" run -o begun --resume
mv away.ply many/s1.ply
expect 1 "has 10 shapes, these inputs are 11" run -o begun --resume
rm many/s9b.ply
expect 1 "grooming has not ended" verify begun
expect 1 "grooming has not ended" initialize begun
"$synthetic" bump many/s1.ply index 11
expect 0 "of 10 shapes were groomed before" groom --resume -o begun
[ -e begun/state/work.journal ] && fail "the journal is left behind"
expect 0 "" groom many -o anew --faces 3000 -J 64
diff -r begun/groomed anew/groomed >said || fail "groom --resume: $(cat said)"
cmp -s begun/project.swproj anew/project.swproj || fail "groom --resume: another project"
begin KILL --faces 3000
expect 0 "of 10 shapes were groomed before" groom many -o begun --faces 3000
begin KILL --faces 3000
expect 0 "" groom many -o begun --faces 3000 --overwrite
grep -q "were groomed before" said && fail "--overwrite used what was kept"
# A model that is being replaced stays as it is, and --resume goes on with the new one.
expect 0 "" run cohort -o replaced "${quick[@]}"
mv replaced begun_model
begin KILL --faces 3000
mv begun/state/work.journal begun_model/state
expect 0 "finished shapes of a run that was ended" verify begun_model
expect 0 "of 10 shapes were groomed before" groom --resume -o begun_model
diff -r begun_model/groomed anew/groomed >said || fail "groom --resume over a model: $(cat said)"

printf '\377' | dd of=damaged/state/optimize.ckpt bs=1 seek=3000 conv=notrunc 2>/dev/null
expect 1 "optimize.ckpt" run --resume -o damaged
expect 1 "" optimize -o nothing
[ -e damaged/model.json ] && fail "a damaged checkpoint was used"

# ---- mirrored inputs ----
mkdir pair
for i in 0 1 2; do
    "$synthetic" bump pair/right_$i.ply index $i
    "$synthetic" bump pair/left_$i.ply index $i mirror 1 turn 100 shift 7
done
expect 0 "3 of them mirrored" run pair -o mirrored "${quick[@]}" --reflect-match left \
    --set original_frame=yes --template right_1
particles mirrored 64 6
[ "$(grep -c '"mirrored": "yes"' mirrored/project.swproj)" -eq 3 ] || fail "mirrored is not told"
[ "$(find mirrored/particles -name '*_original.particles' | wc -l)" -eq 6 ] ||
    fail "no particles in the original frame"
cmp -s mirrored/particles/right_0_{local,original}.particles || fail "original is not local"
cmp -s mirrored/particles/left_0_{local,original}.particles && fail "original is mirrored"

# ---- how many shapes, how many particles ----
expect 0 "verdict:" run cohort/s0.ply -o one "${quick[@]}"
particles one 64 1
expect 0 "verdict:" run cohort/s0.ply cohort/s1.ply -o pair_of "${quick[@]}"
particles pair_of 64 2
few=(--faces 1500 --stage1-epochs 2 --stage2-epochs 2)
expect 2 "at least 7" run cohort -o six -J 6
[ -e six ] && fail "refused options left a folder"
expect 0 "" run cohort -o seven -J 7 "${few[@]}" --adaptivity 0
particles seven 7 5
expect 1 "faces" run cohort/s0.ply cohort/s1.ply -o crowd -J 1000 "${few[@]}"
expect 0 "" run cohort -o plain "${few[@]}" -J 32 --align none --seed 7
expect 0 "" run cohort -o literal "${few[@]}" -J 32 --preset paper-literal-femur
# The paper's first stage ends by matched neighbours alone, and never, if not asked to; its last epoch is one of the stage.
ends() {
    local folder=$1
    shift
    expect 0 "" run cohort -o "$folder" -J 32 --faces 1500 --preset paper-literal-femur --stage1-epochs 8 --stage2-epochs 0 --set geodesic_interval=2 "$@"
    awk -F, '$1 == 1 { n++; last = $2 } END { print n " " last }' "$folder/history.csv"
}
[ "$(ends matched --set stop_mismatched=1)" = "3 7" ] || fail "matched particles do not end stage 1"
[ "$(ends never --set stop_mismatched=1 --set stop_rule=never)" = "8 7" ] || fail "stage 1 ends although it is not to"
[ "$(ends stalled --set stop_mismatched=0)" = "8 7" ] || fail "the paper's stage 1 ends since it has stalled"
particles literal 32 5
expect 2 "nowhere" run cohort -o x --template nowhere
expect 2 "the nearest is 'gamma'" run cohort -o x --set gama=1

# ---- shapes that are hard ----
mkdir torus sheet plate mixed open
for i in 0 1 2; do
    "$synthetic" torus torus/t$i.ply level 2 index $i turn $((30 * i))
    "$synthetic" sheet sheet/t$i.ply level 2 index $i
    "$synthetic" plate plate/p$i.ply index $i count 3
    "$synthetic" ellipsoid mixed/m$i.ply index $i level $((i + 2))
    "$synthetic" sphere open/o$i.ply index $i hole $((20 * i))
done
for kind in torus sheet plate mixed open; do
    expect 0 "verdict:" run $kind -o of_$kind "${quick[@]}"
    particles of_$kind 64 3
done
grep -q hole said || fail "a filled hole is not told: $(cat said)"

# ---- files that are broken ----
bad=(run cohort/s0.ply cohort/s1.ply -o x "${quick[@]}")
sed 's/^X//' >nan.ply <<'END'
Xply
Xformat ascii 1.0
Xelement vertex 4
Xproperty float x
Xproperty float y
Xproperty float z
Xelement face 4
Xproperty list uchar int vertex_indices
Xend_header
X0 0 0
X1 0 0
X0 nan 0
X0 0 1
X3 0 2 1
X3 0 1 3
X3 1 2 3
X3 0 3 2
END
: >empty.ply
head -c 2000 cohort/s2.ply >short.ply
for file in nan empty short missing; do
    expect 1 "$file.ply" "${bad[@]}" $file.ply
    sound $file.ply
done
[ -e x/project.swproj ] && fail "broken inputs left a project"
if [ "$(id -u)" -ne 0 ]; then
    mkdir locked && chmod a-w locked
    expect 1 "locked" run cohort -o locked/model "${quick[@]}"
    expect 1 "locked" run cohort -o locked "${quick[@]}"
fi
exit $failed
