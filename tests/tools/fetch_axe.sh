#!/bin/sh
# Puts axe-core, which looks for barriers on a page, into .cache/axe by npm and prints its script. Does nothing but print
# when it is already there in the version of package-lock.json.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
target=$root/.cache/axe

if ! cmp -s "$root/tests/tools/axe/package-lock.json" "$target/package-lock.json"; then
  command -v npm >/dev/null || "$root/tests/tools/debian_packages.sh" npm >&2
  mkdir -p "$root/.cache"
  work=$(mktemp -d "$root/.cache/axe.XXXXXX")
  trap 'rm -rf "$work"' EXIT
  cp "$root/tests/tools/axe/package.json" "$root/tests/tools/axe/package-lock.json" "$work"
  (cd "$work" && npm ci --ignore-scripts --no-audit --no-fund --loglevel=error >&2)
  cp "$root/tests/tools/axe/package-lock.json" "$work"
  chmod 755 "$work"
  rm -rf "$target"
  mv "$work" "$target"
fi
echo "$target/node_modules/axe-core/axe.min.js"
