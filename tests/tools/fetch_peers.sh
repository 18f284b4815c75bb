#!/bin/sh
# Puts the motion planners that peers.py compares with into .cache/peers, a Python environment of its own (their
# requirements would not go with ours), and prints its Python. Does nothing but print when it is already there.
set -eu

root=$(cd "$(dirname "$0")/../.." && pwd)
target=$root/.cache/peers
mark=$target/.done-$(cksum <"$root/pyproject.toml" | tr ' ' '-')

if [ ! -e "$mark" ]; then
  "$root/tests/tools/debian_packages.sh" gcc python3-venv libusb-dev >&2  # Klipper's package builds a tool for USB hubs
  "${PYTHON:-python3}" -m venv "$target"
  # One by one: what one of them lacks does not hold up the other.
  "${PYTHON:-python3}" "$root/tests/tools/requirements.py" peers | while read -r requirement; do
    "$target/bin/python" -m pip --disable-pip-version-check -q install "$requirement" >&2 ||
      echo "$0: $requirement cannot be installed" >&2
  done
  touch "$mark"
fi
echo "$target/bin/python"
