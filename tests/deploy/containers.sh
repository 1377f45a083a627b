# shellcheck shell=bash
# For the tests beside this file: minimal systems by debootstrap, and containers without a Docker
# engine (podman and buildah with a storage of their own, and a Debian base under the name that the
# Dockerfile asks for). Sourced, never run.

readonly EXIT_SKIPPED=77
source_dir=$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)
readonly source_dir
readonly base_image=docker.io/library/debian:bookworm-slim
cache=${XDG_CACHE_HOME:-$HOME/.cache}/catgs-containers
work=""

skip() {
  echo "SKIPPED: $1"
  exit "$EXIT_SKIPPED"
}

say() { printf '%s  %s\n' "$(date +%T)" "$*"; }

die() {
  say "FAILED: $*"
  exit 1
}

now_ms() { printf '%d' $((${EPOCHREALTIME/[.,]/} / 1000)); }

# require_tools NAME...: skips the whole test where one is missing.
require_tools() {
  local tool
  ((EUID == 0)) || skip "needs root"
  for tool in "$@"; do
    command -v "$tool" >/dev/null || skip "$tool is not installed (deploy/test.sh --full installs it)"
  done
}

# require_namespaces: skips the whole test where there are none.
require_namespaces() {
  unshare --mount --pid --net --fork true 2>/dev/null || skip "namespaces are not allowed here"
}

# make_system debian|ubuntu ROOT CACHE: a minimal Debian 12 or Ubuntu 24.04; the log is ROOT.log.
make_system() {
  local system=$1 root=$2 cache=$3
  local -a options=(--variant=minbase "--cache-dir=$cache")
  # No mirror is named: debootstrap knows each distribution's own.
  local -a target=(bookworm "$root")
  if [[ $system == ubuntu ]]; then
    # Debian's debootstrap may not know the name noble; all Ubuntu suites share the script of gutsy.
    target=(noble "$root" "" gutsy)
    options+=("--components=main,universe")
    # Debian does not carry Ubuntu's keys; inside, apt checks signatures with the real ones.
    [[ -e /usr/share/keyrings/ubuntu-archive-keyring.gpg ]] || options+=(--no-check-gpg)
  fi
  say "debootstrap $system"
  mkdir -p "$cache"
  debootstrap "${options[@]}" "${target[@]}" >"$root.log" 2>&1 || die "$(tail -n 20 "$root.log")"
}

# Storage, networks and limits of our own: nothing of the machine's containers is seen or touched.
# The storage is a cache, kept for the next run.
set_up_containers() {
  work=$(mktemp -d)
  mkdir -p "$cache/storage" "$work/networks"
  printf '[storage]\ndriver = "overlay"\ngraphroot = "%s"\nrunroot = "%s"\n' \
    "$cache/storage" "$work/run" >"$work/storage.conf"
  cat >"$work/containers.conf" <<CONF
[containers]
default_ulimits = ["nofile=20000:20000", "nproc=20000:20000"]
[engine]
cgroup_manager = "cgroupfs"
runtime = "runc"
events_logger = "file"
[network]
network_backend = "netavark"
network_config_dir = "$work/networks"
CONF
  export CONTAINERS_STORAGE_CONF=$work/storage.conf CONTAINERS_CONF=$work/containers.conf
}

remove_containers() {
  podman pod rm --all --force --time 2 >/dev/null 2>&1 || true
  podman rm --all --force --time 2 >/dev/null 2>&1 || true
  podman network prune --force >/dev/null 2>&1 || true
  podman secret ls --quiet 2>/dev/null | xargs --no-run-if-empty podman secret rm >/dev/null 2>&1 || true
  podman volume prune --force >/dev/null 2>&1 || true
  [[ -z $work ]] || rm -rf -- "$work"
}

# The stand-in for Debian's own image, which no registry is asked for.
ensure_base_image() {
  buildah inspect --type image "$base_image" >/dev/null 2>&1 && return
  make_system debian "$work/root" "$cache/debootstrap"
  rm -rf "$work/root/var/cache/apt/archives/"*.deb "$work/root/var/lib/apt/lists/"*
  tar -C "$work/root" -c . | podman import - "$base_image" >/dev/null
  rm -rf -- "$work/root"
}

# build_server_image TAG [BUILD_OPTION...]
build_server_image() {
  local tag=$1 build_base=$base_image container
  shift
  local -a options=()
  if [[ -r ${NODE_EXTRA_CA_CERTS:-} ]]; then  # this machine's way to the npm registry
    build_base=localhost/catgs-build-base
    # Made once: another image, even of the same content, would start again with all layers.
    if ! buildah inspect --type image "$build_base" >/dev/null 2>&1; then
      container=$(buildah from "$base_image")
      buildah config --env NODE_EXTRA_CA_CERTS=/run/extra_ca.crt "$container"
      buildah commit --quiet --rm "$container" "$build_base" >/dev/null
    fi
    options=(--volume "$NODE_EXTRA_CA_CERTS:/run/extra_ca.crt:ro" --build-arg "BUILD_BASE=$build_base")
  fi
  buildah bud --isolation chroot --layers --format docker --file "$source_dir/docker/Dockerfile" \
    --build-arg "REVISION=$(git -C "$source_dir" describe --always --dirty --abbrev=12 --exclude='*')" \
    --tag "$tag" "${options[@]}" "$@" "$source_dir"
}

# set_up_server_image TOOL...: how tests of systems that the server's image is a part of begin. The image is that
# of images.sh, built where there is none.
set_up_server_image() {
  require_tools podman buildah debootstrap runc "$@"
  /usr/bin/python3 -c 'import yaml' 2>/dev/null || skip "python3-yaml is not installed"
  trap remove_containers EXIT
  set_up_containers
  ensure_base_image
  buildah inspect --type image localhost/catgs-server:cpu >/dev/null 2>&1 ||
    build_server_image localhost/catgs-server:cpu >"$work/build.log" 2>&1 || die "$(tail -n 20 "$work/build.log")"
}

# set_up_fleet_images TOOL...: the images of the compose file, but for Grafana's.
set_up_fleet_images() {
  set_up_server_image "$@"
  build_stand_in docker.io/library/haproxy:3.0 haproxy haproxy -W -db -f /usr/local/etc/haproxy/haproxy.cfg
  build_stand_in docker.io/prom/prometheus:v2.53.3 prometheus \
    prometheus --config.file=/etc/prometheus/prometheus.yml --storage.tsdb.path=/prometheus
}

# build_stand_in TAG PACKAGE COMMAND...: Debian's package under the name of an image of a registry.
build_stand_in() {
  local tag=$1 package=$2
  shift 2
  buildah inspect --type image "$tag" >/dev/null 2>&1 && return
  say "stand-in for $tag: Debian's $package"
  local entrypoint
  printf -v entrypoint '"%s",' "$@"
  buildah bud --isolation chroot --format docker --tag "$tag" - >"$work/stand_in.log" 2>&1 <<DOCKERFILE ||
FROM $base_image
RUN apt-get update && apt-get install -y --no-install-recommends $package && rm -rf /var/lib/apt/lists/*
ENTRYPOINT [${entrypoint%,}]
DOCKERFILE
    die "$(tail -n 5 "$work/stand_in.log")"
}
