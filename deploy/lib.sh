# shellcheck shell=bash disable=SC2034,SC2317  # variables and functions are for those who source this
# What run.sh and test.sh share: distribution, packages, numbered steps, configure and build.
# Sourced, never run. Needs bash 5 and nothing that a minimal Debian lacks: no curl, ss, ip, python.

readonly EXIT_FAILED=1 EXIT_USAGE=2 EXIT_NEEDS_ROOT=3 EXIT_UNSUPPORTED=4 EXIT_PORT_BUSY=5
SOURCE_DIR=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/.." && pwd)
readonly SOURCE_DIR

# Boost is added by detect_distribution: its package carries the version in its name.
build_packages=(
  g++ cmake ninja-build ccache pkg-config git ca-certificates
  libwebsockets-dev libssl-dev libprotobuf-dev protobuf-compiler
  libavcodec-dev libavformat-dev libavutil-dev libturbojpeg0-dev
  libglm-dev libhwy-dev libcli11-dev libtomlplusplus-dev libspdlog-dev libfmt-dev
  nlohmann-json3-dev prometheus-cpp-dev
  libwebp-dev libpng-dev zlib1g-dev libzstd-dev libarchive-dev
)
lan_packages=(openssl qrencode iproute2)
test_packages=(libgtest-dev libgmock-dev python3 shellcheck cppcheck clang-format-14 haproxy universal-ctags)
# What reads deploy/ and docker/: containers without a Docker engine, and the tools of operators.
# runc and kubectl often come from elsewhere, and those conflict with the packages.
deploy_test_packages=(
  podman buildah netavark aardvark-dns iptables catatonit uidmap xz-utils iproute2
  prometheus python3-yaml docker.io docker-compose nginx-light caddy openssl
)
command -v runc >/dev/null || deploy_test_packages+=(runc)

# ---- messages ---------------------------------------------------------------------------------

# fail CODE TEXT...: says what is wrong and what to do, one line per argument, and ends the script.
fail() {
  local code=$1
  shift
  printf '%s\n' "$@" >&2
  exit "$code"
}

now_us() { printf '%s' "${EPOCHREALTIME/[.,]/}"; }

# format_duration MICROSECONDS: "0.4 s", "83 s", "3 min 12 s".
format_duration() {
  local us=$1
  local seconds=$((us / 1000000))
  if ((seconds < 10)); then
    printf '%d.%d s' "$seconds" $((us / 100000 % 10))
  elif ((seconds < 100)); then
    printf '%d s' "$seconds"
  else
    printf '%d min %d s' $((seconds / 60)) $((seconds % 60))
  fi
}

# ---- numbered steps ---------------------------------------------------------------------------

step_number=0
step_count=0
step_log=/dev/null

# steps_begin COUNT LOG: every later step is one line, and its output goes to LOG.
steps_begin() {
  step_count=$1
  step_log=$2
  mkdir -p "$(dirname "$step_log")"
  : >"$step_log"
}

print_step() { printf '[%d/%d] %-62s %s\n' "$step_number" "$step_count" "$1" "$2"; }

groups=()

# start_group LOG COMMAND...: runs it in the background as a process group of its own, the last of
# `groups`, so that Ctrl-C reaches this script alone and stop_groups ends all that it started.
start_group() {
  local log=$1
  shift
  set -m
  # A subshell keeps `set -e` alive inside functions given as the command.
  (
    set -e
    "$@"
  ) >>"$log" 2>&1 &
  groups+=($!)
  set +m
}

