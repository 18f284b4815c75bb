#!/usr/bin/env bash
# clang-tidy over sources and headers of the core, those of one folder read as one, as they are compiled: the headers, which
# take most of the time, are read once a folder. Folders beside each other on all cores.
# Usage: tests/tools/tidy.sh FILE...
set -euo pipefail

out=build/tidy
mkdir -p "$out"
rm -f "$out"/*.cpp
for file in "$@"; do
  folder=$(dirname "${file#cpp/}")
  printf '#include "%s/%s"  // NOLINT(bugprone-suspicious-include)\n' "$PWD" "$file" >>"$out/${folder//\//_}.cpp"
done

tidy() {
  # The system's own folder named once more would hide the compiler's headers.
  local sundials=()
  [ "${SUNDIALS_ROOT:-/usr}" = /usr ] || sundials=(-isystem "$SUNDIALS_ROOT/include")
  clang-tidy --quiet --header-filter="^$PWD/(cpp|build/tidy)/" "$1" -- -std=c++20 -Wall -Wextra \
    -I"$PWD/cpp/src" -I"$PWD/cpp/include" -isystem /usr/include/eigen3 "${sundials[@]}"
}
export -f tidy
printf '%s\0' "$out"/*.cpp | xargs -0 -n 1 -P "$(nproc)" bash -c 'tidy "$0"'
