#!/usr/bin/env bash
# clang-tidy over sources and headers of the core, those of one folder read as one, as they are compiled: the headers, which
# take most of the time, are read once a folder. Folders beside each other on all cores.
# Usage: tests/tools/tidy.sh FILE...    with the compile commands of build/release
set -euo pipefail

out=build/tidy
mkdir -p "$out"
rm -f "$out"/*.cpp
for file in "$@"; do
  folder=$(dirname "${file#cpp/}")
  printf '#include "%s/%s"  // NOLINT(bugprone-suspicious-include)\n' "$PWD" "$file" >>"$out/${folder//\//_}.cpp"
done

tidy() {
  # The compile commands are GCC's: it need not know all its warnings. A unit has none of its own and gets those of
  # the source whose name is most like its own, which may be a test: hence the folders of the core.
  clang-tidy -p build/release --quiet --header-filter="^$PWD/(cpp|build/tidy)/" \
    --extra-arg=-Wno-unknown-warning-option --extra-arg=-Wno-unused-command-line-argument --extra-arg=-Wno-ignored-optimization-argument \
    --extra-arg=-isystem"${SUNDIALS_ROOT:-/usr}/include" --extra-arg=-I"$PWD/cpp/src" --extra-arg=-I"$PWD/cpp/include" --extra-arg=-I"$PWD/bindings" "$1"
}
export -f tidy
printf '%s\0' "$out"/*.cpp | xargs -0 -n 1 -P "$(nproc)" bash -c 'tidy "$0"'
