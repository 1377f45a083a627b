#!/usr/bin/env bash
# Proves deploy/run.sh and deploy/test.sh on a machine that has nothing: see usage below.
set -euo pipefail
# shellcheck source=tests/deploy/containers.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/containers.sh"

usage() {
  cat <<'USAGE'
usage: tests/deploy/fresh_start.sh [debian | ubuntu] [test.sh options]

Makes a minimal Debian 12 (or Ubuntu 24.04) root with debootstrap in a temporary folder, clones
this repository's HEAD into it, and there, in namespaces of its own,
  1. runs run.sh, fetches the page and /healthz, and stops it,
  2. starts it again without any network,
  3. runs test.sh with the given options (default --quick).
Nothing stays behind but the downloaded packages, in ${XDG_CACHE_HOME:-~/.cache}/catgs-debs.
Needs root and debootstrap, otherwise it says so and exits 77.
Times are printed, and judged by the reader.
USAGE
}

readonly PORT=8173
system=debian
test_options=(--quick)

# ---- outside: the root file system -------------------------------------------------------------

make_root() {
  local root=$1 cache=$2
  mkdir -p "$cache/archives/partial"
  make_system "$system" "$root" "$cache/debootstrap"
  if [[ $system == ubuntu ]]; then
    sed -n 's/ noble / noble-updates /p' "$root/etc/apt/sources.list" >"$root.updates"
    cat "$root.updates" >>"$root/etc/apt/sources.list"
  fi
  cp /etc/resolv.conf "$root/etc/resolv.conf"
  git clone --quiet --no-local "$source_dir" "$root/root/catgs"
}

# The environment inside: nothing of ours, except the way to the network that this machine needs.
write_environment() {
  local root=$1 name
  {
    echo "export HOME=/root PATH=/usr/sbin:/usr/bin:/sbin:/bin TERM=dumb"
    for name in http_proxy https_proxy no_proxy; do
      [[ -z ${!name:-} ]] || printf 'export %s=%q\n' "$name" "${!name}"
    done
    if [[ -r ${NODE_EXTRA_CA_CERTS:-} ]]; then
      cp "$NODE_EXTRA_CA_CERTS" "$root/root/extra_ca.crt"
      echo "export NODE_EXTRA_CA_CERTS=/root/extra_ca.crt"
    fi
  } >"$root/root/environment"
}

# ---- inside: run by the namespaced copy of this script -----------------------------------------

inside_command() { printf 'source /root/environment && cd /root/catgs && %s' "$1"; }

enter() { chroot "$1" /bin/bash -c "$(inside_command "$2")"; }

mount_root() {
  local root=$1 cache=$2
  mount -t proc proc "$root/proc"
  mount --bind -o ro /sys "$root/sys"
  mkdir -p "$root/dev/shm" "$root/dev/pts"
  mount -t tmpfs -o size=1g shm "$root/dev/shm"
  mount -t devpts -o newinstance,ptmxmode=0666 devpts "$root/dev/pts"
  mount --bind "$cache/archives" "$root/var/cache/apt/archives"
}

# http_body PATH: the status line and body that the server answers, without any tool.
http_body() {
  local reply
  exec {reply}<>"/dev/tcp/127.0.0.1/$PORT" || return 1
  printf 'GET %s HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n' "$1" >&"$reply"
  timeout 10 cat <&"$reply"
  exec {reply}>&-
}

# Starts run.sh, checks what it serves, and ends it.
check_run() {
  local root=$1 title=$2 output=$1/root/run.out begin=$SECONDS reply
  : >"$output"
  chroot "$root" /bin/bash -c "$(inside_command "exec ./deploy/run.sh --port $PORT")" \
    >"$output" 2>&1 &
  local runner=$!
  until grep -q 'stop *Ctrl-C' "$output"; do
    if ! kill -0 "$runner" 2>/dev/null; then
      cat "$output"
      say "$title: run.sh ended before it served"
      return 1
    fi
    sleep 0.2
  done
  say "$title: serving after $((SECONDS - begin)) s"
  cat "$output"
  reply=$(http_body /healthz)
  [[ $reply == "HTTP/1.1 200 "* ]] || { say "$title: /healthz says $reply"; return 1; }
  reply=$(http_body /)
  [[ ${reply,,} == *"<!doctype html"* ]] || { say "$title: / is not the page"; return 1; }
  kill -TERM "$runner"
  wait "$runner" || { say "$title: run.sh did not end as asked"; return 1; }
  if http_body /healthz >/dev/null 2>&1; then
    say "$title: something still listens after the stop"
    return 1
  fi
}

inside() {
  local root=$1 cache=$2
  mount_root "$root" "$cache"
  check_run "$root" "first start"
  unshare --net "$0" --offline "$root"
  local begin=$SECONDS
  enter "$root" "./deploy/test.sh ${test_options[*]}"
  say "test.sh ${test_options[*]}: $((SECONDS - begin)) s"
}

# ---- entry -------------------------------------------------------------------------------------

main() {
  case ${1:-} in
    -h | --help) usage && exit 0 ;;
    --inside)
      local root=$2 cache=$3
      shift 3
      test_options=("$@")
      inside "$root" "$cache"
      return
      ;;
    --offline)
      ip link set lo up
      check_run "$2" "second start, no network"
      return
      ;;
    debian | ubuntu)
      system=$1
      shift
      ;;
  esac
  if (($# > 0)); then
    test_options=("$@")
  fi
  require_tools debootstrap
  require_namespaces

  local cache=${XDG_CACHE_HOME:-$HOME/.cache}/catgs-debs/$system root
  root=$(mktemp -d)
  # shellcheck disable=SC2064  # the folder of now, not of then
  trap "rm -rf --one-file-system '$root' '$root.log'" EXIT
  chmod 755 "$root"
  make_root "$root" "$cache"
  write_environment "$root"
  say "a minimal $system with a clone of $(git -C "$source_dir" rev-parse --short HEAD)"
  unshare --mount --pid --fork --kill-child "$0" --inside "$root" "$cache" "${test_options[@]}"
}

main "$@"
