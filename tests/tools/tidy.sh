#!/usr/bin/env bash
# clang-tidy over several sources read as one, so that the headers, which take most of its time, are read once.
# Where names of the sources clash, each is read alone.
# Usage: tests/tools/tidy.sh COMBINED SOURCE...    (COMBINED: the file to write that includes the sources)
set -euo pipefail

tidy() {
  clang-tidy -p build/release --quiet --header-filter="^$PWD/(cpp|build/tidy)/" \
    --extra-arg=-Wno-unknown-warning-option "$@" # the compile commands are GCC's: it need not know all its warnings
}

combined=$1
shift
mkdir -p "$(dirname "$combined")"
printf "#include \"$PWD/%s\"  // NOLINT(bugprone-suspicious-include)\n" "$@" >"$combined"
status=0
findings=$(tidy "$combined" 2>&1) || status=$?
if [[ $findings == *"[clang-diagnostic-error"* ]]; then
  for source in "$@"; do
    tidy "$source"
  done
  exit
fi
printf '%s\n' "$findings"
exit $status
