#!/bin/bash
# Shares of a job, done by several processes, come to the same bytes as the job done by one.
#   tests/cli/test_shards.sh APSM MAKE_SYNTHETIC
# With MPI in the program (make test-mpi) also ranks, and KILLS (5) of which one is killed.
set -u
apsm=$(realpath "$1") make=$(realpath "$2") root=$(cd "$(dirname "$0")/../.." && pwd)
dir=$(mktemp -d)
slurm=$root/tests/support/one-node-slurm own_slurm=
trap '[ -z "$own_slurm" ] || "$slurm" stop "$own_slurm"; rm -rf "$dir"' EXIT
cd "$dir" || exit 1
failed=0
slower=${APSM_TESTS_SLOWER:-1} # see head.sh
fail() { echo "FAILED: $*" && failed=1; }
small=(-J 32 --threads 1 --stage1-epochs 1 --stage2-epochs 1 --fidelity-rounds 1)
job=("${small[@]}" --faces 1200 --quiet) loud=("${small[@]}" --faces 1200)

mkdir in
for i in 0 1 2 3 4; do "$make" bump in/s$i.ply level 3 index $i count 5 || exit 1; done
"$apsm" run in -o one "${job[@]}" 2>/dev/null || exit 1

# same FOLDER: as one, but for times.  The report holds the manifest and so the times, too.
same() {
    diff -r -q -x manifest.json -x report.html one "$1" || fail "$1 is not as done by one process"
    [ -z "$(ls "$1/state" | grep shard)" ] || fail "$1: shares are left behind"
}
are_fits_of() { # WHAT: fits as made by one process
    diff -r -q fits_one fits || fail "$1: the fits are not as made by one process: $(tail -n 1 log)"
    rm -rf fits
}

for n in 1 7; do
    for _ in meshes poses registration; do
        for ((k = 1; k <= n; k++)); do
            "$apsm" groom in -o by$n "${job[@]}" --shard $k/$n 2>/dev/null || fail "share $k/$n"
        done
        [ -e by$n/manifest.json ] && fail "a share wrote more than its share"
    done
    "$apsm" groom in -o by$n "${loud[@]}" >log 2>&1 || fail "gathering $n"
    grep -q "5 of 5 shapes were groomed before" log || fail "gathering $n made meshes anew"
    for ((k = 1; k <= n; k++)); do
        "$apsm" initialize by$n --threads 1 --quiet --shard $k/$n 2>/dev/null || fail "particles $k/$n"
    done
    "$apsm" run --resume -o by$n --threads 1 --quiet 2>/dev/null || fail "the rest of $n"
    same by$n
done

# evaluate: every share goes as far as it can without the others, so that after three rounds all is
# kept; with fewer, and with shares of other options or particles, what is missing is made.
rounds_of() { # FOLDER N ROUNDS [OPTION...]
    for ((r = 0; r < $3; r++)); do
        for ((k = 1; k <= $2; k++)); do
            "$apsm" evaluate -o "$1" --threads 1 --quiet --shard $k/$2 "${@:4}" 2>err || fail "$1: $(cat err)"
        done
    done
}
kept() { # FOLDER: how many kept results the plain verb finds
    "$apsm" evaluate -o "$1" --threads 1 >log 2>&1 || fail "gathering $1: $(tail -n 1 log)"
    sed -n 's/^\([0-9]*\) results that shares have kept.*/\1/p' log
}
# Specificity in 100 pieces, generalization and surfaces a shape, those again by three other
# templates, certificates in two pieces, and four pieces of the verdict.
all=$((100 + 5 * (1 + 1 + 3 + 2 + 4)))
for n in 1 7; do
    cp -r one whole$n && cp -r one half$n
    rounds_of whole$n $n 3
    diff -r -q one whole$n | grep -v 'shard-' && fail "a share of evaluate wrote more than its share"
    [ "$(kept whole$n)" = $all ] || fail "not all that $n shares of evaluate keep is found: $(grep kept log)"
    same whole$n
