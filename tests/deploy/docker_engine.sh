#!/usr/bin/env bash
# usage: docker_engine.sh LOAD_PROGRAM
# The README's compose command on a Docker engine, with eight sessions, a server killed and one drained: fleet.py.
# The images are those of fleet.sh, loaded under the names that the compose file asks for; Grafana's has nothing in it.
# The engine has a network of its own, so that the machine's addresses and firewall stay as they are.
# Needs root, dockerd, docker-compose, and what fleet.sh needs, or exits 77.
set -euo pipefail
# shellcheck source=tests/deploy/containers.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/containers.sh"

# load_image FROM TO: an image of buildah's as one layer, since the vfs driver copies each.
load_image() {
  local container
  container=$(buildah from --pull-never "$1")
  buildah commit --quiet --squash --format docker "$container" "docker-archive:$work/image.tar:$2" >/dev/null
  buildah rm "$container" >/dev/null
  docker load --quiet --input "$work/image.tar" >/dev/null
  rm "$work/image.tar"
}

if [[ $1 != --inside ]]; then
  require_tools dockerd docker docker-compose containerd
  require_namespaces
  set_up_fleet_images iptables
  build_stand_in docker.io/grafana/grafana:11.4.0 coreutils sleep infinity
  unshare --net --mount --pid --fork --kill-child --mount-proc "${BASH_SOURCE[0]}" --inside "$work" "$1"
  exit
fi

work=$2
load=$3
ip link set lo up
export DOCKER_HOST=unix://$work/docker.sock
dockerd --storage-driver vfs --data-root "$work/docker" --exec-root "$work/docker-exec" --pidfile "$work/docker.pid" \
  --host "$DOCKER_HOST" >"$work/dockerd.log" 2>&1 &
engine=$!
until docker info >/dev/null 2>&1; do
  kill -0 "$engine" 2>/dev/null || skip "dockerd does not start here: $(tail -n 1 "$work/dockerd.log")"
  sleep 0.2
done
say "dockerd $(docker info --format '{{.ServerVersion}}, {{.Driver}}')"
load_image localhost/catgs-server:cpu catgs-server:cpu
for image in "$base_image" docker.io/library/haproxy:3.0 docker.io/prom/prometheus:v2.53.3 docker.io/grafana/grafana:11.4.0; do
  load_image "$image" "${image#docker.io/}"
done
say "images: $(docker images --format '{{.Repository}}:{{.Tag}} {{.Size}}' | paste -sd, | sed 's/,/, /g')"
/usr/bin/python3 -B "$source_dir/tests/deploy/fleet.py" --engine docker --load "$load"
