#!/bin/bash
# What a wheel is built with, for cibuildwheel: Eigen and fmt from the system's packages, CVODE from its release, static.
# Not tried yet; `make wheel` takes all three from Debian.
set -euo pipefail

sundials=6.4.1
if command -v dnf >/dev/null; then
  dnf install -y epel-release
  dnf install -y eigen3-devel fmt-devel cmake curl
elif command -v brew >/dev/null; then
  brew install eigen fmt cmake
fi
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
curl -fsSL "https://github.com/LLNL/sundials/releases/download/v$sundials/cvode-$sundials.tar.gz" | tar -xz -C "$work"
cmake -S "$work/cvode-$sundials" -B "$work/build" -D CMAKE_BUILD_TYPE=Release -D BUILD_SHARED_LIBS=OFF \
  -D CMAKE_POSITION_INDEPENDENT_CODE=ON -D EXAMPLES_ENABLE_C=OFF -D CMAKE_INSTALL_PREFIX=/usr/local -D CMAKE_INSTALL_LIBDIR=lib
cmake --build "$work/build" --target install --parallel