done
"$apsm" evaluate -o half7 --threads 1 --quiet --shard 3/7 2>/dev/null || fail "one share of evaluate"
cp half7/state/shard-3-of-7.journal third
some=$(kept half7)
[ "${some:-0}" -gt 10 ] && [ "$some" -lt $((all / 4)) ] || fail "one of 7 shares is found as $some results"
same half7
# Killed: what a journal was cut off in is made again, the rest is found.
cp -r one cut && head -c $(($(stat -c %s third) / 2)) third >cut/state/shard-3-of-7.journal
rounds_of cut 7 1 && cmp -s third cut/state/shard-3-of-7.journal || fail "a killed share does not go on"
for k in 1 2 4 5 6 7; do rm cut/state/shard-$k-of-7.journal; done
[ "$(kept cut)" = "$some" ] || fail "a share that was killed and goes on is found as $(grep kept log)"
same cut
# Stale: of other options, and of other particles.
cp -r one stale && rounds_of stale 1 1 --definition paper
[ -z "$(kept stale)" ] && grep -q "not used, and left" log || fail "shares of other options are used: $(grep kept log)"
rm stale/state/shard-1-of-1.journal || fail "what was of no use is not left"
same stale
cp -r one moved && rounds_of moved 1 1
awk 'NR == 3 { $1 += 0.5 } { print }' one/particles/s1_world.particles >moved/particles/s1_world.particles
cp -r moved moved_one && rm moved_one/state/shard-* && kept moved_one >log2
[ -z "$(kept moved)" ] || fail "shares of other particles are used"
rm moved/state/shard-1-of-1.journal || fail "what was of no use is not left"
diff -r -q -x manifest.json -x report.html moved_one moved || fail "shares of other particles change what is found"
cmp -s moved/model.json one/model.json && fail "other particles make the same model"
"$apsm" evaluate one/project.swproj --shard 1/2 2>err && fail "files are evaluated in shares"
grep -q "for a model folder" err || fail "evaluating files in shares: $(cat err)"

# Shares that other options made are of no use, and one that is missing is made.
"$apsm" groom in -o part "${small[@]}" --quiet --shard 2/3 --faces 900 2>/dev/null || fail "other faces"
"$apsm" groom in -o part "${job[@]}" --shard 1/3 2>/dev/null || fail "one share"
"$apsm" run in -o part "${job[@]}" 2>/dev/null || fail "gathering a part"
same part

# ---- fit: whole shapes, a cloud, one that is refused and one that cannot be read ----
new=(in/s0.ply in/s2.ply in/s4.ply odd/cloud.csv odd/stranger.ply odd/broken.ply)
mkdir odd && echo "no mesh" >odd/broken.ply && "$make" ellipsoid odd/stranger.ply || exit 1
"$apsm" convert one/particles/s1_local.particles -o odd/cloud.csv --quiet || fail "a cloud"
fit() { "$apsm" fit one "${new[@]}" -o fits --threads 1 "$@" >log 2>&1; }
share() { fit --shard "$@" || fail "fit --shard $*: $(tail -n 1 log)"; }
gather() {
    fit # and two of six are not fitted
    are_fits_of "$1"
}
fit
mv fits fits_one || fail "fit: $(tail -n 1 log)"
[ "$(cut -d, -f2 fits_one/fit.csv | grep -c 'good\|review')" = 4 ] && grep -q ,refused, fits_one/fit.csv &&
    grep -q ,failed, fits_one/fit.csv || fail "other fits than are wanted here: $(cut -d, -f1,2 fits_one/fit.csv)"
for n in 1 3; do
    for ((k = 1; k <= n; k++)); do share $k/$n; done
    [ "$(find fits -type f | wc -l)" = $n ] || fail "a share of fit wrote more than its journal"
    [ $n = 3 ] && cp -r fits fits_kept
    gather "$n shares"
    grep -q "^5 fits that shares have kept" log || fail "gathering $n shares of fits: $(tail -n 3 log)"
