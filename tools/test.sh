#!/usr/bin/env bash
# Installs what is missing, builds, and runs all tests. Arguments go to ctest:
#
#   tools/test.sh                    everything
#   tools/test.sh -R vdb_media       tests by name
#   tools/test.sh -L unit            tests by label
#
# BRUME_BUILD_DIR is the folder to build in; build/ by default.
set -euo pipefail
# shellcheck source=tools/common.sh
source "$(dirname "${BASH_SOURCE[0]}")/common.sh"

"$top/tools/setup.sh" --dev
configure -DBRUME_BUILD_TESTS=ON -DBRUME_BUILD_BENCHMARKS=ON
build all
ctest --test-dir "$build" --parallel "$(cores)" --output-on-failure "$@"
