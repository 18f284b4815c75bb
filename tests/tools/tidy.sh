#!/usr/bin/env bash
# clang-tidy over several sources read as one, so that the headers, which take most of its time, are read once.
# A source whose names clash with those of one before it waits for the next unit; the last unit may be a single source.
# Usage: tests/tools/tidy.sh COMBINED SOURCE...    (COMBINED: the file to write that includes the sources)
set -euo pipefail

tidy() {
  # The compile commands are GCC's: it need not know all its warnings. A unit has none of its own and gets those of
  # the source whose name is most like its own, which may be a test: hence the folder of the core. What shadows a name of
  # another source of the unit is no finding; GCC has an eye on shadows within each.
  clang-tidy -p build/release --quiet --header-filter="^$PWD/(cpp|build/tidy)/" \
    --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-shadow --extra-arg=-I"$PWD/cpp/src" \
    --extra-arg=-ferror-limit=0 "$@"
}

# The sources in which this unit has errors of compilation. One check, for clang-tidy wants one: this only reads the unit.
clashing() {
  local findings
  findings=$(tidy --checks='-*,readability-duplicate-include' "$1" 2>&1) || true
  grep -F '[clang-diagnostic-error' <<<"$findings" | cut -d: -f1 | sort -u || true
}

combined=$1
shift
mkdir -p "$(dirname "$combined")"
waiting=("$@")
status=0
while [ ${#waiting[@]} -gt 0 ]; do
  unit=("${waiting[@]}")
  waiting=()
  while :; do
    printf "#include \"$PWD/%s\"  // NOLINT(bugprone-suspicious-include)\n" "${unit[@]}" >"$combined"
    [ ${#unit[@]} -gt 1 ] || break
    clashes=$(clashing "$combined")
    [ -n "$clashes" ] || break
    kept=()
    moved=()
    for source in "${unit[@]}"; do
      if grep -qxF "$PWD/$source" <<<"$clashes"; then moved+=("$source"); else kept+=("$source"); fi
    done
    # Errors in all of them or in none (a header): the first one alone says what is wrong.
    if [ ${#kept[@]} -eq 0 ] || [ ${#moved[@]} -eq 0 ]; then
      kept=("${unit[0]}")
      moved=("${unit[@]:1}")
    fi
    waiting+=("${moved[@]}")
    unit=("${kept[@]}")
  done
  tidy "$combined" || status=1
done
exit $status