done
# Killed and done again; one that is missing; one of other inputs; an input that has changed since.
cp -r fits_kept fits && cut=fits/state/shard-1-of-3.journal
head -c $(($(stat -c %s $cut) * 2 / 3)) $cut >cut_off && cp cut_off $cut && rm fits/state/shard-2-of-3.journal
share 1/3
cmp -s $cut fits_kept/state/shard-1-of-3.journal || fail "a killed share of fits does not go on"
gather "a share is missing"
asked=("${new[@]}") new=(in/s1.ply in/s3.ply)
share 1/1
new=("${asked[@]}")
fit
grep -q "of other inputs: not used" log || fail "shares of other inputs are not told: $(tail -n 3 log)"
cp -r fits others && rm -r fits/state && are_fits_of "shares of other inputs" # which are of use yet
"$apsm" fit one in/s1.ply in/s3.ply -o others --threads 1 --overwrite >log 2>&1
grep -q "^2 fits that shares have kept" log && [ ! -e others/state ] || fail "unused shares are not left: $(tail -n 3 log)"
# A share none of whose inputs could be read has kept nothing that is of other inputs.
"$apsm" fit one odd/broken.ply -o fits --threads 1 --shard 1/1 >log 2>&1
"$apsm" fit one odd/broken.ply -o fits --threads 1 >log 2>&1
grep -q "of other inputs" log || [ -e fits/state ] && fail "a share without fits: $(tail -n 3 log)"
rm -rf fits
# The same files, by other paths.
cp -r fits_kept fits && "$apsm" fit one "${new[@]/#/$dir/}" -o fits --threads 1 >log 2>&1
grep -q "^5 fits" log || fail "other paths of the same files: $(grep kept log)"
rm -rf fits
# A first piece that a power cut has spoiled is not another job's.
cp -r fits_kept fits && printf XXXX | dd of=fits/state/shard-1-of-3.journal bs=1 seek=100 conv=notrunc 2>/dev/null
share 1/3
printf XXXX | dd of=fits/state/shard-2-of-3.journal bs=1 seek=100 conv=notrunc 2>/dev/null
gather "a spoiled first piece"
grep -q "^5 fits" log || fail "a spoiled first piece: $(tail -n 1 log)"
cp -r fits_kept fits && cp in/s0.ply keep.ply && cp in/s1.ply in/s0.ply
fit
grep -q "^4 fits" log && ! cmp -s fits/shapes/s0.json fits_one/shapes/s0.json || fail "an input that changed: $(grep kept log)"
rm -rf fits && mv keep.ply in/s0.ply
# Of another job: told before anything is fitted; a share that is done again takes its place.
cp -r fits_kept fits && share 2/3 --force
fit && fail "shares of other options are taken"
grep -q "fits/state: holds what shares of another job" log && [ ! -e fits/fit.csv ] || fail "shares of other options: $(tail -n 1 log)"
share 2/3
gather "a share with the right options"
# Gathered while a share is at work: its journal stays, and one whose journal was removed says so.
cp -r fits_kept fits && exec 9<fits/state/shard-2-of-3.journal && flock -n 9
fit
exec 9<&-
grep -q "shard-2-of-3.journal: this share is still at work" log && [ "$(ls fits/state)" = shard-2-of-3.journal ] ||
    fail "a share at work: $(tail -n 3 log)"
rm -r fits/state && are_fits_of "a share at work"
fit --shard 1/1 &
for ((t = 0; t < 500; t++)); do [ -s fits/state/shard-1-of-1.journal ] && break || sleep 0.01; done
rm fits/state/shard-1-of-1.journal
wait $!
grep -q "was removed meanwhile" log || fail "a share whose journal was removed: $(tail -n 1 log)"
rm -rf fits
# Nothing of anybody's is replaced.
mkdir -p fits/state && echo mine >fits/state/shard-1-of-3.journal
fit --shard 1/3 && fail "a share replaces a file of ours"
grep -q "was not written by apsm" log && [ "$(cat fits/state/shard-1-of-3.journal)" = mine ] || fail "a file of ours: $(cat log)"
cp -r fits_one/. fits/ && fit --shard 2/3 && fail "a share in a folder of fits"
grep -q "holds fits already" log || fail "a share in a folder of fits: $(cat log)"
rm -rf fits

