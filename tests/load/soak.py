#!/usr/bin/env python3
"""Churns the sessions of one server process for a long time, and says whether it stays as it was.

  soak.py [--minutes 60] [--warm-up 5] [--program build/release/bin/catgs-load] [--out build/soak]
  soak.py --minutes 9 --attach PID --url ws://127.0.0.1:8080 [--admin http://127.0.0.1:9090]
          [--server-log FILE] [--out build/soak] [-- further arguments of catgs-load]

Rounds of scenarios/soak.toml, one after the other: visitors come and go, lose their sockets and
resume, stand still; in each round one generator more is killed. Meanwhile strangers go round
misdeeds.py and must be refused each time as stated there. Once a second the server's memory,
descriptors and threads are read from /proc, every five seconds /api/metrics, and nvidia-smi where there
is one. --out gets samples.jsonl, misdeeds.txt, soak.json, and soak.html with plots if the web client was built.

Without --attach it starts the catgs-server beside the program, and stops it at the end; strangers then
also save like an author who never ends. With it the server is one that runs already, on a loopback
address and without tokens, and stays; a later run with the same --out and the same process continues
the last one and judges both together.

Flat: see soak_report.py. Errors: since the first of these runs the server's log must have no line of
level warning or above but those that the strangers caused, and these as often as they did; the
counters of NEVER must have moved by what the strangers did and by nothing else; each stranger must
have had the right answer and each round's requirements must hold, and when all clients have gone the
server must have no sessions and no connections.

Exit status: 0 flat and no error; 1 otherwise; 2 it could not be run.
"""

import argparse
import collections
import json
import os
import pathlib
import random
import re
import secrets
import shutil
import signal
import subprocess
import sys
import threading
import time
import tomllib
import urllib.error
import urllib.request

import soak_report
from acts import all_acts
from misdeeds import all_misdeeds
from strangers import Strangers

SCENARIO = pathlib.Path(__file__).parent / "scenarios" / "soak.toml"
SCENES = {"park": 2, "square": 3}  # of the scenario, with their seeds
SAVED_SCENE = "hall.ply"  # that misdeeds.py saves
# Longer than a lost client's session is kept.
SETTLE_S = 40.0
SAMPLE_S, SCRAPE_S = 1.0, 5.0
ROUND_S = 300.0  # a round takes 50 s; one that hangs is ended

# Counters that nobody but the strangers may move.
NEVER = ("catgs_frames_failed_total", "catgs_bad_messages_total", "catgs_scene_loads_failed_total",
         "catgs_encoders_refused_total", "catgs_sessions_refused_total", "catgs_requests_refused_total",
         "catgs_streams_failed_total", "catgs_log_lines_lost_total")
GAUGES = ("catgs_sessions", "catgs_sessions_lost", "catgs_connections", "catgs_scenes_in_memory", "process_heap_bytes")
COUNTERS = ("catgs_sessions_admitted_total", "catgs_sessions_resumed_total", "catgs_frames_sent_total",
            "catgs_scenes_loaded_total", "catgs_scenes_released_total")


class Cannot(Exception):
    """The soak could not be run."""


def get(url: str) -> str:
    with urllib.request.urlopen(url, timeout=10) as answer:
        return answer.read().decode("utf-8")


def parse_metrics(text: str) -> dict[str, float]:
    """Name to value; the values of a name's labels are summed."""
    return {name: sum(one.get("value", 0.0) for one in series) for name, series in json.loads(text).items()}


def looked_at(metrics: dict[str, float]) -> dict[str, float]:
    """Those that are sampled. A name that the server no longer has would otherwise stand still for ever."""
    names = (*GAUGES, *COUNTERS, *NEVER)
    if missing := [name for name in names if name not in metrics]:
        raise Cannot(f"the server's /api/metrics lack {', '.join(missing)}")
    return {name: metrics[name] for name in names}


def moved(before: dict[str, float], after: dict[str, float], caused: collections.Counter[str]) -> list[str]:
    """What is wrong with the counters of NEVER. `caused`: by how much strangers moved them."""
    return [f"{name} grew by {after[name] - before[name]:.0f}, and strangers caused {caused[name]}"
            for name in NEVER if after[name] - before[name] != caused[name]]


def device_mb() -> float | None:
    """Memory in use on the first GPU; None where nvidia-smi cannot say."""
    if shutil.which("nvidia-smi") is None:
        return None
    result = subprocess.run(["nvidia-smi", "--query-gpu=memory.used", "--format=csv,noheader,nounits"],
                            capture_output=True, text=True, check=False)
    first = result.stdout.split("\n")[0].strip()
    return float(first) if result.returncode == 0 and first.isdigit() else None


