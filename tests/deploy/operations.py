#!/usr/bin/env python3
"""Checks what operators deploy, each subcommand with the tool that will read it in the end.

  operations.py alerts                  every alert has a section in ALERTS.md, and a test in which it fires
  operations.py prometheus              rules and configurations (promtool), and when alerts fire
  operations.py grafana                 the dashboard's panels, and that what it needs is provisioned
  operations.py haproxy                 both configurations (haproxy -c), and what they give to one address
  operations.py systemd                 the unit and its exposure (systemd-analyze)
  operations.py kubernetes              renders base and overlays (kubectl kustomize) and asserts on them
  operations.py compose                 the compose file: what every service has to have
  operations.py notices                 the notices name every package that the page contains
  operations.py metrics --server FILE   alerts and dashboard name only metrics that FILE serves
  operations.py settings --server FILE  FILE knows every setting that files here give it

Exit status: 0 good, 1 findings (one per line), 77 a tool is not installed.
"""

import argparse
import contextlib
import json
import os
import pathlib
import re
import shutil
import socket
import subprocess
import sys
import tempfile
import time
import urllib.request

import dashboard_check
import haproxy_crowd

SOURCE_DIR = pathlib.Path(__file__).resolve().parents[2]
DEPLOY = SOURCE_DIR / "deploy"
DOCKER = SOURCE_DIR / "docker"
EXIT_SKIPPED = 77
# What systemd-analyze security calls "OK" ends at 5; ours is below 2 and shall stay there.
MAX_EXPOSURE_TENTHS = 20


class Skip(Exception):
    """A tool is missing."""


def tool(name):
    path = shutil.which(name, path=os.environ["PATH"] + ":/usr/sbin:/sbin")
    if not path:
        raise Skip(f"{name} is not installed")
    return path


def run(*command, **options):
    """The findings of a command: its output, when it fails."""
    result = subprocess.run(command, capture_output=True, text=True, check=False, timeout=120, **options)
    if result.returncode == 0:
        return []
    return [f"{' '.join(map(str, command))}: status {result.returncode}", *(result.stdout + result.stderr).splitlines()]


def untrue(wanted, where=""):
    """The findings of what is wanted: names of facts, and whether they hold."""
    return [f"{where and where + ': '}not true: {what}" for what, holds in wanted.items() if not holds]


def load_yaml(text):
    try:
        import yaml
    except ImportError as error:
        if sys.executable != "/usr/bin/python3" and os.access("/usr/bin/python3", os.X_OK):
            os.execv("/usr/bin/python3", ["/usr/bin/python3", "-B", *sys.argv])  # Debian's, with its packages
        raise Skip("python3-yaml is not installed") from error
    return [document for document in yaml.safe_load_all(text) if document]


def alerts():
    return load_yaml((DEPLOY / "prometheus/alerts.yaml").read_text())[0]["groups"][0]["rules"]


def dashboard():
    return json.loads((DEPLOY / "grafana/dashboards/catgs.json").read_text())


def dashboard_expressions():
    return [(title, text.replace("$instance", ".*")) for title, text in dashboard_check.expressions(dashboard())]


def check_alerts(_):
    findings = []
    tests = (DEPLOY / "prometheus/alerts_test.yaml").read_text()
    sections = set(re.findall(r"^## (\w+)$", (DEPLOY / "ALERTS.md").read_text(), re.M))
    for rule in alerts():
        name = rule["alert"]
        if f"alertname: {name}\n        exp_alerts:" not in tests:
            findings.append(f"alerts_test.yaml: {name} is never seen to fire")
        if rule["annotations"]["runbook"] != f"deploy/ALERTS.md#{name.lower()}" or name not in sections:
            findings.append(f"deploy/ALERTS.md: no section {name}")
    unknown = sections - {rule["alert"] for rule in alerts()}
    return findings + [f"deploy/ALERTS.md: there is no alert {name}" for name in unknown]


def check_prometheus(_):
    promtool = tool("promtool")
    findings = run(promtool, "check", "config", DEPLOY / "prometheus/prometheus.yaml")
    findings += run(promtool, "test", "rules", DEPLOY / "prometheus/alerts_test.yaml")
    with tempfile.TemporaryDirectory() as folder:
        # The compose file's configuration names the rules by their place in the container.
        config = pathlib.Path(folder, "prometheus.yaml")
        config.write_text((DOCKER / "prometheus.yaml").read_text().replace("/etc/prometheus", str(DEPLOY / "prometheus")))
        findings += run(promtool, "check", "config", config)
        # As rules, the dashboard's expressions are parsed too.
        rules = [{"record": "dashboard", "expr": expression} for _, expression in dashboard_expressions()]
        path = pathlib.Path(folder, "dashboard.yaml")
        path.write_text(json.dumps({"groups": [{"name": f"g{i}", "rules": [r]} for i, r in enumerate(rules)]}))
        findings += run(promtool, "check", "rules", "--lint=none", path)
    return findings


