#!/usr/bin/env bash
# usage: check_preset.sh PRESET: configures, builds and runs its unit and integration tests.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."
# The settings of an outer CTest run are not meant for the one started here.
unset CTEST_PARALLEL_LEVEL CTEST_OUTPUT_ON_FAILURE
cmake --preset "$1"
cmake --build "build/$1"
ctest --test-dir "build/$1" --parallel "$(nproc)" --output-on-failure \
  --no-tests=error --label-regex '^(unit|integration)$'