class Process:
    """A running server, as /proc and /api/metrics show it."""

    def __init__(self, pid: int, admin: str):
        self.folder = pathlib.Path("/proc") / str(pid)
        self.admin = admin
        self.begin_s = self._begin_s()

    def _begin_s(self) -> float:
        """When it was started, seconds since the machine was."""
        try:
            fields = (self.folder / "stat").read_text("utf-8", "replace").rpartition(")")[2].split()
        except OSError as error:
            raise Cannot(f"the server's process cannot be read: {error}") from error
        return int(fields[19]) / 100.0  # field 22 of proc(5), in ticks of USER_HZ

    def alive(self) -> bool:
        try:
            return "State:\tZ" not in (self.folder / "status").read_text("utf-8")
        except OSError:
            return False

    def sample(self) -> dict[str, float]:
        status = (self.folder / "status").read_text("utf-8")

        def field(name: str) -> int:
            found = re.search(rf"^{name}:\s+(\d+)", status, re.MULTILINE)
            if found is None:  # of a process that has ended and was not waited for
                raise ProcessLookupError(f"{self.folder / 'status'} has no {name}")
            return int(found.group(1))

        uptime_s = float(pathlib.Path("/proc/uptime").read_text("ascii").split()[0])
        return {"at_s": round(uptime_s - self.begin_s, 2), "rss_mb": field("VmRSS") * 1024e-6,
                "descriptors": len(list((self.folder / "fd").iterdir())), "threads": field("Threads")}

    def metrics(self) -> dict[str, float]:
        return looked_at(parse_metrics(get(self.admin + "/api/metrics")))


class Sampler(threading.Thread):
    """Writes samples of the process until stop() or the end of the process."""

    def __init__(self, process: Process, path: pathlib.Path):
        super().__init__()
        self.process, self.path = process, path
        self.settling = False  # all clients have gone: shown, not judged
        self.stopped = threading.Event()

    def run(self) -> None:
        scraped = 0.0
        with self.path.open("a", encoding="utf-8") as file:
            while not self.stopped.wait(SAMPLE_S):
                try:
                    sample = self.process.sample() | ({"settling": 1} if self.settling else {})
                    if sample["at_s"] - scraped >= SCRAPE_S:
                        scraped = sample["at_s"]
                        sample |= self.process.metrics()
                        sample["heap_mb"] = 1e-6 * sample.pop("process_heap_bytes")
                        memory = device_mb()
                        sample |= {} if memory is None else {"device_mb": memory}
                except OSError:  # it ends, or is too busy to answer
                    if not self.process.alive():
                        return
                    continue
                file.write(json.dumps(sample) + "\n")
                file.flush()

    def stop(self) -> None:
        self.stopped.set()
        self.join()


def bad_lines(text: str, caused: collections.Counter[str], more: collections.Counter[str]) -> list[str]:
    """Of a log in either format: level warning and above. `caused`: warnings that have to be there, and
    how often; missing ones are reported, too. `more`: how many more of them may be there."""
    bad = []
    left = caused + more
    for line in text.splitlines():
        level, message = "error", line  # no line of ours: a sanitizer's, a library's
        if line.startswith("{"):
            said = json.loads(line)
            level, message = said["level"], said["message"]
        elif match := re.match(r"[\d:.]+ (?:\x1b\[\S*?m)?(\w+)(?:\x1b\[m)? (?:session \w+: )?(.*)", line):
            level, message = match.groups()
        message = re.sub(r" by link \w+(?=: )", "", message)  # whoever causes a warning does not know the id
        if level == "warning" and left[message] > 0:
            left[message] -= 1
        elif level not in ("debug", "info"):
            bad.append(line)
    return bad + [f"{count} lines too few: {message}" for message, count in (left - more).items()]


def make_scenes(program: pathlib.Path, folder: pathlib.Path) -> None:
    render = program.parent / "catgs-render"
    if not render.exists():
        raise Cannot(f"{render} is missing, which makes the scenes: ninja -C {program.parent.parent} catgs-render")
    (folder / "scenes").mkdir(parents=True, exist_ok=True)
    files = [(2000, 1, SAVED_SCENE), *((50_000, seed, f"scenes/{name}.ply") for name, seed in SCENES.items())]
    for gaussians, seed, file in files:
        subprocess.run([render, "synth", "city", "--gaussians", str(gaussians), "--seed", str(seed), folder / file],
                       check=True, stdout=subprocess.DEVNULL)