def check_grafana(_):
    provisioning = DEPLOY / "grafana/provisioning"
    sources = load_yaml((provisioning / "datasources/prometheus.yaml").read_text())[0]["datasources"]
    provider = load_yaml((provisioning / "dashboards/catgs.yaml").read_text())[0]["providers"][0]
    services = load_yaml((DOCKER / "compose.yaml").read_text())[0]["services"]
    findings = dashboard_check.findings(dashboard(), {source["uid"] for source in sources})
    grafana = services["grafana"]
    mounted = {inside: outside for outside, inside, _ in (volume.split(":") for volume in grafana["volumes"] if volume.endswith(":ro"))}
    folder = provider["options"]["path"]
    home = grafana["environment"]["GF_DASHBOARDS_DEFAULT_HOME_DASHBOARD_PATH"]
    wanted = {
        "Prometheus is where the compose file has it": sources[0]["url"] == "http://prometheus:9090" and "prometheus" in services,
        "the dashboards are mounted where Grafana looks": (DOCKER / mounted.get(folder, "nowhere")).is_dir(),
        "Grafana's first page is our dashboard": (DOCKER / mounted.get(os.path.dirname(home), "nowhere") / os.path.basename(home)).is_file(),
        "provisioning is mounted": (DOCKER / mounted.get("/etc/grafana/provisioning", "nowhere")).resolve() == provisioning,
    }
    return findings + untrue(wanted)


def check_haproxy(_):
    haproxy = tool("haproxy")
    openssl = tool("openssl")
    findings = []
    with tempfile.TemporaryDirectory() as folder:
        certificate = pathlib.Path(folder, "site.pem")
        findings += run(openssl, "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "1", "-subj", "/CN=tours.example",
                        "-keyout", pathlib.Path(folder, "key"), "-out", certificate)
        certificate.write_text(certificate.read_text() + pathlib.Path(folder, "key").read_text())
        pathlib.Path(folder, "key").unlink()
        config = pathlib.Path(folder, "haproxy.cfg")
        config.write_text((DEPLOY / "haproxy/haproxy.cfg").read_text().replace("/etc/haproxy/certs/", str(certificate)))
        for name, text in (("deploy", config.read_text()), ("docker", (DOCKER / "haproxy.cfg").read_text())):
            config.write_text(text)
            findings += run(haproxy, "-dW", "-c", "-f", config)  # a warning is a finding
            findings += [f"{name}: {finding}" for finding in haproxy_crowd.findings(haproxy, config)]
    return findings


def check_systemd(_):
    analyze = tool("systemd-analyze")
    with tempfile.TemporaryDirectory() as folder:
        unit = pathlib.Path(folder, "catgs-server.service")
        text = (DEPLOY / "systemd/catgs-server.service").read_text()
        unit.write_text(text.replace("ExecStart=/opt/catgs/bin/catgs-server", "ExecStart=/bin/true"))
        findings = run(analyze, "verify", "--man=no", unit)
        # Unknown settings are only warned about.
        warned = subprocess.run([analyze, "verify", "--man=no", str(unit)], capture_output=True, text=True, check=False)
        findings += [line for line in warned.stderr.splitlines() if "catgs-server.service" in line]
        findings += run(analyze, "security", "--offline=yes", f"--threshold={MAX_EXPOSURE_TENTHS}", "--no-pager", unit)
    return findings


def render(kubectl, folder):
    result = subprocess.run([kubectl, "kustomize", folder], capture_output=True, text=True, check=False, timeout=60)
    if result.returncode != 0:
        return None, [f"kubectl kustomize {folder}: {result.stderr.strip()}"]
    return {(d["kind"], d["metadata"]["name"]): d for d in load_yaml(result.stdout)}, []


