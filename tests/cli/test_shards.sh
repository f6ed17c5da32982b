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

# Shares that other options made are of no use, and one that is missing is made.
"$apsm" groom in -o part "${small[@]}" --quiet --shard 2/3 --faces 900 2>/dev/null || fail "other faces"
"$apsm" groom in -o part "${job[@]}" --shard 1/3 2>/dev/null || fail "one share"
"$apsm" run in -o part "${job[@]}" 2>/dev/null || fail "gathering a part"
same part

for word in 0/3 4/3 1/0 3 1/ /3 a/b 1/3x; do
    "$apsm" groom in -o no --shard $word 2>err && fail "--shard $word is taken"
    grep -q "from 1/7 to 7/7" err || fail "--shard $word: $(cat err)"
done
[ -e no ] && fail "a folder for nothing"
"$apsm" optimize one --shard 1/2 2>err && fail "optimize takes --shard"

# ---- contrib ----
if command -v snakemake >/dev/null; then
    snakemake -s "$root/contrib/snakemake/Snakefile" -j 2 -d "$dir" --nolock --quiet \
        --config inputs=in model=snake shards=2 apsm="$apsm" options="${job[*]}" >log 2>&1 || fail "snakemake: $(tail -n 5 log)"
    same snake
else
    echo "SKIPPED: contrib/snakemake is not tested, there is no snakemake"
fi
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
    for ((t = 0; t < 120; t++)); do squeue -h | grep -q . || break; sleep 1; done
    same slurm
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