# stop_groups SIGNAL: ends the running groups, the youngest first, and waits for each leader.
stop_groups() {
  local i
  for ((i = ${#groups[@]} - 1; i >= 0; i--)); do
    kill -"$1" -- "-${groups[i]}" 2>/dev/null || true
    wait "${groups[i]}" 2>/dev/null || true
  done
  groups=()
}

# Ctrl-C or TERM while a step runs.
interrupted() {
  trap - INT TERM HUP
  stop_groups TERM
  printf '\nStopped.\n'
  exit 130
}
trap interrupted INT TERM HUP
trap 'stop_groups TERM' EXIT

# step TITLE COMMAND...: runs the command with its output in the log. TITLE is printed with the
# time it took; on a terminal a counter runs meanwhile, elsewhere a line says every half minute that
# it still runs. A failure shows the end of the log.
step() {
  local title=$1
  shift
  step_number=$((step_number + 1))
  local begin_us status=0
  begin_us=$(now_us)
  printf '\n==== [%d/%d] %s\n' "$step_number" "$step_count" "$title" >>"$step_log"
  start_group "$step_log" "$@"
  local job=${groups[-1]}
  show_running "$job" "$title" "$begin_us"
  wait "$job" || status=$?
  unset 'groups[-1]'
  if ((status != 0)); then
    printf '[%d/%d] %s: FAILED (status %d)\n' "$step_number" "$step_count" "$title" "$status" >&2
    tac "$step_log" | sed '/^==== /q' | head -n 20 | tac | sed 's/^/    /' >&2
    fail "$EXIT_FAILED" "The whole log: $step_log"
  fi
  print_step "$title" "$(format_duration $(($(now_us) - begin_us)))"
}

# step_done TITLE: a step that found nothing to do.
step_done() {
  step_number=$((step_number + 1))
  printf '\n==== [%d/%d] %s\n' "$step_number" "$step_count" "$1" >>"$step_log"
  print_step "$1" "$(format_duration 0)"
}

seconds_between_lines=30

# Tells the time and, when the log ends in one, ninja's count: in one line of a terminal that it
# rewrites twice a second, in a line of its own now and then where that is no terminal.
show_running() {
  local job=$1 title=$2 begin_us=$3 progress line next_us
  next_us=$((begin_us + seconds_between_lines * 1000000))
  while kill -0 "$job" 2>/dev/null; do
    sleep 0.2
    [[ -t 1 ]] || (($(now_us) >= next_us)) || continue
    next_us=$((next_us + seconds_between_lines * 1000000))
    progress=$(tail -c 400 "$step_log" | grep -aoE '^\[[0-9]+/[0-9]+\]' | tail -n 1 || true)
    printf -v line '[%d/%d] %-62s %s %s' "$step_number" "$step_count" "$title" \
      "$(format_duration $(($(now_us) - begin_us)))" "$progress"
    if [[ -t 1 ]]; then printf '\r\033[K%s' "$line"; else printf '%s …\n' "${line% }"; fi
  done
  [[ ! -t 1 ]] || printf '\r\033[K'
}

# ---- system -----------------------------------------------------------------------------------

distribution=""

# Sets `distribution` and completes the package lists, or ends with the way that works elsewhere.
detect_distribution() {
  local os_release=${CATGS_OS_RELEASE:-/etc/os-release}
  local id="" version=""
  if [[ -r $os_release ]]; then
    # shellcheck disable=SC1090  # the system's file, in its own subshell
    id=$(. "$os_release" && printf '%s' "${ID:-}")
    # shellcheck disable=SC1090
    version=$(. "$os_release" && printf '%s' "${VERSION_ID:-}")
  fi
  distribution="${id:-unknown} ${version:-}"
  case "$distribution" in
    "debian 12")
      command -v kubectl >/dev/null || deploy_test_packages+=(kubernetes-client)  # not in Ubuntu
      # Not the default 1.74, whose Asio coroutines break under clang.
      build_packages+=(libboost1.81-dev)
      test_packages+=(libboost-url1.81-dev chromium firefox-esr)
      ;;
    "ubuntu 24.04")
      # Ubuntu's chromium package is a snap, which no container can install; a browser that is
      # already there is used, otherwise the browser tests are skipped with that reason.
      build_packages+=(libboost1.83-dev)
      test_packages+=(libboost-url1.83-dev)
      ;;
    *)
      fail "$EXIT_UNSUPPORTED" \
        "This is ${distribution}; the scripts know Debian 12 and Ubuntu 24.04." \
        "Elsewhere, use a Debian container (Docker or podman, on Linux):" \
        "  docker run -it --rm --network host -v \"$SOURCE_DIR:/catgs\" -w /catgs debian:12 ./deploy/${0##*/}"
      ;;
  esac
  if ! have_node; then
    build_packages+=(nodejs npm)
  fi
}