def pod_findings(where, spec, drain_s):
    """What every Pod of ours has to have."""
    wanted = {
        "does not run as root": spec.get("securityContext", {}).get("runAsNonRoot") is True,
        "has time to drain": spec.get("terminationGracePeriodSeconds", 30) > drain_s,
    }
    for container in spec["containers"]:
        security = container.get("securityContext", {})
        wanted |= {
            f"{container['name']} has a read-only file system": security.get("readOnlyRootFilesystem") is True,
            f"{container['name']} cannot gain privileges": security.get("allowPrivilegeEscalation") is False,
            f"{container['name']} has no capabilities": security.get("capabilities", {}).get("drop") == ["ALL"],
            f"{container['name']} has a memory limit": "memory" in container.get("resources", {}).get("limits", {}),
        }
        volumes = {v["name"] for v in spec.get("volumes", [])}
        for mount in container.get("volumeMounts", []):
            wanted[f"volume {mount['name']} exists"] = mount["name"] in volumes
            wanted[f"volume {mount['name']} is read-only"] = mount.get("readOnly", False) or mount["name"] == "tmp"
    return untrue(wanted, where)


def drain_seconds(config):
    return sum(int(re.search(rf"^{key} = (\d+)$", config, re.M)[1]) for key in ("drain-wait", "drain-deadline"))


def renderer_of(container, config):
    """The renderer that a container asks for: variables win over the file."""
    variables = {variable["name"]: variable.get("value") for variable in container.get("env", [])}
    in_file = re.search(r'^renderer = "(\w+)"$', config, re.M)
    return variables.get("CATGS_RENDERER", in_file and in_file[1])


def check_kubernetes(_):
    kubectl = tool("kubectl")
    findings = []
    for name in ("base", "overlays/cpu", "overlays/keda"):
        objects, errors = render(kubectl, DEPLOY / "kubernetes" / name)
        findings += errors
        if errors:
            continue
        deployment = objects["Deployment", "catgs-server"]
        spec = deployment["spec"]["template"]["spec"]
        server = spec["containers"][0]
        labels = deployment["spec"]["template"]["metadata"]["labels"]
        config = next((d for (kind, n), d in objects.items() if kind == "ConfigMap" and n.startswith("catgs-config-")), None)
        mounted = [v["configMap"]["name"] for v in spec["volumes"] if "configMap" in v]
        findings += pod_findings(name, spec, drain_seconds(config["data"]["catgs.toml"]))
        ports = {p["name"]: p["containerPort"] for p in server["ports"]}
        wanted = {
            "a change of the settings rolls out": mounted == [config["metadata"]["name"]],
            "readiness is /readyz": server["readinessProbe"]["httpGet"]["path"] == "/readyz",
            "liveness is /healthz": server["livenessProbe"]["httpGet"]["path"] == "/healthz",
            "probes name a port": all(server[p]["httpGet"]["port"] in ports for p in ("startupProbe", "readinessProbe", "livenessProbe")),
            "nobody is without a place in an update": deployment["spec"]["strategy"]["rollingUpdate"] == {"maxSurge": 1, "maxUnavailable": 0},
            "a GPU where one is meant": ("nvidia.com/gpu" in server["resources"]["limits"]) == (name != "overlays/cpu"),
            "the renderer suits, and no other takes its place": renderer_of(server, config["data"]["catgs.toml"]) == ("cpu" if name == "overlays/cpu" else "cuda"),
            "the image suits": server["image"].endswith(":cpu" if name == "overlays/cpu" else ":cuda"),
            "replicas are KEDA's or ours": ("replicas" in deployment["spec"]) == (name != "overlays/keda"),
            "the disruption budget selects the Pods": objects["PodDisruptionBudget", "catgs-server"]["spec"]["selector"]["matchLabels"].items() <= labels.items(),
            "the service selects the Pods": objects["Service", "catgs-server"]["spec"]["selector"].items() <= labels.items(),
            "the service's port exists": objects["Service", "catgs-server"]["spec"]["ports"][0]["targetPort"] in ports,
            "a server calls nobody": objects["NetworkPolicy", "catgs-server"]["spec"]["egress"] == [],
        }
        if name == "overlays/keda":
            scaled = objects["ScaledObject", "catgs-server"]["spec"]
            wanted["KEDA scales the Deployment"] = scaled["scaleTargetRef"]["name"] == deployment["metadata"]["name"]
            wanted["one server can go"] = scaled["minReplicaCount"] >= 2
        findings += untrue(wanted, name)
    return findings + agones_findings(kubectl)


