#!/usr/bin/env bash
# usage: fleet.sh LOAD_PROGRAM
# The compose file's system under podman, eight sessions, a server killed and one drained: fleet.py. Haproxy and
# Prometheus are Debian's, under the names of the images that the file asks for.
# Needs root, podman, buildah, debootstrap and the image of images.sh (which it builds else), or exits 77.
set -euo pipefail
# shellcheck source=tests/deploy/containers.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/containers.sh"

set_up_server_image haproxy
build_stand_in docker.io/library/haproxy:3.0 haproxy haproxy -W -db -f /usr/local/etc/haproxy/haproxy.cfg
build_stand_in docker.io/prom/prometheus:v2.53.3 prometheus \
  prometheus --config.file=/etc/prometheus/prometheus.yml --storage.tsdb.path=/prometheus
/usr/bin/python3 -B "$source_dir/tests/deploy/fleet.py" --load "$1"
