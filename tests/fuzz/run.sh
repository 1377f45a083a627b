#!/usr/bin/env bash
# Builds the fuzzers and runs them in turn: see usage below.
set -euo pipefail
cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.."

usage() {
  cat <<'USAGE'
usage: tests/fuzz/run.sh SECONDS [TARGET...]
       tests/fuzz/run.sh --until-quiet QUIET_SECONDS [TARGET...]
       tests/fuzz/run.sh --keep [TARGET...]

The first form gives each target (default: all) an equal part of SECONDS. The second runs them in turn, a
minute at a time, until each has found no new edge for QUIET_SECONDS of its own time; it can be stopped at
any time, and the next run resumes there. The third puts the fewest inputs that reach every edge reached so far
into tests/fuzz/corpus, where all runs begin, 64 KiB a target at most.

Inputs that reach new code are kept in build/fuzz/runs/TARGET/corpus and used by later runs. What ends a
parser is left in build/fuzz/runs/TARGET/found: mend it, and put the input into tests/fuzz/findings/TARGET.

Exit status: 0 nothing was found, 1 something was or a fuzzer was ended, 2 wrong usage, 77 clang++ or its libFuzzer is missing.
USAGE
}

readonly build=build/fuzz
readonly fuzzer=$build/bin/catgs-fuzz
readonly kept=tests/fuzz/corpus
readonly kept_bytes=65536 # of one target
found=0

build_fuzzer() {
  if ! printf 'extern "C" int LLVMFuzzerTestOneInput(const char*, long) { return 0; }' |
    clang++ -x c++ - -fsanitize=fuzzer,address -o /dev/null 2>/dev/null; then
    echo "SKIPPED: no clang++ with libFuzzer (Debian: clang libclang-rt-dev)"
    exit 77
  fi
  [[ -f $build/build.ninja ]] || cmake --preset fuzz >/dev/null
  nice ninja -C "$build" ${CATGS_FUZZ_JOBS:+-j "$CATGS_FUZZ_JOBS"} catgs-fuzz
}

# Where runs of a target begin: the seeds of our own writers, and what earlier runs have reached.
write_seeds() {
  local target=$1 work=$build/runs/$1
  mkdir -p "$work/corpus" "$work/found"
  "$fuzzer" "--target=$target" "--write-seeds=$work"
  [[ ! -f $kept/$target.tar.gz ]] || tar -C "$work/seeds" -xzf "$kept/$target.tar.gz"
}

# fuzz TARGET MAX_BYTES SECONDS: one run. `state` of a target: edges, seconds since the last new one,
# inputs tried, seconds altogether.
fuzz() {
  local target=$1 max_bytes=$2 seconds=$3 work=$build/runs/$1
  local edges=0 quiet=0 tried=0 spent=0 status=0 begin=$EPOCHSECONDS newest line now
  local -a inputs=("$work/corpus" "$work/seeds")
  [[ ! -d tests/fuzz/findings/$target ]] || inputs+=("tests/fuzz/findings/$target")
  write_seeds "$target"
  [[ ! -f $work/state ]] || read -r edges quiet tried spent <"$work/state"
  newest=$((begin - quiet))
  while IFS= read -r line; do
    if [[ $line =~ \ cov:\ ([0-9]+)\  ]] && ((BASH_REMATCH[1] > edges)); then
      edges=${BASH_REMATCH[1]} newest=$EPOCHSECONDS
    elif [[ $line =~ number_of_executed_units:\ *([0-9]+) ]]; then
      tried=$((tried + BASH_REMATCH[1]))
    fi
  done < <("$fuzzer" "--target=$target" -max_total_time="$seconds" -max_len="$max_bytes" \
    -len_control=100 -dict="$work/words.dict" -rss_limit_mb=1024 -malloc_limit_mb=512 -timeout=10 \
    -print_final_stats=1 -artifact_prefix="$work/found/" "${inputs[@]}" 2>&1 |
    tee "$work/log")
  wait $! || status=$?
  now=$EPOCHSECONDS
  spent=$((spent + now - begin))
  printf '%d %d %d %d\n' "$edges" $((now - newest)) "$tried" "$spent" >"$work/state"
  printf '%-16s %6d edges  %4d s without a new one  %9d inputs, %6d a second\n' "$target" "$edges" \
    $((now - newest)) "$tried" $((tried / (spent > 0 ? spent : 1)))
  if [[ -n $(ls -A "$work/found") ]]; then
    found=1
    printf '  FOUND, see %s and %s:\n' "$work/log" "$work/found"
    grep -m 3 -E 'ERROR:|runtime error:|broken promise|SUMMARY' "$work/log" | sed 's/^/    /' || true
  elif ((status != 0)); then
    found=1
    printf '  the fuzzer itself ended with status %d, see %s\n' "$status" "$work/log"
  fi
}