# ---- joints: the grooming of all parts, a round a call ----
mkdir parts
for i in 0 1 2 3; do
    "$make" ellipsoid parts/s${i}_cup.ply level 2 index $i count 4 wobble 0.03 seed 3 || exit 1
    "$make" ellipsoid parts/s${i}_ball.ply level 2 index 2 count 4 wobble 0.03 seed 8 turn $((6 * i - 15)) shift 60 || exit 1
done
joint=(--parts cup=_cup,ball=_ball "${small[@]}" --faces 400)
"$apsm" run parts -o joint_one "${joint[@]}" --quiet 2>err || fail "joint: $(cat err)"
is_joint_of_one() { diff -r -q -x manifest.json -x report.html joint_one "$1" || fail "$1 is not as done by one process"; }
for _ in meshes poses; do
    for k in 1 2; do "$apsm" run parts -o joint "${joint[@]}" --shard $k/2 --quiet 2>err || fail "share of a joint: $(cat err)"; done
done
find joint -type f | grep -v 'parts/[a-z]*/state/shard-[12]-of-2.journal' && fail "a share of a joint wrote more than its share"
"$apsm" run parts -o joint "${joint[@]}" >log 2>&1 || fail "gathering a joint: $(tail -n 1 log)"
[ "$(grep -c "4 of 4 shapes were groomed before" log)" = 2 ] || fail "gathering a joint made meshes anew"
is_joint_of_one joint
echo "mine" >no_joint.txt && mkdir -p taken/parts && cp no_joint.txt taken/parts/
"$apsm" run parts -o taken "${joint[@]}" --shard 1/2 2>err && fail "a share in a folder of others"
"$apsm" run in -o no --shard 1/2 2>err && fail "run --shard of one part"
grep -q "of one part share groom" err || fail "run --shard of one part: $(cat err)"
"$apsm" fit joint_one parts -o no --shard 1/2 2>err && fail "fits of joints in shares"
grep -q "fits of joints" err || fail "fits of joints in shares: $(cat err)"
"$apsm" run parts -o no "${joint[@]}" --shared-boundary cup,ball --shard 1/2 2>err && fail "--shared in shares"
grep -q "cut by one process" err || fail "--shared in shares: $(cat err)"

for word in 0/3 4/3 1/0 3 1/ /3 a/b 1/3x; do
    "$apsm" groom in -o no --shard $word 2>err && fail "--shard $word is taken"
    grep -q "from 1/7 to 7/7" err || fail "--shard $word: $(cat err)"
    "$apsm" fit one in -o no --shard $word 2>err && fail "fit --shard $word is taken"
    grep -q "from 1/7 to 7/7" err || fail "fit --shard $word: $(cat err)"
done
[ -e no ] && fail "a folder for nothing"
"$apsm" optimize one --shard 1/2 2>err && fail "optimize takes --shard"

# ---- contrib ----
if command -v snakemake >/dev/null; then
    snakemake -s "$root/contrib/snakemake/Snakefile" -j 2 -d "$dir" --nolock --quiet \
        --config inputs=in model=snake shards=2 apsm="$apsm" options="${job[*]}" >log 2>&1 || fail "snakemake: $(tail -n 5 log)"
    same snake
    snakemake -s "$root/contrib/snakemake/fit.smk" -j 2 -d "$dir" --nolock --quiet \
        --config inputs="${new[*]}" model=one fits=fits shards=2 apsm="$apsm" options="--threads 1" >log 2>&1 || fail "snakemake fit: $(tail -n 5 log)"
    are_fits_of "snakemake"
else
    echo "SKIPPED: contrib/snakemake is not tested, there is no snakemake"
