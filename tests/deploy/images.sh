#!/usr/bin/env bash
# usage: images.sh LOAD_PROGRAM [cpu | cuda]
# Builds docker/Dockerfile without a Docker engine and starts it as the README says: read-only, without
# capabilities, not root. catgs-load is its visitor. `cuda` takes this machine's nvcc, compiles for one generation
# of GPUs, and serves with the CPU core where there is no GPU. Prints sizes and times.
# Needs root, podman, buildah and debootstrap, otherwise it says so and exits 77.
set -euo pipefail
# shellcheck source=tests/deploy/containers.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/containers.sh"

load=$1
kind=${2:-cpu}
require_tools podman buildah debootstrap runc
options=()
if [[ $kind == cuda ]]; then
  toolkit=${CUDA_HOME:-/usr/local/cuda}
  [[ -x $toolkit/bin/nvcc ]] || skip "no nvcc in $toolkit (set CUDA_HOME)"
  options=(--build-arg CUDA=ON --build-arg CUDA_ARCHITECTURES=90 --volume "$(readlink -f "$toolkit"):/usr/local/cuda:ro")
fi
trap remove_containers EXIT
set_up_containers
ensure_base_image

image=localhost/catgs-server:$kind
begin=$SECONDS
say "build of $image"
build_server_image "$image" "${options[@]}" >"$work/build.log" 2>&1 || die "$(tail -n 20 "$work/build.log")"
say "built after $((SECONDS - begin)) s"
size=$(podman image inspect --format '{{.Size}}' "$image")
base_size=$(podman image inspect --format '{{.Size}}' "$base_image")
say "$((size / 1000000)) MB, of which $((base_size / 1000000)) MB are its base"
for label in title revision; do
  [[ -n $(podman image inspect --format "{{index .Labels \"org.opencontainers.image.$label\"}}" "$image") ]] || die "no label $label"
done

# start NAME OPTION... -- ARGUMENT...: a container, and its address in `address`.
start() {
  local name=$1
  local -a run=(podman run --detach --name "$name" --read-only --cap-drop ALL --security-opt no-new-privileges)
  shift
  while [[ $1 != -- ]]; do
    run+=("$1")
    shift
  done
  shift
  "${run[@]}" "$image" "$@" >/dev/null
  address=$(podman inspect --format '{{.NetworkSettings.IPAddress}}' "$name")
}

begin_ms=$(now_ms)
start visited -- --open --scene synth:city:50000
until "$source_dir/deploy/http_check.sh" 8080 /readyz "$address" 2>/dev/null; do
  [[ $(podman inspect --format '{{.State.Running}}' visited) == true ]] || die "$(podman logs visited 2>&1)"
  sleep 0.05
done
say "ready $(($(now_ms) - begin_ms)) ms after the start, with a city of 50,000 Gaussians"

[[ $(podman exec visited id -u) == 10001 ]] || die "it runs as $(podman exec visited id)"
[[ $(podman exec visited sed -n 's#^[^ ]* [^ ]* [^ ]* [^ ]* / \([^ ]*\) .*#\1#p' /proc/self/mountinfo) == ro,* ]] || die "its file system is not read-only"
[[ $(podman exec visited grep CapEff /proc/1/status) == *0000000000000000 ]] || die "it has capabilities"
say "not root, a read-only file system, no capabilities"
podman healthcheck run visited || die "the health check fails"
"$load" --url "ws://$address:8080" --sessions 2 --size 320x180 --fps 15 --script walk --duration 5s --decode \
  --require 'decode_errors==0' --require 'errors==0' --require 'fps_min>1' || die "catgs-load"
podman logs visited >"$work/log" 2>&1
grep -m 1 renderer "$work/log"

# The health check must also be able to fail.
podman pause visited
if timeout 20 "$source_dir/deploy/http_check.sh" 9090 /healthz "$address" 2>/dev/null; then die "a process that hangs is healthy"; fi
podman unpause visited

begin_ms=$(now_ms)
podman stop --time 30 visited >/dev/null
[[ $(podman inspect --format '{{.State.ExitCode}}' visited) == 0 ]] || die "it did not end as asked: $(podman logs --tail 5 visited 2>&1)"
say "stopped with status 0 after $(($(now_ms) - begin_ms)) ms"

# Without tokens and without --open it does not serve strangers.
if podman run --rm --read-only "$image" --scene synth:city:1000 >"$work/closed.log" 2>&1; then die "it is open by default"; fi
grep -q -- --open "$work/closed.log" || die "$(cat "$work/closed.log")"
say "$image: good"
