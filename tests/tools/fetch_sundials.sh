#!/bin/sh
# Puts CVODE's headers and static libraries into .cache/sundials (Debian's libsundials-dev, unpacked); says nothing when
# they are there, or installed, or this is no Debian. To install that package would bring MPI, PETSc, a Fortran compiler
# and some 120 packages more, of which CVODE needs none.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
target=$root/.cache/sundials

if [ -f /usr/include/cvode/cvode.h ] || [ -f "$target/usr/include/cvode/cvode.h" ] || ! command -v apt-get >/dev/null
then
  exit 0
fi
echo "unpacking Debian's libsundials-dev into .cache/sundials"
mkdir -p "$root/.cache"
work=$(mktemp -d "$root/.cache/sundials.XXXXXX")
trap 'rm -rf "$work"' EXIT
# apt drops its privileges to _apt for a download, which then cannot write here; as root that is no gain.
fetch() { (cd "$work" && apt-get -o APT::Sandbox::User=root download -qq libsundials-dev >&2); }
if ! fetch 2>/dev/null; then
  if [ "$(id -u)" -eq 0 ]; then apt-get update -qq >&2; else sudo apt-get update -qq >&2; fi
  fetch
fi
dpkg -x "$work"/libsundials-dev_*.deb "$work/tree"
rm -rf "$target"
mv "$work/tree" "$target"
