#!/usr/bin/env bash
# usage: fleet.sh LOAD_PROGRAM
# The compose file's system under podman, eight sessions, a server killed and one drained: fleet.py. Haproxy and
# Prometheus are Debian's, under the names of the images that the file asks for.
# Needs root, podman, buildah, debootstrap and the image of images.sh (which it builds else), or exits 77.
set -euo pipefail
# shellcheck source=tests/deploy/containers.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/containers.sh"

set_up_fleet_images haproxy
/usr/bin/python3 -B "$source_dir/tests/deploy/fleet.py" --load "$1"
