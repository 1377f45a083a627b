#!/usr/bin/python3
"""The compose file's system: what visitors notice when servers die, drain and come back.

  fleet.py --load catgs-load [--engine podman | docker]

Runs what docker/compose.yaml says, with eight sessions of catgs-load. With docker that is the
README's command, by docker-compose. With podman it is two servers, HAProxy and Prometheus, without a
Docker engine and without publishing ports. Started by fleet.sh and docker_engine.sh, which make the
images. Prints what it measures; exit status 1 where a promise is broken.
"""

import argparse
import base64
import contextlib
import json
import os
import pathlib
import re
import socket
import subprocess
import sys
import tempfile
import threading
import time
import urllib.parse
import urllib.request

import yaml

SOURCE_DIR = pathlib.Path(__file__).resolve().parents[2]
SERVICES = ("keys", "server-1", "server-2", "haproxy", "prometheus")
SESSIONS = 8
NETWORK = "catgs-fleet"
# What a service of the file may say: another key would be silently ignored here.
KNOWN_KEYS = {"image", "build", "environment", "volumes", "depends_on", "read_only", "tmpfs", "cap_drop",
              "security_opt", "stop_grace_period", "restart", "profiles", "networks", "network_mode", "command", "ports", "logging"}

failures = []


def say(text):
    print(f"{time.strftime('%T')}  {text}", flush=True)


def check(holds, text):
    say(("ok      " if holds else "BROKEN  ") + text)
    if not holds:
        failures.append(text)


def run_program(*command):
    result = subprocess.run(command, capture_output=True, text=True, check=False)
    if result.returncode != 0:
        raise RuntimeError(f"{' '.join(command)}: {result.stderr.strip()}")
    return result.stdout.strip()


def podman(*arguments):
    return run_program("podman", *arguments)


def wait_until(what, holds, seconds):
    """Seconds until it holds; inf when that takes longer than `seconds`."""
    begin = time.monotonic()
    while time.monotonic() - begin < seconds:
        with contextlib.suppress(OSError, ValueError, KeyError, IndexError):
            if holds():
                return time.monotonic() - begin
        time.sleep(0.05)
    say(f"after {seconds} s still not: {what}")
    return float("inf")


def get(url, timeout=3):
    with urllib.request.urlopen(url, timeout=timeout) as answer:
        return answer.read().decode()


class DockerFleet:
    """What the README's command starts, by Compose 2 or, where that is missing, by docker-compose 1.29."""

    engine = "docker"

    def __init__(self):
        file = SOURCE_DIR / "docker/compose.yaml"
        if subprocess.run(["docker", "compose", "version"], capture_output=True, check=False).returncode == 0:
            self.command = ("docker", "compose", "-f", str(file), "--profile", "cpu")
            return
        # It does not know the key `name`.
        self.copy = tempfile.NamedTemporaryFile("w", suffix=".yaml")
        self.copy.write(re.sub(r"^name:.*\n", "", file.read_text(), flags=re.M))
        self.copy.flush()
        self.command = ("docker-compose", "-f", self.copy.name, "--project-directory", str(file.parent),
                        "--project-name", "catgs", "--profile", "cpu")

    def up(self):
        run_program(*self.command, "up", "--no-build", "--detach")

    def container(self, name):
        return run_program(*self.command, "ps", "--all", "--quiet", name)

    def address(self, name):
        networks = json.loads(run_program("docker", "inspect", "--format", "{{json .NetworkSettings.Networks}}", self.container(name)))
        return next(iter(networks.values()))["IPAddress"]


