#!/usr/bin/env bash
# Measures what brume promises about cost and prints one table: each figure, its bar, and whether it is met
# or how far off. Under 20 minutes on two cores, once built. The source of README's figures.
#
#   tools/bench.sh                      # all parts; out/bench/bench.json holds the table
#   tools/bench.sh --only marches       # races, box, drafts, marches, gathers, gradients, threads
#   tools/bench.sh --make-references    # path-traces the references again (half an hour)
#
# Needs python3-numpy and python3-openimageio (tools/setup.sh --dev), and shared data beside the repository for
# some parts, which are left out with a line where it is absent.
set -euo pipefail
. "$(dirname "${BASH_SOURCE[0]}")/common.sh"

configure -DBRUME_BUILD_BENCHMARKS=ON >/dev/null
build brume data_gen marcher_bench gather_bench gradient_cost
# The system's own Python, whose packages those are.
exec /usr/bin/python3 "$top/tests/bench/bench.py" "$build" "$top/../shared" "$top/out/bench" "$@"
