#!/bin/bash
# A run that is killed, interrupted or meets a full or read-only disk, anywhere, leaves a folder that
# agrees with its manifest, and --resume ends in the same bytes as a run left alone.
#   test_crash.sh APSM MAKE_SYNTHETIC FAULT_LIBRARY KILLS [SEED]
# A killed run is resumed and killed again, and so on until it gets through: so states that were left
# by a resumed run are met as well, and steps near the end as often as those at the beginning.  Still
# nothing can hide behind a later kill: every state that a kill leaves is also copied, verified,
# resumed without a disturbance and compared, byte for byte, before the chain goes on.  Half of the
# kills come after some CPU time, half at an operation on the disk, in the middle of it if it is a
# write.  A
# fifth as many runs are interrupted by signals, three tenths meet a disk that is full, once or for
# good, or has become read-only, and in a fifth evaluate is killed when it is repeated.  All is random;
# the seed, which is printed, repeats all but what happens after some CPU time.
# The clocks that the program sees stand still (fault.c): times in its files are no difference.
set -u
apsm=$1 synthetic=$2 library=$3 kills=$4 seed=${5:-$(date +%N | sed 's/^0*//')}
export ASAN_OPTIONS=verify_asan_link_order=0
export OMP_WAIT_POLICY=passive # two threads, and other programs beside them
# The program starts itself anew to choose kernels (cli/kernels.h); the clock that kills would go on.
if grep -q avx2 /proc/cpuinfo; then export OPENBLAS_CORETYPE=Haswell; fi
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
RANDOM=$((seed % 32768))
echo "seed $seed"
failed=0
run=(run cohort -o x -J 24 --faces 300 --stage1-epochs 4 --stage2-epochs 4 --fidelity 0.5
    --fidelity-rounds 5 --specificity-samples 20 --checkpoint-seconds 0 --original-frame --threads 2)

fail() {
    echo "FAILED: $*"
    failed=1
}

# random N: $drawn is below N.  (In a subshell RANDOM would not follow from the seed.)
random() { drawn=$(((RANDOM * 32768 + RANDOM) % $1)); }

# Below N, too, but any power of two as likely as the next: from 0, or down from N.
random_early() {
    local bits=0
    while ((1 << bits < $1)); do ((bits++)); done
    random $((bits + 1))
    random $(((1 << drawn) < $1 ? 1 << drawn : $1))
}
random_late() {
    random_early "$1"
    drawn=$(($1 - 1 - drawn))
}

# apsm with a fault MODE:N; exit code in $code.  (A shell that is told of a killed job says so.)
faulty() {
    { LD_PRELOAD=$library APSM_FAULT=$1:$2 "$apsm" "${@:3}" >said 2>&1; } 2>/dev/null
    code=$?
}

# An undisturbed run: $operations, the last of them $needing_space, and $length in ms of CPU time.
counted() {
    APSM_FAULT_COUNT=count faulty count 0 "$@"
    read -r operations needing_space length <count
}

# verified WHAT: x, which was left by WHAT, agrees with its manifest.
verified() {
    [ ! -e x/manifest.json ] || "$apsm" verify x >said 2>&1 ||
        fail "$1: verify before --resume: $(cat said)"
}

compare() {
    diff -r x whole/x >said 2>&1 || fail "$1: other bytes: $(head -c 2000 said)"
}

# finish WHAT: resumes x and compares; $operations and $length: what was left to do.
finish() {
    verified "$1"
    counted "${run[@]}" --quiet --resume
    [ $code -eq 0 ] || fail "$1: --resume: $(cat said)"
    compare "$1"
}

has_ended() { grep -q "^        \"$1\": {" x/manifest.json 2>/dev/null; }

