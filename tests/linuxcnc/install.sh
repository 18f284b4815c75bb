#!/bin/sh
# What the tests need: LinuxCNC, a user that may run it (it refuses root), the component built and installed. Prints the
# command that runs the rest as that user.
set -eu
root=$(cd "$(dirname "$0")/../.." && pwd)
as_root=
[ "$(id -u)" -eq 0 ] || as_root=sudo
"$root/tests/tools/debian_packages.sh" g++ cmake ninja-build libeigen3-dev libfmt-dev >&2
"$root/tests/tools/debian_packages.sh" linuxcnc-uspace linuxcnc-uspace-dev >&2
cmake -S "$root/integrations/linuxcnc" -B "$root/build/linuxcnc" -G Ninja >&2
cmake --build "$root/build/linuxcnc" >&2
$as_root cmake --install "$root/build/linuxcnc" >&2
if [ "$(id -u)" -eq 0 ]; then
  id shapegcode-linuxcnc >/dev/null 2>&1 || useradd --create-home shapegcode-linuxcnc >&2
  echo "runuser -u shapegcode-linuxcnc -- env HOME=/home/shapegcode-linuxcnc"
else
  echo env
fi
