# shellcheck shell=bash
# What the other scripts share. Sourced, never run.

top=$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)
build=${BRUME_BUILD_DIR:-$top/build}

say() { printf '%s\n' "$*"; }
die() {
  printf 'error: %s\n' "$*" >&2
  exit 1
}

# CPUs this process may use.
cores() { nproc; }

# Seconds since the epoch with a fraction, and the difference of two of them.
now() { date +%s.%N; }
since() { awk -v a="$1" -v b="$(now)" 'BEGIN { printf "%.1f s", b - a }'; }

# configure [CMake options]: a new build folder gets Ninja and ccache where they are there; one that
# exists keeps its generator.
configure() {
  local args=()
  if [ ! -f "$build/CMakeCache.txt" ]; then
    args+=(-DCMAKE_BUILD_TYPE=Release)
    command -v ninja >/dev/null && args+=(-G Ninja)
    command -v ccache >/dev/null && args+=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache)
  fi
  cmake -S "$top" -B "$build" "${args[@]}" "$@"
}

# build TARGET ...
build() {
  # A compiler that reads OpenVDB needs well over a gigabyte.
  local jobs memory_kb
  memory_kb=$(awk '/MemAvailable/ { print $2 }' /proc/meminfo)
  jobs=$((memory_kb / 1800000))
  [ "$jobs" -lt 1 ] && jobs=1
  [ "$jobs" -gt "$(cores)" ] && jobs=$(cores)
  cmake --build "$build" --parallel "$jobs" --target "$@"
}