fi
mkdir told && printf '#!/bin/bash\necho "$*" >>submitted\necho 17\n' >told/sbatch && chmod +x told/sbatch
for out in -oone_word "-o two" --out=three; do
    rm -f submitted
    # shellcheck disable=SC2086 # one word or two
    PATH=$dir/told:$PATH "$root/contrib/slurm/apsm-array" 2 in $out --quiet >log 2>&1 || fail "apsm-array $out: $(cat log)"
    [ "$(grep -c -e "${out#-o }" submitted)" = 8 ] || fail "apsm-array $out: a step does not know the folder: $(cat submitted)"
done
rm submitted
PATH=$dir/told:$PATH "$root/contrib/slurm/apsm-array" 2 in --quiet >log 2>&1 && fail "apsm-array without a folder"
grep -q "MODEL_DIR" log && [ ! -e submitted ] || fail "apsm-array without a folder: $(cat log)"
if command -v sbatch >/dev/null && ! timeout 5 sinfo >/dev/null 2>&1; then # no cluster: one of ours
    own_slurm=$dir/slurm-here
    if "$slurm" start "$own_slurm" >log 2>&1; then
        export SLURM_CONF=$own_slurm/slurm.conf
    else
        echo "no Slurm of this machine alone: $(tail -n 1 log)"
    fi
fi
if command -v sbatch >/dev/null && timeout 5 sinfo >/dev/null 2>&1; then
    APSM=$apsm "$root/contrib/slurm/apsm-array" 2 in -o slurm "${job[@]}" >log || fail "sbatch"
    APSM=$apsm "$root/contrib/slurm/apsm-fit-array" 2 one "${new[@]}" -o fits >>log || fail "sbatch of fits"
    for ((t = 0; t < 120; t++)); do squeue -h | grep -q . || break; sleep 1; done
    same slurm
    are_fits_of Slurm
    echo "contrib/slurm: jobs $(tr '\n' ' ' <log)of a Slurm"
else
    # What would be submitted, by an sbatch of our own that runs it at once.
    mkdir bin
    cat >bin/sbatch <<'EOF'
#!/bin/bash
tasks=
for word in "$@"; do
    case $word in
    --array=*) tasks=$(seq 1 "${word#--array=1-}") ;;
    --wrap=*) command=${word#--wrap=} ;;
    esac
done
for SLURM_ARRAY_TASK_ID in ${tasks:-0}; do export SLURM_ARRAY_TASK_ID; bash -c "$command" >&2 || exit 1; done
echo 17
EOF
    chmod +x bin/sbatch
    PATH=$dir/bin:$PATH APSM=$apsm "$root/contrib/slurm/apsm-array" 2 in -o slurm "${job[@]}" >log 2>&1 || fail "apsm-array: $(tail -n 3 log)"
    same slurm
    PATH=$dir/bin:$PATH APSM=$apsm "$root/contrib/slurm/apsm-fit-array" 2 one "${new[@]}" -o fits >log 2>&1
    are_fits_of apsm-fit-array
    echo "SKIPPED: contrib/slurm is tested with an sbatch of our own, there is no Slurm"
fi

# ---- MPI ----
if ! ldd "$apsm" | grep -q libmpi; then
    echo "SKIPPED: ranks are not tested, this program was built without APSM_MPI (make test-mpi does)"
    exit $failed
fi
ranks() { timeout $((120 * slower)) mpirun --allow-run-as-root --oversubscribe -n "$@"; }
for n in 1 2 8 3; do
    begin=$(date +%s%N)
    ranks $n "$apsm" run in -o r$n "${job[@]}" 2>/dev/null || fail "$n ranks"
    took=$((($(date +%s%N) - begin) / 1000000)) # milliseconds; at last of 3 ranks
    same r$n
done
# What is not gathered is done by the first alone: method psm, and a template that feels the others.
"$apsm" run in -o pull_one "${job[@]}" --template-gradient 2>/dev/null || fail "template gradient"
ranks 2 "$apsm" run in -o pull_two "${job[@]}" --template-gradient 2>/dev/null || fail "2 ranks, template gradient"
diff -r -q -x manifest.json -x report.html pull_one pull_two || fail "ranks change a template that feels the others"
ranks 2 "$apsm" run in -o two "${job[@]}" --threads 2 2>/dev/null || fail "2 ranks of 2 threads"
same two
ranks 2 "$apsm" run in -o two "${job[@]}" --overwrite 2>/dev/null || fail "2 ranks, a model made anew"
same two
if timeout 5 srun --mpi=list 2>&1 | grep -qw pmix && timeout 5 sinfo >/dev/null 2>&1; then
    timeout $((120 * slower)) srun -n 2 --mpi=pmix "$apsm" run in -o srun "${job[@]}" 2>/dev/null || fail "2 ranks under srun"
    same srun
    echo "2 ranks under srun" # without PMIx they would be two programs that want one folder
else
    echo "SKIPPED: ranks under srun are not tested, there is no Slurm with PMIx"
fi
ranks 2 "$apsm" run nowhere -o no 2>err && fail "2 ranks on nothing"
grep -q "nowhere: no such" err || fail "ranks do not tell what is wrong: $(cat err)"

# Joints: every rank goes through all parts.
for n in 2 3; do
    ranks $n "$apsm" run parts -o joint_$n "${joint[@]}" --quiet 2>err || fail "a joint by $n ranks: $(cat err)"
    is_joint_of_one joint_$n
done
ranks 2 "$apsm" run parts -o joint_2 "${joint[@]}" --quiet --overwrite 2>err || fail "a joint made anew by 2 ranks: $(cat err)"
is_joint_of_one joint_2
rm joint_2/parts/ball/report.html && ranks 2 "$apsm" run parts -o joint_2 "${joint[@]}" --quiet --resume 2>err || fail "a joint gone on with by 2 ranks: $(cat err)"
is_joint_of_one joint_2

# Fixed shapes: every rank has their files, none moves them.
row() { printf '{"name": "%s", "shape_1": "in/%s.ply"%s}' "$1" "$1" "${2:-}"; }
given() { printf ', "fixed": "yes", "local_particles_1": "one/particles/%s_local.particles"' "$1"; }
printf '{"data": [%s, %s, %s, %s, %s]}' "$(row s0 "$(given s0)")" "$(row s1)" "$(row s2 "$(given s2)")" \
    "$(row s3 "$(given s3)")" "$(row s4)" >fixed.swproj
fixed=(--faces 1200 --quiet --threads 1 --stage1-epochs 1 --stage2-epochs 1 --fidelity-rounds 1)
"$apsm" run fixed.swproj -o fixed_one "${fixed[@]}" 2>/dev/null || fail "fixed shapes"
for n in 2 3; do
    ranks $n "$apsm" run fixed.swproj -o fixed_$n "${fixed[@]}" 2>/dev/null || fail "fixed shapes, $n ranks"
    diff -r -q -x manifest.json -x report.html fixed_one fixed_$n || fail "$n ranks change fixed shapes"
done
cmp one/particles/s2_local.particles fixed_3/particles/s2_local.particles || fail "ranks moved a fixed shape"

# A rank dies at some moment, from the first to the last; the job ends, and goes on with another
# number of ranks.
kills=${KILLS:-5} ended=0
for ((k = 1; k <= kills; k++)); do
    rm -rf killed
    timeout $((120 * slower)) mpirun --allow-run-as-root --oversubscribe -n 3 "$apsm" run in -o killed "${job[@]}" >/dev/null 2>err &
    whole=$!
    for ((t = 0; t < 100; t++)); do
        victims=$(pgrep -P "$(pgrep -P $whole | head -n 1)" 2>/dev/null)
        [ "$(wc -w <<<"$victims")" = 3 ] && [ -e killed/state ] && break
        sleep 0.02
    done
    sleep "$(awk -v ms="$took" -v k=$k -v n="$kills" 'BEGIN { print ms / 1000 * (k - 0.7) / n }')"
    kill -9 "$(sed -n $((1 + k % 3))p <<<"$victims")" 2>/dev/null
    wait $whole && { ended=$((ended + 1)); same killed; continue; }
    grep -qi "kill\|signal" err || fail "a dead rank is not told: $(cat err)"
    ranks $((1 + k % 3)) "$apsm" run in --resume -o killed "${job[@]}" 2>err || fail "resume after kill $k: $(tail -n 3 err)"
    same killed
done
echo "$kills ranks killed, $ended of them too late"
[ $((2 * ended)) -le "$kills" ] || fail "most kills came too late"
exit $failed