# By size, so that gzip, which looks back 32 KiB, sees inputs that are alike together.
pack() {
  find "$1" -type f -printf '%s %f\n' | LC_ALL=C sort -k 1n -k 2 | cut -d ' ' -f 2 |
    tar -C "$1" --mtime=@0 --owner=0 --group=0 --numeric-owner --mode=644 -cf - --files-from=- | gzip -9n
}

# keep TARGET MAX_BYTES: of an archive that is too long the longest inputs are left out.
keep() {
  local target=$1 max_bytes=$2 work=$build/runs/$1 longest
  write_seeds "$target"
  rm -rf "$work/kept"
  mkdir -p "$work/kept" "$kept"
  "$fuzzer" "--target=$target" -set_cover_merge=1 -use_counters=0 -max_len="$max_bytes" -rss_limit_mb=1024 \
    -malloc_limit_mb=512 -timeout=10 "$work/kept" "$work/corpus" "$work/seeds" >"$work/merge.log" 2>&1
  pack "$work/kept" >"$kept/$target.tar.gz"
  while (($(stat -c %s "$kept/$target.tar.gz") > kept_bytes)); do
    longest=$(find "$work/kept" -type f -printf '%s %p\n' | sort -n | tail -1)
    rm "${longest#* }"
    pack "$work/kept" >"$kept/$target.tar.gz"
  done
  printf '%-16s %4d inputs, %6d bytes, of %5d\n' "$target" "$(find "$work/kept" -type f | wc -l)" \
    "$(stat -c %s "$kept/$target.tar.gz")" "$(find "$work/corpus" -type f | wc -l)"
}

# Seconds since the last new edge; nothing for a target that has not run.
quiet_of() { [[ ! -f $build/runs/$1/state ]] || cut -d ' ' -f 2 "$build/runs/$1/state"; }

main() {
  local mode=share seconds=0
  case ${1:-} in
    -h | --help)
      usage
      exit 0
      ;;
    --until-quiet | --keep)
      mode=$1
      shift
      ;;
  esac
  if [[ $mode != --keep ]]; then
    if ! [[ ${1:-} =~ ^[1-9][0-9]*$ ]]; then
      usage >&2
      exit 2
    fi
    seconds=$1
    shift
  fi
  build_fuzzer
  local -A max_bytes=()
  local -a targets=()
  local name bytes
  while read -r name bytes; do
    max_bytes[$name]=$bytes
    (($# > 0)) || targets+=("$name")
  done < <("$fuzzer" --list)
  for name in "$@"; do
    if [[ -z ${max_bytes[$name]:-} ]]; then
      echo "no target '$name'; there are: ${!max_bytes[*]}" >&2
      exit 2
    fi
    targets+=("$name")
  done
  if [[ $mode == --keep ]]; then
    for name in "${targets[@]}"; do keep "$name" "${max_bytes[$name]}"; done
    return
  fi
  if [[ $mode == share ]]; then
    local share=$((seconds / ${#targets[@]}))
    for name in "${targets[@]}"; do fuzz "$name" "${max_bytes[$name]}" $((share > 0 ? share : 1)); done
    return
  fi
  local busy=1
  while ((busy)); do
    busy=0
    for name in "${targets[@]}"; do
      local quiet
      quiet=$(quiet_of "$name")
      ((${quiet:-0} < seconds)) || continue
      busy=1
      fuzz "$name" "${max_bytes[$name]}" 60
    done
  done
}

main "$@"
exit "$found"
