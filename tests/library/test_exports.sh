#!/bin/bash
# The shared library shows what the public headers declare, and nothing else.
# $1 is the build folder, $2 the compiler.
set -u
build=$1
cc=$2
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT

# Declarations as the compiler sees them; inline functions, types and calls have no symbol.
echo '#include <apsm.h>' >"$folder/all.c"
"$cc" -std=c17 -E -P -DAPSM_LIST "-Iinclude" "$folder/all.c" | tr '\n' ' ' | sed 's/[;{}]/\n/g' |
    grep 'visibility("default")' | grep -oE '\bapsm_[a-z0-9_]+ *\(' | tr -d ' (' |
    sort -u >"$folder/declared"
# Whatever looks like a function in the headers, with or without the mark.
sed -E 's@/\*.*\*/@@' include/apsm/*.h | tr '\n' ' ' | sed -E 's@/\*[^*]*\*+([^/*][^*]*\*+)*/@@g; s/[;{}]/\n/g' |
    grep -vE 'static inline|typedef|#define|return' | grep -oE '^[^(]*\bapsm_[a-z0-9_]+\(' |
    grep -oE 'apsm_[a-z0-9_]+\($' | tr -d '(' | sort -u >"$folder/named"
nm -D --defined-only "$build/libapsm.so" | awk '{print $3}' | sort -u >"$folder/shown"

status=0
[ "$(wc -l <"$folder/declared")" -gt 60 ] || { echo "FAILED: found too few declarations"; status=1; }
diff "$folder/declared" "$folder/shown" >"$folder/difference" ||
    { echo "FAILED: declared (<) is not what the library shows (>):"; cat "$folder/difference"; status=1; }
comm -23 "$folder/named" "$folder/declared" >"$folder/unmarked"
[ ! -s "$folder/unmarked" ] ||
    { echo "FAILED: in a public header without APSM_API:"; cat "$folder/unmarked"; status=1; }
# A struct that a program fills in or that is filled in for it may grow at its end: whoever takes one is told its size.
sed -E 's@/\*.*\*/@@' include/apsm/*.h | tr '\n' ' ' | sed 's/[;{}]/\n/g' | grep 'APSM_API' |
    grep -E 'apsm_[a-z_]*(settings|options|input|import|fit|totals|comparison|verification|foreign_model) \*' |
    grep -vE 'apsm_[a-z_]+_sized\(|apsm_options \*|apsm_options_|apsm_volume' >"$folder/unsized"
[ ! -s "$folder/unsized" ] || { echo "FAILED: taken without a size:"; cat "$folder/unsized"; status=1; }
exit $status
