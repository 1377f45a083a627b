#!/usr/bin/env bash
# Builds everything with its tests and runs them under one CTest summary: see usage below.
# shellcheck source-path=SCRIPTDIR
set -euo pipefail
source "$(dirname -- "${BASH_SOURCE[0]}")/lib.sh"

usage() {
  cat <<'USAGE'
usage: deploy/test.sh [--quick | --full] [--log FILE]

Installs what the build and the tests need, builds, and runs the tests. A test that fails is tried once
more. One that passes so twice within a week counts as failed: ~/.cache/catgs/unsteady-tests.json has
the names. Browser tests count by group.

  --quick      unit, integration and lint tests only (minutes, once built)
  (default)    also the load and browser tests
  --full       also the sanitizer builds, clang-tidy over all files, a start from nothing in a fresh
               Debian, images, and a fleet of containers, by podman and by Docker
  --log FILE   the full log (default build/release/test.log)
  -h, --help   this text

Exit status: 0 all tests passed, 1 a step or a test failed, 2 wrong usage, 3 packages are missing
and installing them needs root, 4 not Debian 12 or Ubuntu 24.04.
USAGE
}

readonly build_dir=$SOURCE_DIR/build/release
log=$build_dir/test.log
selection=()
full=0

parse_arguments() {
  while (($# > 0)); do
    case $1 in
      --quick) selection=(--label-regex '^(unit|integration|lint)$') ;;
      --full)
        selection=(--build-config Full)
        full=1
        ;;
      --log)
        (($# > 1)) || fail "$EXIT_USAGE" "--log needs a value. See --help."
        log=$2
        shift
        ;;
      -h | --help)
        usage
        exit 0
        ;;
      *) fail "$EXIT_USAGE" "Unknown argument: $1. See --help." ;;
    esac
    shift
  done
}

# The step itself always succeeds: the report below says what failed, and sets the exit status.
# A test that fails gets a second try; the report names it.
run_tests() {
  ctest --test-dir "$build_dir" --parallel "$(nproc)" --output-on-failure --no-tests=error \
    --repeat until-pass:2 --output-junit "$build_dir/tests.xml" "${selection[@]}" || true
}

main() {
  parse_arguments "$@"
  detect_distribution
  if ((full)); then
    test_packages+=(clang clang-tidy-14 libclang-rt-dev debootstrap "${deploy_test_packages[@]}")
  fi
  steps_begin 4 "$log"
  ensure_packages "${build_packages[@]}" "${test_packages[@]}"
  # Where nvcc is, the CUDA core must compile: for the GPU that is there, else for one generation.
  # Its tests are skipped without a GPU.
  find_gpu_and_nvcc
  local -a cuda_options=(-DCATGS_CUDA=OFF)
  if [[ -n $nvcc_path ]]; then
    local generation=90
    [[ -z $gpu_name ]] || generation=native
    cuda_options=(-DCATGS_CUDA=ON "-DCMAKE_CUDA_COMPILER=$nvcc_path"
      "-DCMAKE_CUDA_ARCHITECTURES=$generation")
  fi
  lock_build release
  configure_build release "${cuda_options[@]}"
  build_all release "Build with tests"
  rm -rf "$build_dir/tests.xml" "$build_dir/tests/suites"
  step "Test" run_tests
  python3 -B "$SOURCE_DIR/tests/report.py" "$build_dir/tests.xml" "$build_dir/tests/suites" "$log"
}

main "$@"