def agones_findings(kubectl):
    objects, findings = render(kubectl, DEPLOY / "kubernetes/overlays/agones")
    if findings:
        return findings
    template = objects["Fleet", "catgs-server"]["spec"]["template"]["spec"]
    spec = template["template"]["spec"]
    findings = pod_findings("overlays/agones", spec, drain_seconds(objects["ConfigMap", "catgs-config"]["data"]["catgs.toml"]))
    allocation = load_yaml((DEPLOY / "kubernetes/overlays/agones/allocation.example.yaml").read_text())[0]
    mounted = {v["configMap"]["name"] for v in spec["volumes"] if "configMap" in v}
    names = {c["name"] for c in spec["containers"]}
    wanted = {
        "no other renderer takes the GPU's place": renderer_of(spec["containers"][0], objects["ConfigMap", "catgs-config"]["data"]["catgs.toml"]) == "cuda",
        "its configurations exist": all(("ConfigMap", name) in objects for name in mounted),
        "Agones knows the server's container": template["container"] in names,
        "the autoscaler's fleet exists": objects["FleetAutoscaler", "catgs-server"]["spec"]["fleetName"] == "catgs-server",
        "the allocation's fleet exists": allocation["spec"]["selectors"][0]["matchLabels"]["agones.dev/fleet"] == "catgs-server",
    }
    return findings + untrue(wanted, "overlays/agones")


def check_compose(_):
    compose = load_yaml((DOCKER / "compose.yaml").read_text())[0]
    services = compose["services"]
    findings = []
    aliases = {}
    for name, service in services.items():
        if name != "keys" and service.get("cap_drop") != ["ALL"]:
            findings.append(f"{name}: capabilities are not dropped")
        if name != "keys" and not {"max-size", "max-file"} <= service.get("logging", {}).get("options", {}).keys():
            findings.append(f"{name}: its log has no bound")
        if name not in ("keys", "grafana") and service.get("read_only") is not True:
            findings.append(f"{name}: the file system is not read-only")
        for mapping in service.get("ports", []):
            if not mapping.startswith(("127.0.0.1:", "${CATGS_LISTEN:-127.0.0.1}:")):
                findings.append(f"{name}: port {mapping} is published beyond this machine")
        for volume in service.get("volumes", []):
            source = volume.rsplit(":", 2)[0]
            if source.startswith("..") or source in ("./haproxy.cfg", "./prometheus.yaml"):
                if not (DOCKER / source).exists():
                    findings.append(f"{name}: there is no {source}")
        for profile in service.get("profiles", []):
            aliases.setdefault(profile, set()).update(service["networks"]["default"]["aliases"])
            environment = service["environment"]
            drain_s = environment["CATGS_DRAIN_WAIT"] + environment["CATGS_DRAIN_DEADLINE"]
            if environment.get("CATGS_RENDERER") != ("cuda" if profile == "gpu" else None):
                findings.append(f"{name}: another renderer than its profile's may start")
            if int(service["stop_grace_period"].rstrip("s")) <= drain_s:
                findings.append(f"{name}: no time to drain")
    for profile in ("cpu", "gpu"):
        for file in ("haproxy.cfg", "prometheus.yaml"):
            named = set(re.findall(r"\bcatgs-\d\b", (DOCKER / file).read_text()))
            if named != aliases.get(profile):
                findings.append(f"{file} names {sorted(named)}, profile {profile} has {sorted(aliases.get(profile, []))}")
    proxy = services["haproxy"]["networks"]["default"]["ipv4_address"]
    if services["server-1"]["environment"]["CATGS_TRUSTED_PROXY"] != proxy:
        findings.append("the servers trust another address than the proxy's")
    return findings


def check_notices(_):
    packages = json.loads((SOURCE_DIR / "web_client/package-lock.json").read_text())["packages"]
    in_page = [name.removeprefix("node_modules/") for name, package in packages.items() if name and not package.get("dev")]
    notices = (DEPLOY / "NOTICES.md").read_text().lower()
    return [f"deploy/NOTICES.md does not name {name}" for name in in_page if name not in notices]


@contextlib.contextmanager
def running_server(program):
    port = haproxy_crowd.free_port()
    server = subprocess.Popen([program, "--scene", "synth:city:1000", "--port", "0", "--admin-bind", f"127.0.0.1:{port}",
                               "--renderer", "cpu", "--encoder", "jpeg", "--log-level", "error"])
    try:
        yield port
    finally:
        server.terminate()
        server.wait(timeout=60)


def scrape(port):
    for _ in range(600):
        with contextlib.suppress(OSError):
            with urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=30) as answer:
                return answer.read().decode()
        time.sleep(0.1)
    raise RuntimeError("the server does not serve its metrics")