def make_link(program: pathlib.Path, key: pathlib.Path) -> str:
    """An author's, who may save every scene."""
    key.write_text(secrets.token_hex(32), "utf-8")
    said = subprocess.run([program.parent / "catgs-server", "token", "--role", "author", "--expires", "30d",
                           "--token-key-file", key], check=True, capture_output=True, text=True)
    return said.stdout.strip()


def start_server(program: pathlib.Path, out: pathlib.Path) -> tuple[subprocess.Popen, str, str, str]:
    """The process, its address for clients, its admin address and an author's link."""
    make_scenes(program, out)
    link = make_link(program, out / "key")
    arguments = [*tomllib.loads(SCENARIO.read_text("utf-8"))["server"]["args"], "--scene", SAVED_SCENE,
                 "--token-key-file", "key"]
    log = out / "server.log"
    with log.open("wb") as file:
        # pylint: disable=consider-using-with
        server = subprocess.Popen([program.parent / "catgs-server", *arguments, "--port", "0", "--admin-bind",
                                   "127.0.0.1:0", "--log-format", "json"], cwd=out, stdout=file, stderr=file)
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline and server.poll() is None:
        text = log.read_text("utf-8")
        admin = re.search(r"metrics: (http://[\d.:]+)/", text)
        port = re.search(r"open http://([\d.:]+)/", text)
        if admin and port:
            return server, f"ws://{port.group(1)}", admin.group(1), link
        time.sleep(0.1)
    server.kill()
    raise Cannot(f"the server does not serve: {log}")


def one_round(command: list[str], number: int, out: pathlib.Path, rest: list[str]) -> list[str]:
    """Runs the scenario once, and kills a further generator somewhere in it. Returns what failed."""
    with (out / "last_round.txt").open("wb") as file, subprocess.Popen(
            [*command, "--scenario", SCENARIO, *rest], stdout=file, stderr=file) as load, subprocess.Popen(
            [*command, "--sessions", "2", "--size", "160x90", "--fps", "12", "--script", "walk", "--ramp", "3s",
             "--duration", "300s"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL) as killed:
        try:
            time.sleep(random.Random(number).uniform(2.0, 30.0))
        finally:
            killed.send_signal(signal.SIGKILL)
        try:
            status = load.wait(ROUND_S)
        except subprocess.TimeoutExpired:
            load.kill()
            return [f"round {number}: has not ended after {ROUND_S:.0f} s"]
    if status == 0:
        return []
    text = (out / "last_round.txt").read_text("utf-8", "replace")
    failed = [line for line in text.splitlines() if "requirement failed" in line] or [text[-500:]]
    return [f"round {number}: {line}" for line in failed]


def churn(arguments: argparse.Namespace, sampler: Sampler, strangers: Strangers, url: str) -> tuple[int, list[str]]:
    """Rounds until the time is over, and then silence until all that was kept for clients is gone."""
    errors: list[str] = []
    process = sampler.process
    command = [str(arguments.program), "--url", url]
    end = time.monotonic() + 60.0 * arguments.minutes - SETTLE_S
    rounds = 0
    with strangers:
        while process.alive() and (rounds == 0 or time.monotonic() < end):
            rounds += 1
            errors += one_round(command, rounds, arguments.out, arguments.rest)
            if process.alive():
                told = process.sample() | {"misdeeds": sum(strangers.done().values())}
                print(f"round {rounds}: {json.dumps(told)}", flush=True)
        sampler.settling = True
        settled = time.monotonic() + SETTLE_S
    time.sleep(max(0.0, settled - time.monotonic()))
    return rounds, errors + strangers.errors()


def look_after(process: Process, before: dict[str, float], caused: collections.Counter[str]) -> list[str]:
    """What is left when all have gone, and what was counted wrongly."""
    if not process.alive():
        return ["the server has ended"]
    metrics = process.metrics()
    left = [f"{name} is {metrics[name]:.0f} after all have gone" for name in ("catgs_sessions", "catgs_connections")
            if metrics[name] != 0]
    return left + moved(before, metrics, caused)


def begin(path: pathlib.Path, process: Process, log: pathlib.Path | None) -> dict:
    """The first line of the samples: what the process had behind it when the first run with it began.
    Samples and misdeeds of another process are forgotten."""
    lines = path.read_text("utf-8").splitlines() if path.exists() else []
    first = json.loads(lines[0]) if lines else {}
    if (first.get("process"), first.get("begin_s")) != (process.folder.name, process.begin_s):
        first = {"process": process.folder.name, "begin_s": process.begin_s, "metrics": process.metrics(),
                 "log_bytes": log.stat().st_size if log else 0}
        path.write_text(json.dumps(first) + "\n", "utf-8")
        misdeeds_of(path).unlink(missing_ok=True)
    return first


def misdeeds_of(samples: pathlib.Path) -> pathlib.Path:
    return samples.with_name("misdeeds.txt")


def read_samples(path: pathlib.Path) -> list[dict[str, float]]:
    """Those of earlier runs with the same process, too."""
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()[1:]]