class PodmanFleet:
    """The same without a Docker engine."""

    engine = "podman"

    def __init__(self, compose):
        self.services = compose["services"]
        self.network = compose["networks"]["default"]["ipam"]["config"][0]

    def value(self, text):
        """Variables of the file, all of which have defaults."""
        return re.sub(r"\$\{(\w+):-([^}]*)\}", lambda m: os.environ.get(m[1], m[2]), str(text))

    def start(self, name):
        service = self.services[name]
        unknown = set(service) - KNOWN_KEYS
        if unknown:
            raise RuntimeError(f"{name}: {sorted(unknown)} are not known here")
        options = ["--name", f"fleet-{name}", "--pull", "never"]
        network = service.get("networks", {}).get("default", {})
        if service.get("network_mode"):
            options += ["--network", service["network_mode"]]
        else:
            options += ["--network", NETWORK, "--network-alias", name]
            for alias in network.get("aliases", []):
                options += ["--network-alias", alias]
            if "ipv4_address" in network:
                options += ["--ip", network["ipv4_address"]]
        for key, value in service.get("environment", {}).items():
            options += ["--env", f"{key}={self.value(value)}"]
        for volume in service.get("volumes", []):
            source, rest = self.value(volume).split(":", 1)
            if source.startswith("."):
                source = str((SOURCE_DIR / "docker" / source).resolve())
                pathlib.Path(source).exists() or pathlib.Path(source).mkdir()
            options += ["--volume", f"{source}:{rest}"]
        options += ["--read-only"] * bool(service.get("read_only"))
        for folder in service.get("tmpfs", []):
            options += ["--tmpfs", folder]
        for capability in service.get("cap_drop", []):
            options += ["--cap-drop", capability]
        for option in service.get("security_opt", []):
            options += ["--security-opt", option.replace(":true", "")]
        podman("run", "--detach", *options, service["image"], *service.get("command", []))

    def up(self):
        podman("network", "create", "--subnet", self.network["subnet"], "--ip-range", self.network["ip_range"], NETWORK)
        for name in SERVICES:
            self.start(name)
            if name == "keys":
                podman("wait", "fleet-keys")

    def container(self, name):
        return f"fleet-{name}"

    def address(self, name):
        return podman("inspect", "--format", f'{{{{(index .NetworkSettings.Networks "{NETWORK}").IPAddress}}}}', f"fleet-{name}")


class Metrics:
    def __init__(self, address):
        self.address = address

    def __getitem__(self, name):
        text = get(f"http://{self.address}:9090/metrics")
        return sum(float(v) for v in re.findall(rf"^{name}(?:{{[^}}]*}})? (\S+)$", text, re.M))

    def live(self):
        sessions = json.loads(get(f"http://{self.address}:9090/api/sessions"))
        return [s for s in sessions if s["state"] == "live"]


def prometheus(address, query):
    url = f"http://{address}:9090/api/v1/query?" + urllib.parse.urlencode({"query": query})
    return json.loads(get(url))["data"]["result"]


def log_of(fleet, name, *options):
    return subprocess.run([fleet.engine, "logs", *options, fleet.container(name)], stdout=subprocess.PIPE,
                          stderr=subprocess.STDOUT, text=True, check=False).stdout


def ids(servers, *names):
    return sorted(s["id"] for name in names or servers for s in servers[name].live())


def stranger(address, forged):
    """A websocket with a made-up X-Forwarded-For that says something that is no message."""
    with socket.create_connection((address, 8080), timeout=5) as peer:
        key = base64.b64encode(os.urandom(16)).decode()
        peer.sendall((f"GET / HTTP/1.1\r\nHost: {address}:8080\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
                      f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\nSec-WebSocket-Protocol: catgs.v1\r\n"
                      f"X-Forwarded-For: {forged}\r\n\r\n").encode())
        status = peer.recv(4096).split(b"\r\n")[0].decode()
        peer.sendall(bytes([0x82, 0x83, 0, 0, 0, 0, 0xFF, 0xFF, 0xFF]))
        with contextlib.suppress(OSError):
            while peer.recv(4096):
                pass
    return status


class Load:
    """catgs-load in the background."""

    def __init__(self, program, address, seconds):
        self.report = pathlib.Path(tempfile.mkstemp(suffix=".json")[1])
        self.process = subprocess.Popen(
            [program, "--url", f"ws://{address}:8080", "--sessions", str(SESSIONS), "--size", "160x90", "--fps", "10",
             "--script", "walk", "--duration", f"{seconds}s", "--json", str(self.report)],
            stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)

    def result(self):
        _, errors = self.process.communicate(timeout=300)
        text = self.report.read_text()
        self.report.unlink()
        if not text:
            raise RuntimeError(f"catgs-load: {errors}")
        report = json.loads(text)
        say(f"catgs-load: {json.dumps({k: v for k, v in report['metrics'].items() if k in ('fps_mean', 'reconnects', 'errors', 'idrs', 'recovery_max_ms', 'recovery_p95_ms')})}")
        kinds = [kind for group in report["groups"] for kind in group["error_counts"]]
        check(not any("pose" in kind for kind in kinds), f"each session continues at its own newest pose (errors: {kinds})")
        return report["metrics"]

    def judge(self, moved, what):
        """`moved`: sessions that had to go to another server, because theirs was `what`."""
        metrics = self.result()
        check(metrics["errors"] <= moved, f"{what}: {metrics['errors']:.0f} errors, at most one for each connection that ended")
        check(metrics["recovery_max_ms"] <= 2000, f"{what}: the longest gap of a session was {metrics['recovery_max_ms']:.0f} ms")
        check(metrics["idrs"] <= SESSIONS + moved, f"{metrics['idrs']:.0f} IDRs: one for each session, one more for each that moved")


