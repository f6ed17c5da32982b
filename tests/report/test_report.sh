#!/bin/sh
# The report in a browser: test_report.sh APSM FOLDER, with playwright-core in FOLDER.  Exit status 77,
# skipped, if scripts/setup-browser could not install what it needs.
set -u
apsm=$1 folder=$2
here=$(cd "$(dirname "$0")" && pwd)
scripts/setup-browser "$folder" || exit 77
for name in "${CHROMIUM:-}" chromium chromium-browser google-chrome; do
    [ -n "$name" ] && browser=$(command -v "$name") && break
done
# Node looks for packages beside the program.
cp "$here"/*.mjs "$folder" || exit 1
exec node "$folder/test_report.mjs" "$apsm" "$browser"
