#!/usr/bin/env bash
# Installs what brume is built with, on Debian 12 and Ubuntu 24.04, as root or with sudo.
# Does nothing, quickly, where everything is there.
#
#   tools/setup.sh         what the programs need
#   tools/setup.sh --dev   and what the tests and benchmarks need
set -euo pipefail

packages=(
  g++ cmake ninja-build
  libopenvdb-dev libblosc-dev libboost-iostreams-dev zlib1g-dev
  libembree-dev libtbb-dev
  libopenimageio-dev openimageio-tools libimath-dev libopenexr-dev # its CMake file wants its tools
  libassimp-dev nlohmann-json3-dev libcli11-dev libxxhash-dev libhwy-dev
  libjs-three libjs-chart.js # inlined into the pages of `inspect --html` and `figures`
)
case "${1:-}" in
  "") ;;
  --dev)
    packages+=(libgtest-dev libgmock-dev libbenchmark-dev libnanovdb-dev python3 python3-numpy python3-openimageio ccache
      g++-aarch64-linux-gnu) # to compile the kernels for NEON
    # Pages are looked at in a browser; Ubuntu has none but as a snap, and their tests are skipped there.
    if grep -qx 'ID=debian' /etc/os-release; then packages+=(chromium); fi
    ;;
  -h | --help)
    sed -n '2,6s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
  *)
    echo "error: setup.sh: $1: unknown argument: use --dev or none" >&2
    exit 2
    ;;
esac

is_installed() { [ "$(dpkg-query -W -f='${Status}' "$1" 2>/dev/null)" = "install ok installed" ]; }

if ! command -v dpkg-query >/dev/null; then
  echo "error: setup.sh: this is no Debian or Ubuntu: install what cmake/BrumePackages.cmake lists" >&2
  exit 1
fi

missing=()
for package in "${packages[@]}"; do
  is_installed "$package" || missing+=("$package")
done
[ ${#missing[@]} -eq 0 ] && exit 0

as_root=()
if [ "$(id -u)" -ne 0 ]; then
  command -v sudo >/dev/null || {
    echo "error: setup.sh: not root and no sudo: as root, run: apt-get install ${missing[*]}" >&2
    exit 1
  }
  as_root=(sudo)
fi

echo "Installing ${missing[*]}"
apt_get() {
  "${as_root[@]}" env DEBIAN_FRONTEND=noninteractive apt-get -o DPkg::Lock::Timeout=300 -qq "$@"
}
apt_get update
# Nothing but what they need: recommended packages would bring a desktop's worth.
apt_get install -y --no-install-recommends "${missing[@]}" >/dev/null
