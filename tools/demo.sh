#!/usr/bin/env bash
# From a fresh clone to a picture: installs what is missing, builds, generates the smoky Cornell box,
# bakes its irradiance records and renders it.
#
#   tools/demo.sh           writes out/smoky_cornell.{irc,exr,png}
#   tools/demo.sh --small   the same at a quarter of the size, into out/small/
#
# A second run repeats nothing whose inputs have not changed. BRUME_BUILD_DIR is the folder to build
# in; build/ by default.
set -euo pipefail
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

out=$top/out
smoke_nodes=128
image_px=512
case "${1:-}" in
  "") ;;
  --small)
    out=$top/out/small
    smoke_nodes=48
    image_px=128
    ;;
  -h | --help)
    sed -n '2,9s/^# \{0,1\}//p' "$0"
    exit 0
    ;;
  *) die "demo.sh: $1: unknown argument: use --small or none" ;;
esac

folder=$out/smoky_cornell
scene=$folder/smoky_cornell.json
records=$out/smoky_cornell.irc
image=$out/smoky_cornell.exr
preview=$out/smoky_cornell.png
statistics=$out/smoky_cornell_stats.json

# is_newer FILE INPUT ...: FILE is there, and no INPUT is missing or younger.
is_newer() {
  local file=$1 input
  shift
  [ -f "$file" ] || return 1
  for input in "$@"; do
    [ -e "$input" ] && [ ! "$input" -nt "$file" ] || return 1
  done
}

# Last line: what was done, and in which time.
report=()
done_in() { report+=("$(printf '  %-9s %9s   %s' "$1" "$2" "$3")"); }

mkdir -p "$out"
began=$(now)
start=$(now)
"$top/tools/setup.sh"
done_in setup "$(since "$start")" "packages are there"

start=$(now)
# Tests stay as they are in a folder that has them, and out of a new one.
if [ ! -f "$build/CMakeCache.txt" ]; then
  configure -DBRUME_BUILD_TESTS=OFF -DBRUME_BUILD_BENCHMARKS=OFF
fi
build brume data_gen
brume=$build/bin/brume
data_gen=$build/bin/data_gen
done_in build "$(since "$start")" "$build"

start=$(now)
# The arguments are an input too: kept beside what they made.
arguments="smoky-cornell --resolution $smoke_nodes --size $image_px"
if [ "$(cat "$folder/.made_by" 2>/dev/null)" = "$arguments" ] &&
  is_newer "$folder/.made_by" "$data_gen" "$folder"/{smoky_cornell.json,box.obj,box.mtl,smoke.vdb}; then
  done_in generate - "unchanged: $folder"
else
  # shellcheck disable=SC2086 # One word each.
  "$data_gen" $arguments -o "$folder"
  printf '%s\n' "$arguments" >"$folder/.made_by"
  done_in generate "$(since "$start")" "$folder"
fi
inputs=("$brume" "$folder/.made_by")

start=$(now)
if is_newer "$records" "${inputs[@]}"; then
  done_in bake - "unchanged: $records"
else
  had_records=no
  [ -f "$records" ] && had_records=yes
  status=0
  "$brume" bake "$scene" -o "$records" --cache-mode missing || status=$?
  # 3: records of another scene or another brume, which only "new" may replace.
  if [ "$status" -eq 3 ] && [ "$had_records" = yes ]; then
    say "Baking anew: those records are not of this scene."
    status=0
    "$brume" bake "$scene" -o "$records" --cache-mode new || status=$?
  fi
  [ "$status" -eq 0 ] || exit "$status"
  touch "$records" # Checked now, even where nothing was missing.
  done_in bake "$(since "$start")" "$records"
fi

start=$(now)
if is_newer "$image" "$records" "${inputs[@]}" && is_newer "$preview" "$records" "${inputs[@]}"; then
  done_in render - "unchanged: $image, $preview"
else
  "$brume" render "$scene" -o "$image" --cache "$records" --preview "$preview" --stats "$statistics"
  done_in render "$(since "$start")" "$image, $preview"
fi

say ""
printf '%s\n' "${report[@]}"
say "  all       $(printf '%9s' "$(since "$began")")"