def check_metrics(options):
    with running_server(options.server) as port:
        text = scrape(port)
    served = set(re.findall(r"^# TYPE (\S+) ", text, re.M))
    served |= {name + suffix for name in re.findall(r"^# TYPE (\S+) histogram", text, re.M) for suffix in ("_bucket", "_sum", "_count")}
    # Of a GPU that this machine may not have, and of scenes in pages.
    served |= {"catgs_device_views", "catgs_scene_pages", "catgs_scene_pages_loaded_total"}
    expressions = [(f"alert {rule['alert']}", rule["expr"]) for rule in alerts()]
    expressions += [(f"dashboard, {title}", expression) for title, expression in dashboard_expressions()]
    scaler = (DEPLOY / "kubernetes/overlays/keda/scaledobject.yaml").read_text()
    expressions.append(("keda", re.search(r"query: (.*)", scaler)[1]))
    findings = []
    for where, expression in expressions:
        for name in sorted(set(re.findall(r"\b(?:catgs|process)_[a-z_]+", expression)) - served):
            findings.append(f"{where}: the server has no metric {name}")
    return findings


def check_settings(options):
    """Configurations are read by the program itself, with files where theirs would be."""
    findings = []
    shown = subprocess.run([options.server, "--scene", "synth:city:1000", "--print-config"], capture_output=True, text=True, check=True)
    known = set(re.findall(r"^(\S+) = ", shown.stdout, re.M))
    # run.sh takes the word behind an option as its value, but not behind these.
    listed = re.search(r"^ *(--[a-z-]+(?: \| --[a-z-]+)+)\) server_options", (DEPLOY / "run.sh").read_text(), re.M)
    without_value = set(re.findall(r"^(\S+) = (?:true|false) ", shown.stdout, re.M))
    if {name.removeprefix("--") for name in listed[1].split(" | ")} != without_value:
        findings.append(f"deploy/run.sh: the options without a value are {sorted(without_value)}")
    with tempfile.TemporaryDirectory() as folder:
        stand_in = pathlib.Path(folder, "file")
        stand_in.write_text("a-secret-of-more-than-sixteen-bytes\n")
        for file in sorted(DEPLOY.rglob("catgs.toml")):
            config = pathlib.Path(folder, "catgs.toml")
            config.write_text(re.sub(r'"/(secrets|tls|run/credentials)/[^"]*"', f'"{stand_in}"', file.read_text()))
            findings += run(options.server, "--config", config, "--print-config")
    for file in (DOCKER / "compose.yaml", DOCKER / "Dockerfile", *DEPLOY.rglob("*.yaml")):
        # In compose, CATGS_SCENES and the like are variables of the file and stand in ${}.
        text = re.sub(r"\$\{[^}]*\}|#.*", "", file.read_text())
        for name in set(re.findall(r"\bCATGS_[A-Z_]+\b", text)) - {"CATGS_COMMIT"}:
            if name[6:].lower().replace("_", "-") not in known:
                findings.append(f"{file}: the server has no setting for {name}")
    return findings + page_findings(dict(re.findall(r"^(\S+) = (.*?)  # default$", shown.stdout, re.M)) | {"scene": "[]"})


def page_findings(defaults):
    """The table of SETTINGS.md has each setting once, with the default that the program prints."""
    findings = []
    named = {}
    section = (DEPLOY / "SETTINGS.md").read_text().split("\n## Settings\n")[1].split("\n## ")[0]
    for names, values in re.findall(r"^\| (`--[^|]*) \| ([^|]*)\|", section, re.M):
        names = re.findall(r"`--([a-z0-9-]+)`", names)
        values = re.findall(r"`([^`]*)`", values) or [""] * len(names)
        for name, value in zip(names, values, strict=True):
            findings += [f"deploy/SETTINGS.md: --{name} stands there twice"] * (name in named)
            named[name] = value
    shown = {name: "" if value in ("false", "[]") else value.strip('"') for name, value in defaults.items()}
    for name in sorted(named.keys() | shown.keys()):
        if named.get(name) != shown.get(name):
            findings.append(f"deploy/SETTINGS.md: --{name} is {named.get(name, 'missing')!r} there, {shown.get(name, 'unknown')!r} in the program")
    return findings


CHECKS = {"alerts": check_alerts, "prometheus": check_prometheus, "grafana": check_grafana, "haproxy": check_haproxy, "systemd": check_systemd,
          "kubernetes": check_kubernetes, "compose": check_compose, "notices": check_notices, "metrics": check_metrics, "settings": check_settings}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("check", choices=CHECKS)
    parser.add_argument("--server", help="catgs-server")
    options = parser.parse_args()
    try:
        findings = CHECKS[options.check](options)
    except Skip as why:
        print(f"SKIPPED: {why}")
        return EXIT_SKIPPED
    print("\n".join(findings))
    return 1 if findings else 0


if __name__ == "__main__":
    sys.exit(main())
