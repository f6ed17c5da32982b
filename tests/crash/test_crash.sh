#!/bin/bash
# A run that is killed, interrupted or meets a full or read-only disk, anywhere, leaves a folder that
# agrees with its manifest, and --resume ends in the same bytes as a run left alone.
#   test_crash.sh APSM MAKE_SYNTHETIC FAULT_LIBRARY KILLS [SEED]
# Half of the kills come by the clock, half at an operation on the disk, in the middle of a write if it
# is one; a fifth as many runs are interrupted by Ctrl-C, three tenths meet a disk that is full, once or
# for good, or has become read-only, and in a fifth evaluate is killed when it is repeated.  All is
# random; the seed, which is printed, repeats all but the clock.
set -u
apsm=$1 synthetic=$2 library=$3 kills=$4 seed=${5:-$(date +%N | sed 's/^0*//')}
export ASAN_OPTIONS=verify_asan_link_order=0
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder" || exit 1
RANDOM=$((seed % 32768))
echo "seed $seed"
failed=0
run=(run cohort -o x -J 32 --faces 400 --stage1-epochs 4 --stage2-epochs 4 --fidelity 0.5
    --checkpoint-seconds 0 --quiet --original-frame --threads 2)

fail() {
    echo "FAILED: $*"
    failed=1
}

random() { # below $1
    echo $(((RANDOM * 32768 + RANDOM) % $1))
}

# Times out of the way: what is left must be the same bytes.
level() {
    sed -i 's/"\(wall_seconds\|cpu_seconds\|peak_memory_mb\|threads\)": [0-9.]*/"\1": 0/' \
        "$1/manifest.json"
    "$apsm" report "$1" --quiet >/dev/null || fail "report $1"
}

# finish WHAT: resumes x, with what was done to it, and compares.
finish() {
    if [ -e x/manifest.json ]; then
        "$apsm" verify x >said 2>&1 || fail "$1: verify before --resume: $(cat said)"
    fi
    "$apsm" "${run[@]}" --resume >said 2>&1 || fail "$1: --resume: $(cat said)"
    "$apsm" verify x >said 2>&1 || fail "$1: verify: $(cat said)"
    level x
    diff -r x whole/x >said 2>&1 || fail "$1: other bytes: $(head -c 2000 said)"
}

# faulty MODE N: runs with a fault; exit code in $code
faulty() {
    LD_PRELOAD=$library APSM_FAULT=$1:$2 "$apsm" "${run[@]}" --resume >said 2>&1
    code=$?
}

mkdir cohort
for i in 0 1 2; do "$synthetic" bump cohort/s$i.ply index $i level 2 mirror $((i % 2)); done
run+=(--reflect-match s1)
begin=$(date +%s%N)
APSM_FAULT_COUNT=count faulty count 0
[ $code -eq 0 ] || fail "an undisturbed run: $(cat said)"
length=$((($(date +%s%N) - begin) / 1000000)) operations=$(cat count)
mkdir whole
mv x whole/x
level whole/x
echo "$operations operations, $length ms"

for ((k = 0; k < kills / 2; k++)); do
    rm -rf x
    ms=$(random "$length")
    "$apsm" "${run[@]}" --resume >/dev/null 2>&1 &
    process=$!
    sleep "$(printf '%d.%03d' $((ms / 1000)) $((ms % 1000)))"
    kill -9 $process 2>/dev/null
    wait $process 2>/dev/null
    finish "killed after $ms ms"
done

for ((k = kills / 2; k < kills; k++)); do
    rm -rf x
    n=$((1 + $(random "$operations")))
    faulty kill $n 2>/dev/null
    [ $code -eq 137 ] || fail "kill at operation $n: exit code $code"
    what="killed at operation $n"
    if ((k % 2)); then # and while it was resumed
        n=$((1 + $(random "$operations")))
        faulty kill $n 2>/dev/null
        what="$what and $n"
    fi
    finish "$what"
done

for ((k = 0; k < (kills + 4) / 5; k++)); do
    rm -rf x
    n=$((1 + $(random "$operations")))
    faulty int $n
    [ $code -eq 130 ] || [ $code -eq 0 ] || fail "Ctrl-C at operation $n: $code, $(cat said)"
    finish "Ctrl-C at operation $n"
done

for ((k = 0; k < 3 * kills / 10; k++)); do
    rm -rf x
    n=$((1 + $(random "$operations")))
    mode=full
    ((k % 3 == 1)) && mode=once
    ((k % 3 == 2)) && mode=readonly
    faulty $mode $n
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
"$apsm" evaluate x --definition paper --quiet || fail "evaluate"
"$apsm" verify x | grep -q "report.html: may be older" || fail "an old report is not told"
level x
mv x paper/x
for ((k = 0; k < (kills + 4) / 5; k++)); do
    rm -rf x
    cp -r whole/x x
    n=$((1 + $(random $((operations / 3)))))
    { LD_PRELOAD=$library APSM_FAULT=kill:$n "$apsm" evaluate x --definition paper --quiet >said; } \
        2>/dev/null
    "$apsm" run -o x --resume --quiet >said 2>&1 || fail "evaluate killed at $n: $(cat said)"
    "$apsm" verify x >said 2>&1 || fail "evaluate killed at $n: verify: $(cat said)"
    level x
    diff -r x whole/x >/dev/null 2>&1 || diff -r x paper/x >said 2>&1 ||
        fail "evaluate killed at operation $n: a mixture: $(head -c 2000 said)"
done
exit $failed
