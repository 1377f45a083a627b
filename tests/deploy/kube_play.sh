#!/usr/bin/env bash
# usage: kube_play.sh LOAD_PROGRAM
# Renders deploy/kubernetes/overlays/cpu and runs its Pod by `podman kube play`, with a secret and a volume
# of scenes as a cluster would give them; catgs-load is its visitor. What podman does not know (probes of
# a name, GPU, network policies) is left out of it.
# Needs root, podman, kubectl and the image of images.sh (which it builds else), or exits 77.
set -euo pipefail
# shellcheck source=tests/deploy/containers.sh
source "$(dirname -- "${BASH_SOURCE[0]}")/containers.sh"

load=$1
set_up_server_image kubectl

/usr/bin/python3 -B - "$source_dir/deploy/kubernetes" "$work" <<'PYTHON'
import base64, pathlib, subprocess, sys
import yaml

folder, work = sys.argv[1:]
text = subprocess.run(["kubectl", "kustomize", folder + "/overlays/cpu"], check=True, capture_output=True, text=True).stdout
objects = [d for d in yaml.safe_load_all(text) if d and d["kind"] in ("Deployment", "ConfigMap")]
deployment = next(d for d in objects if d["kind"] == "Deployment")
deployment["spec"]["replicas"] = 1  # podman runs one
spec = deployment["spec"]["template"]["spec"]
for volume in spec["volumes"]:
    if "secret" in volume:
        volume["secret"]["optional"] = False  # podman 4.3 crashes without it
for container in spec["containers"]:
    container["image"] = "localhost/" + container["image"]
    for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
        container.pop(probe)
secret = yaml.safe_load(pathlib.Path(folder, "secret.example.yaml").read_text())
values = secret.pop("stringData")
secret["data"] = {k: base64.b64encode(v.encode()).decode() for k, v in values.items()}
pathlib.Path(work, "secret.yaml").write_text(yaml.safe_dump(secret))
pathlib.Path(work, "pod.yaml").write_text(yaml.safe_dump_all(objects))
PYTHON

podman volume create catgs-scenes >/dev/null
podman run --rm --volume catgs-scenes:/scenes --user 0 --entrypoint catgs-render localhost/catgs-server:cpu \
  synth city --gaussians 20000 --seed 1 /scenes/city.ply >/dev/null
podman kube play "$work/secret.yaml" >/dev/null
podman kube play "$work/pod.yaml" >/dev/null
pod=$(podman pod ps --format '{{.Name}}' | head -n 1)
container=$(podman ps --filter "name=$pod-server" --format '{{.Names}}')
[[ -n $container ]] || die "no container: $(podman ps --all)"
address=$(podman inspect --format '{{range .NetworkSettings.Networks}}{{.IPAddress}}{{end}}' "$(podman pod inspect --format '{{.InfraContainerID}}' "$pod")")
for ((i = 0; i < 300; ++i)); do
  "$source_dir/deploy/http_check.sh" 9090 /readyz "$address" 2>/dev/null && break
  [[ $(podman inspect --format '{{.State.Running}}' "$container") == true ]] || die "$(podman logs "$container" 2>&1 | tail -n 5)"
  sleep 0.1
done
say "$pod is ready at $address"
[[ $(podman exec "$container" id -u) == 10001 ]] || die "it runs as $(podman exec "$container" id)"
[[ $(podman exec "$container" sed -n 's#^[^ ]* [^ ]* [^ ]* [^ ]* / \([^ ]*\) .*#\1#p' /proc/self/mountinfo) == ro,* ]] || die "its file system is not read-only"
# What the server reads: some versions of podman leave a secret in base64.
token=$(podman exec "$container" cat /secrets/tokens)
"$load" --url "ws://$address:8080" --token "$token" --sessions 2 --size 160x90 --fps 10 --script walk --duration 4s \
  --require 'errors==0' --require 'fps_min>1' || die "catgs-load"
if "$load" --url "ws://$address:8080" --sessions 1 --duration 2s --require 'sessions_connected==1' >/dev/null 2>&1; then
  die "it serves without a token"
fi
say "the Pod serves those who have the token, and nobody else"
podman kube down "$work/pod.yaml" >/dev/null
podman volume rm --force catgs-scenes >/dev/null