# Node from elsewhere (nodesource, nvm) serves as well, and its package conflicts with Debian's npm.
have_node() {
  local version
  command -v npm >/dev/null && version=$(node --version 2>/dev/null) || return 1
  version=${version#v}
  ((${version%%.*} >= 18))
}

# missing_packages NAME...: prints those that are not installed, one per line.
missing_packages() {
  local installed name
  installed=$(dpkg-query -W -f '${db:Status-Status} ${Package}\n' "$@" 2>/dev/null || true)
  for name in "$@"; do
    grep -qxF "installed $name" <<<"$installed" || printf '%s\n' "$name"
  done
}

# ensure_packages NAME...: one step. Lists what it installs before it does so; nothing is ever
# removed for it. Without root and without sudo it prints the line to run and exits 3.
ensure_packages() {
  local -a missing root_command=()
  mapfile -t missing < <(missing_packages "$@")
  if ((${#missing[@]} == 0)); then
    step_done "Packages: all $# present"
    return
  fi
  if (($(id -u) != 0)); then
    if command -v sudo >/dev/null && { sudo -n true 2>/dev/null || [[ -t 0 ]]; }; then
      root_command=(sudo)
    else
      fail "$EXIT_NEEDS_ROOT" "${#missing[@]} packages are missing, and installing them needs root. Run this once:" \
        "  apt-get update && apt-get install --no-install-recommends ${missing[*]}"
    fi
  fi
  echo "To be installed with apt-get:"
  fold -s -w 96 <<<"${missing[*]}" | sed 's/^/    /'
  # The password prompt belongs here, not in the middle of a running counter.
  if (($(id -u) != 0)); then
    sudo -v
  fi
  step "Install ${#missing[@]} packages" install_packages "${missing[@]}"
}

# install_packages NAME...: with the root_command of ensure_packages.
install_packages() {
  local -a apt=("${root_command[@]}" env DEBIAN_FRONTEND=noninteractive
    apt-get -o DPkg::Lock::Timeout=120 -o Dpkg::Use-Pty=0)
  "${apt[@]}" update
  "${apt[@]}" install -y --no-remove --no-install-recommends "$@"
}

# ---- GPU --------------------------------------------------------------------------------------

gpu_name=""
nvcc_path=""
cuda_choice=OFF
cuda_note=""

find_gpu_and_nvcc() {
  gpu_name=$(nvidia-smi --query-gpu=name --format=csv,noheader 2>/dev/null | head -n 1 || true)
  nvcc_path=$(command -v nvcc || true)
  local toolkit_nvcc=${CUDA_HOME:-/usr/local/cuda}/bin/nvcc
  if [[ -z $nvcc_path && -x $toolkit_nvcc ]]; then
    nvcc_path=$toolkit_nvcc
  fi
}

# Decides whether the CUDA parts are built, and says why in `cuda_note`.
choose_cuda() {
  find_gpu_and_nvcc
  if [[ -z $gpu_name ]]; then
    cuda_note="no NVIDIA GPU"
    if grep -qsx 0x10de /sys/bus/pci/devices/*/vendor; then
      cuda_note="an NVIDIA device without a working driver (nvidia-smi fails)"
    fi
  elif [[ $(nvidia-smi --query-gpu=compute_cap --format=csv,noheader | head -n 1) == [1-7].* ]]; then
    cuda_note="$gpu_name, which is older than the CUDA core asks for (compute capability 8.0)"
  elif [[ -z $nvcc_path ]]; then
    cuda_note="$gpu_name, but no nvcc"
  else
    cuda_choice=ON
    cuda_note="$gpu_name"
  fi
}

# ---- build ------------------------------------------------------------------------------------

# One job per core, but no more than memory carries: a heavy C++ file takes about 1.5 GB.
build_jobs() {
  local cores memory_kb jobs
  cores=$(nproc)
  memory_kb=$(awk '/^MemAvailable:/ { print $2 }' /proc/meminfo)
  jobs=$((memory_kb / 1500000))
  ((jobs < cores)) || jobs=$cores
  ((jobs > 0)) || jobs=1
  printf '%d' "$jobs"
}

# configure_build PRESET [CMAKE_ARGUMENT...]: skipped when the folder was configured with these very
# arguments; ninja itself re-runs CMake when a CMakeLists.txt changed.
configure_build() {
  local preset=$1
  shift
  local preset_dir=$SOURCE_DIR/build/$preset
  local stamp=$preset_dir/.configured-with wanted="$SOURCE_DIR $preset $*"
  if [[ -f $preset_dir/build.ninja && -f $stamp && $(<"$stamp") == "$wanted" ]]; then
    step_done "Configure: unchanged"
    return
  fi
  step "Configure with CMake (build/$preset)" cmake -S "$SOURCE_DIR" --preset "$preset" "$@"
  printf '%s' "$wanted" >"$stamp"
}

# build_all PRESET TITLE: everything that the preset's configuration holds.
build_all() {
  step "$2" ninja -C "$SOURCE_DIR/build/$1" -j "$(build_jobs)"
}

# lock_build PRESET: one script at a time builds in build/PRESET of this clone; another one says so
# and waits. unlock_build ends the wait.
lock_build() {
  local file=$SOURCE_DIR/build/$1/.lock
  mkdir -p "${file%/*}"
  exec {build_lock}>>"$file"
  flock -n "$build_lock" && return
  echo "Another script builds in ${file%/*}: waiting for it (Ctrl-C stops waiting)."
  flock "$build_lock"
}

unlock_build() { exec {build_lock}>&-; }