# $step: where x stands, and within optimize by the progress told by the runs of this chain.
find_step() {
    local last
    for step in groom initialize optimize evaluate report; do has_ended $step || break; done
    [ $step = optimize ] || return
    last=$(grep -oE '"stage":"(stage 1|stage 2|fidelity)","done":[0-9]+,"total":[0-9]+' progress |
        tail -n 1)
    case $last in
    '' | '"stage":"stage 1"'*) step="stage 1" ;;
    '"stage":"stage 2"'*) step="stage 2" ;;
    *) step=fidelity ;;
    esac
    if [[ $last =~ \"done\":([0-9]+),\"total\":([0-9]+) && ${BASH_REMATCH[1]} = "${BASH_REMATCH[2]}" ]]; then
        [ "$step" = "stage 2" ] && step=fidelity
        [ "$step" = "stage 1" ] && step="stage 2"
    fi
}

mkdir cohort
for i in 0 1 2; do "$synthetic" bump cohort/s$i.ply index $i level 2 mirror $((i % 2)); done
run+=(--reflect-match s1)
counted "${run[@]}" --quiet
[ $code -eq 0 ] || fail "an undisturbed run: $(cat said)"
"$apsm" verify x >said 2>&1 || fail "verify: $(cat said)"
mkdir whole
mv x whole/x
whole_operations=$operations whole_length=$length whole_needing_space=$needing_space
echo "$operations operations, $length ms"

# kill_once: a run with --resume that is killed at $at, if it does not get through before: $what tells
# all that happened since the chain began.
kill_once() {
    local hows=(random random_early random_late)
    local how=${hows[k / 2 % 3]}
    if ((k % 2)); then
        $how $((operations + 2))
        at=$((1 + drawn))
        what="$what, killed at operation $at"
        faulty kill $at "${run[@]}" --progress json --resume
    else
        $how $((length + 2))
        at=$((1 + drawn))
        what="$what, killed after $at ms"
        faulty cpu-kill $at "${run[@]}" --progress json --resume
    fi
    cat said >>progress
}

declare -A fell=()
k=0 halves=0 chains=0
while ((k < kills)); do
    rm -rf x progress
    operations=$whole_operations length=$whole_length what=begun step= times=0
    ((chains++))
    while ((k < kills)); do
        kill_once
        if [ $code -eq 0 ]; then
            compare "$what"
            # Measured under load, the time was too long.
            ((k % 2 == 0 && length == whole_length && at < length)) && whole_length=$at
            break
        fi
        [ $code -eq 137 ] || fail "$what: exit code $code, $(tail -n 1 said)"
        ((k++))
        before=$step
        find_step
        [ "$step" = "$before" ] && ((times++)) || times=1
        fell[$step]=$((${fell[$step]:-0} + 1))
        [ -n "$(find x -name '*.tmp' -size +0 2>/dev/null)" ] && ((halves++))
        rm -rf kept
        [ -e x ] && cp -r x kept
        finish "$what"
        ((times >= 3)) && break # it may take long until such a step is got through
        rm -rf x
        [ -e kept ] && mv kept x
    done
done
line="$k kills in $chains runs, $halves in the middle of a file"
for step in groom initialize "stage 1" "stage 2" fidelity evaluate report; do
    line="$line; $step ${fell[$step]:-0}"
    ((kills < 500 || ${fell[$step]:-0} > 0)) || fail "no kill fell into $step"
done
echo "$line"

# Signals, at an operation or some time; the second of two ends the program at once.
modes=(int cpu-int term cpu-term hup cpu-hup twice)
for ((k = 0; k < (kills + 4) / 5; k++)); do
    rm -rf x
    mode=${modes[k % 7]}
    case $mode in
    cpu-*) random "$whole_length" ;;
    *) random "$whole_operations" ;;
    esac
    what="$mode at $((1 + drawn))"
    faulty $mode $((1 + drawn)) "${run[@]}" --quiet
    [ $code -eq 130 ] || [ $code -eq 0 ] || fail "$what: $code, $(cat said)"
    finish "$what"
done

# A disk that is full when the lock is removed need not be noticed: that takes no space.
for ((k = 0; k < 3 * kills / 10; k++)); do
    rm -rf x
    random "$whole_needing_space"
    n=$((1 + drawn))
    mode=full
    ((k % 3 == 1)) && mode=once
    ((k % 3 == 2)) && mode=readonly
    faulty $mode $n "${run[@]}" --quiet
    case $code in
    1)
        grep -qE '^apsm: .*x.*(No space left|full|[Rr]ead-only)' said ||
            fail "$mode at operation $n is not told: $(cat said)"
        ;;
    0) [ $mode = full ] && fail "a disk full at operation $n went unnoticed" ;;
    *) fail "$mode at operation $n: exit code $code, $(cat said)" ;;
    esac
    finish "$mode at operation $n"
done

# A step that is repeated on a finished model, and killed: no mixture of two models.
mkdir paper
rm -rf x
cp -r whole/x x
faulty none 0 evaluate x --definition paper --quiet
[ $code -eq 0 ] || fail "evaluate: $(cat said)"
"$apsm" verify x | grep -q "report.html: may be older" || fail "an old report is not told"
faulty none 0 report x --quiet
mv x paper/x
for ((k = 0; k < (kills + 4) / 5; k++)); do
    rm -rf x
    cp -r whole/x x
    random $((whole_operations / 3))
    n=$((1 + drawn))
    faulty kill $n evaluate x --definition paper --quiet
    faulty none 0 run -o x --resume --quiet
    [ $code -eq 0 ] || fail "evaluate killed at $n: $(cat said)"
    "$apsm" verify x >said 2>&1 || fail "evaluate killed at $n: verify: $(cat said)"
    diff -r x whole/x >/dev/null 2>&1 || diff -r x paper/x >said 2>&1 ||
        fail "evaluate killed at operation $n: a mixture: $(head -c 2000 said)"
done

# Checkpoints take at most a hundredth of the time, however slow the disk: here two seconds each, beside
# epochs of two seconds.  What the first takes is not known beforehand, and the last is always made.
rm -rf x
APSM_FAULT_COUNT=count faulty slow 2000 run cohort -o x -J 16 --faces 200 --stage1-epochs 300 \
    --stage2-epochs 300 --fidelity 0 --quiet
[ $code -eq 0 ] || fail "with a slow disk: $(cat said)"
read -r checkpoints <count
seconds=$(grep -A 1 '^        "optimize": {' x/manifest.json | grep -oE 'wall_seconds": [0-9]+' |
    grep -oE '[0-9]+$')
echo "$checkpoints checkpoints of 2 s in $seconds s"
((checkpoints >= 4)) || fail "$checkpoints checkpoints in $seconds s"
(((checkpoints - 2) * 200 <= seconds)) || fail "$checkpoints checkpoints of 2 s in $seconds s"
exit $failed
