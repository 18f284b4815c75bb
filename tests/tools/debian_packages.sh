#!/bin/sh
# Installs the named Debian packages that are not installed yet; says nothing when there is nothing to do.
# usage: debian_packages.sh package...
set -eu

if ! command -v dpkg-query >/dev/null; then
  echo "$0: no dpkg here; please see to these packages yourself: $*" >&2
  exit 0
fi

missing=
for package in "$@"; do
  # shellcheck disable=SC2016  # the dollar belongs to dpkg-query
  status=$(dpkg-query --show --showformat='${db:Status-Status}' "$package" 2>/dev/null || true)
  [ "$status" = installed ] || missing="$missing $package"
done
[ -n "$missing" ] || exit 0

as_root=
if [ "$(id -u)" -ne 0 ]; then
  if ! command -v sudo >/dev/null; then
    echo "$0: neither root nor sudo; please run: apt-get install$missing" >&2
    exit 1
  fi
  as_root=sudo
fi
echo "installing Debian packages:$missing"
$as_root apt-get update -qq
# shellcheck disable=SC2086  # a list of words
$as_root env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends $missing