def write_page(arguments: argparse.Namespace, document: dict) -> None:
    """Plots of the samples, if the web client was built."""
    for folder in ("share/catgs/web", "web_client/dist"):
        page = arguments.program.parent.parent / folder / "charts.html"
        if page.exists():
            text = json.dumps(document).replace("</", "<\\/")
            html = page.read_text("utf-8").replace('id="document">', f'id="document">{text}', 1)
            (arguments.out / "soak.html").write_text(html, "utf-8")


def soak(arguments: argparse.Namespace) -> bool:
    arguments.out.mkdir(parents=True, exist_ok=True)
    server, link = None, ""
    log = arguments.server_log
    if arguments.attach is None:
        server, url, admin, link = start_server(arguments.program, arguments.out)
        os.environ["CATGS_TOKEN"] = link  # of the generators
        log = arguments.out / "server.log"
    else:
        url, admin = arguments.url, arguments.admin
    try:
        process = Process(server.pid if server else arguments.attach, admin)
        samples_file = arguments.out / "samples.jsonl"
        first = begin(samples_file, process, log)
        strangers = Strangers(url, misdeeds_of(samples_file), all_misdeeds(link), acts=all_acts(link))
        sampler = Sampler(process, samples_file)
        sampler.start()
        try:
            rounds, errors = churn(arguments, sampler, strangers, url)
            errors += look_after(process, first["metrics"], strangers.moves())
        finally:
            sampler.stop()
    finally:
        if server:
            server.terminate()
            status = server.wait(timeout=60)
    if server and status != 0:
        errors.append(f"the server ended with {status}")
    if log:
        # All of it where the server is ours: what it said while it started counts.
        text = log.read_bytes()[0 if server else first["log_bytes"]:].decode("utf-8", "replace")
        errors += [f"log: {line}" for line in bad_lines(text, strangers.lines(), strangers.more_lines())]
    samples = read_samples(samples_file)
    warm_up_s = None if arguments.warm_up is None else 60.0 * arguments.warm_up
    report = soak_report.judge(samples, warm_up_s) | {"rounds": rounds, "errors": errors, "misdeeds": strangers.done()}
    (arguments.out / "soak.json").write_text(json.dumps(report, indent=2) + "\n", "utf-8")
    write_page(arguments, soak_report.chart_document(report, samples))
    print(soak_report.to_text(report))
    return report["flat"] and not errors


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--minutes", type=float, default=60.0)
    parser.add_argument("--warm-up", type=float, metavar="MINUTES", help="that are not judged (see soak_report.py)")
    parser.add_argument("--program", type=pathlib.Path, default=pathlib.Path("build/release/bin/catgs-load"))
    parser.add_argument("--out", type=pathlib.Path, default=pathlib.Path("build/soak"))
    parser.add_argument("--attach", type=int, metavar="PID")
    parser.add_argument("--url", help="of the server that --attach names")
    parser.add_argument("--admin", default="http://127.0.0.1:9090", help="its admin address (default: %(default)s)")
    parser.add_argument("--server-log", type=pathlib.Path, help="its log, whose lines are judged")
    own, rest = sys.argv[1:], []
    if "--" in own:
        own, rest = own[:own.index("--")], own[own.index("--") + 1:]
    arguments = parser.parse_args(own)
    if (arguments.attach is None) != (arguments.url is None):
        parser.error("--attach and --url belong together")
    arguments.rest = rest
    arguments.program = arguments.program.resolve()
    arguments.out = arguments.out.resolve()
    try:
        return 0 if soak(arguments) else 1
    except (Cannot, OSError, subprocess.CalledProcessError) as error:
        print(f"soak.py: {error}", file=sys.stderr)
        return 2


if __name__ == "__main__":
    sys.exit(main())
