#!/usr/bin/env bash
# usage: check_preset.sh PRESET: configures, builds and tests with its settings.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."
# The settings of an outer CTest run are not meant for the one started here.
unset CTEST_PARALLEL_LEVEL CTEST_OUTPUT_ON_FAILURE
cmake --preset "$1"
cmake --build --preset "$1"
ctest --preset "$1" --parallel "$(nproc)" --no-tests=error