def run(fleet, load_program):
    def engine(action, *arguments, name):
        return run_program(fleet.engine, action, *arguments, fleet.container(name))

    begin = time.monotonic()
    fleet.up()
    servers = {name: Metrics(fleet.address(name)) for name in ("server-1", "server-2")}
    proxy, watcher = fleet.address("haproxy"), fleet.address("prometheus")
    wait_until("both servers are ready", lambda: all(get(f"http://{s.address}:9090/readyz") for s in servers.values()), 120)
    wait_until("the page comes through the proxy", lambda: "<!doctype html" in get(f"http://{proxy}:8080/").lower(), 30)
    say(f"up after {time.monotonic() - begin:.1f} s")
    if fleet.engine == "docker":
        check("<!doctype html" in get("http://127.0.0.1:8080/").lower(), "the page is where the compose file says")
    time.sleep(3)

    load = Load(load_program, proxy, 75)
    took = wait_until("all sessions are live", lambda: sum(len(s.live()) for s in servers.values()) == SESSIONS, 30)
    spread = [len(s.live()) for s in servers.values()]
    check(took < 30 and min(spread) >= SESSIONS // 2 - 1, f"{SESSIONS} sessions, spread {spread} by least connections")
    took = wait_until("Prometheus counts the sessions", lambda: float(prometheus(watcher, "sum(catgs_sessions)")[0]["value"][1]) == SESSIONS, 20)
    check(took < 20, "Prometheus counts the sessions")

    for address, where in ((proxy, "through the proxy"), (servers["server-2"].address, "straight to a server")):
        status = stranger(address, "6.6.6.6")
        logs = "".join(log_of(fleet, name) for name in servers)
        seen = re.findall(r"(\d+\.\d+\.\d+\.\d+): \S", logs)
        check("101" in status and seen and "6.6.6.6" not in logs, f"a forged X-Forwarded-For {where} is ignored (the log says {sorted(set(seen))})")

    moved = len(servers["server-1"].live())
    before = ids(servers)
    say(f"kill -9 of server-1 with {moved} sessions")
    engine("kill", "--signal", "KILL", name="server-1")
    took = wait_until("all sessions are back", lambda: len(servers["server-2"].live()) == SESSIONS, 20)
    check(took <= 2.0, f"killed: all sessions are live on the other server after {took:.2f} s")
    check(ids(servers, "server-2") == before, "each under its id: its resume token holds on the other server, and brings its pose")
    firing = 'count(ALERTS{alertname="CatgsServerDown", alertstate="firing"})'
    took = wait_until("the alert fires", lambda: prometheus(watcher, firing), 60)
    check(took < 60, f"CatgsServerDown fires {took:.0f} s after that")
    engine("start", name="server-1")
    servers["server-1"] = Metrics(fleet.address("server-1"))
    took = wait_until("the alert clears", lambda: not prometheus(watcher, firing), 60)
    check(took < 60, f"and clears {took:.0f} s after it is started again")
    load.judge(moved, "killed")

    wait_until("they have left", lambda: not any(s.live() for s in servers.values()), 30)
    load = Load(load_program, proxy, 45)
    wait_until("all sessions are live", lambda: sum(len(s.live()) for s in servers.values()) == SESSIONS, 30)
    moved = len(servers["server-2"].live())
    say(f"drain of server-2 with {moved} sessions")
    stopper = threading.Thread(target=engine, args=("stop", "--time", "40"), kwargs={"name": "server-2"})
    begin = time.monotonic()
    stopper.start()
    took = wait_until("all sessions are on the other server", lambda: len(servers["server-1"].live()) == SESSIONS, 40)
    stopper.join()
    status = engine("inspect", "--format", "{{.State.ExitCode}}", name="server-2")
    check(took < 40 and status == "0", f"drained: all sessions on the other server after {took:.1f} s, exit status {status} after {time.monotonic() - begin:.1f} s")
    load.judge(moved, "drained")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--load", required=True, help="catgs-load")
    parser.add_argument("--engine", choices=["podman", "docker"], default="podman")
    options = parser.parse_args()
    compose = yaml.safe_load((SOURCE_DIR / "docker/compose.yaml").read_text())
    fleet = DockerFleet() if options.engine == "docker" else PodmanFleet(compose)
    try:
        run(fleet, options.load)
    finally:
        if failures or sys.exc_info()[0]:
            for name in SERVICES:
                print(f"---- {name}\n{log_of(fleet, name, '--tail', '20')}", flush=True)
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main())
