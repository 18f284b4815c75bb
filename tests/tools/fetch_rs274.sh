#!/bin/sh
# Puts LinuxCNC's stand-alone interpreter rs274 into .cache/linuxcnc (unpacked Debian packages, nothing of LinuxCNC is
# installed) and prints that folder. Does nothing but print when it is already there.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
target=$root/.cache/linuxcnc

works() {
  [ -x "$1/usr/bin/rs274" ] &&
    ! LD_LIBRARY_PATH=$1/usr/lib:$1/usr/lib/x86_64-linux-gnu ldd "$1/usr/bin/rs274" | grep -q 'not found'
}

if ! works "$target"; then
  # What rs274 links besides LinuxCNC's own libraries; messages go to stderr, stdout is the folder's name.
  "$root/tests/tools/debian_packages.sh" libpython3.11 libtirpc3 libedit2 >&2

  mkdir -p "$root/.cache"
  work=$(mktemp -d "$root/.cache/linuxcnc.XXXXXX")
  trap 'rm -rf "$work"' EXIT
  mkdir "$work/packages" "$work/tree"
  # apt drops its privileges to _apt for a download, which then cannot write here; as root that is no gain.
  fetch() { (cd "$work/packages" && apt-get -o APT::Sandbox::User=root download -qq linuxcnc-uspace libboost-python1.74.0 >&2); }
  if ! fetch; then
    if [ "$(id -u)" -eq 0 ]; then apt-get update -qq >&2; else sudo apt-get update -qq >&2; fi
    fetch
  fi
  for package in "$work"/packages/*.deb; do
    dpkg -x "$package" "$work/tree"
  done
  if ! works "$work/tree"; then
    echo "$0: rs274 still misses shared libraries:" >&2
    LD_LIBRARY_PATH=$work/tree/usr/lib:$work/tree/usr/lib/x86_64-linux-gnu ldd "$work/tree/usr/bin/rs274" |
      grep 'not found' >&2
    exit 1
  fi
  rm -rf "$target"
  mv "$work/tree" "$target"
fi
echo "$target"
