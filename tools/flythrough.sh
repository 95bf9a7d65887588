#!/usr/bin/env bash
# A flight of a camera through the smoky Cornell box: one bake, a frame for each named camera from the same
# records, path-traced references, and how much of what changes from frame to frame is error.
#
#   tools/flythrough.sh                      24 frames of 128 x 128 pixels, into out/flythrough/
#   tools/flythrough.sh --frames 6 --size 64 --reference-spp 32
#   tools/flythrough.sh --own-caches         also with a cache of its own, and its own seed, for each frame
#
# Prints the cost of each frame and `brume flicker` (docs/flicker.md). What is there already is not done
# again. BRUME_BUILD_DIR is the folder to build in; build/ by default. THREADS is passed on as -t.
set -euo pipefail
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

frames=24
size_px=128
reference_spp=128
own_caches=no
while [ $# -gt 0 ]; do
  case "$1" in
    --frames) frames=$2 && shift ;;
    --size) size_px=$2 && shift ;;
    --reference-spp) reference_spp=$2 && shift ;;
    --own-caches) own_caches=yes ;;
    -h | --help)
      sed -n '2,11s/^# \{0,1\}//p' "$0"
      exit 0
      ;;
    *) die "flythrough.sh: $1: unknown argument: see --help" ;;
  esac
  shift
done

out=$top/out/flythrough/${frames}x$size_px
scene=$out/scene/smoky_cornell.json
records=$out/flight.irc
if [ ! -x "$build/bin/brume" ] || [ ! -x "$build/bin/data_gen" ]; then
  [ -f "$build/CMakeCache.txt" ] || configure -DBRUME_BUILD_TESTS=OFF -DBRUME_BUILD_BENCHMARKS=OFF
  build brume data_gen
fi
brume() { "$build/bin/brume" "$@" -t "${THREADS:-0}" -q --progress none; }

mkdir -p "$out"
[ -f "$scene" ] ||
  "$build/bin/data_gen" smoky-cornell --resolution 64 --size "$size_px" --flight "$frames" -o "$out/scene" >/dev/null
names=()
for ((i = 0; i < frames; ++i)); do names+=("$(printf 'f%02d' "$i")"); done

# number FILE KEY: of the statistics in FILE, anywhere in it.
number() { sed -n "s/.*\"$2\": \([-0-9.e+]*\).*/\1/p" "$1" | head -n 1; }
# render_all PREFIX OPTIONS ...: one frame a camera.
render_all() {
  local prefix=$1 name
  shift
  for name in "${names[@]}"; do
    [ -f "$out/$prefix.$name.exr" ] && continue
    brume render "$scene" --camera "$name" -o "$out/$prefix.$name.exr" --stats "$out/$prefix.$name.json" "$@"
  done
}
files_of() { for name in "${names[@]}"; do printf '%s\n' "$out/$1.$name.exr"; done; }

if [ ! -f "$records" ]; then
  brume bake "$scene" -o "$records" --views "$(IFS=,; echo "${names[*]}")" --stats "$out/bake.json"
fi
render_all cached --cache "$records" --cache-mode read

say "$(number "$out/bake.json" records) records for $frames cameras of $size_px x $size_px pixels, baked in $(number "$out/bake.json" bake) s"
say ""
say "frame    seconds   of which render   gathers where no record answers"
for name in "${names[@]}"; do
  file=$out/cached.$name.json
  printf '%-5s %10.2f %17.2f %33d\n' "$name" "$(number "$file" total)" "$(number "$file" render)" \
    "$(number "$file" fallback_gathers)"
done
awk -v bake="$(number "$out/bake.json" bake)" -v n="$frames" '{ sum += $1 } END {
  printf "mean  %10.2f, and %.2f of the bake\n", sum / n, bake / n }' \
  <(for name in "${names[@]}"; do number "$out/cached.$name.json" total; done)

path=(--integrator path --transport cached --spp "$reference_spp")
render_all reference "${path[@]}" --seed 1001
render_all second "${path[@]}" --seed 2002
mapfile -t cached < <(files_of cached)
mapfile -t reference < <(files_of reference)
mapfile -t second < <(files_of second)
say ""
say "One cache for all frames:"
brume flicker "${cached[@]}" --reference "${reference[@]}" --second-reference "${second[@]}"
say ""
say "The reference itself, of $reference_spp samples a pixel, against another of its kind:"
brume flicker "${reference[@]}" --reference "${second[@]}" | tail -n 1

if [ "$own_caches" = yes ]; then
  for ((i = 0; i < frames; ++i)); do
    [ -f "$out/own.${names[i]}.exr" ] && continue
    brume render "$scene" --camera "${names[i]}" -o "$out/own.${names[i]}.exr" --seed $((100 + i))
  done
  mapfile -t own < <(files_of own)
  say ""
  say "A cache of its own for each frame:"
  brume flicker "${own[@]}" --reference "${reference[@]}" --second-reference "${second[@]}" | tail -n 1
fi
