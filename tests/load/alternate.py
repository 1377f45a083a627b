#!/usr/bin/env python3
"""Runs a scenario with and without some of its clients, in turn, and compares medians.

  alternate.py SCENARIO --without stalled slow flood [--metric good.pose_to_frame_p95_ms] [--runs 5]
               [--program build/release/bin/catgs-load] [--max-percent 10] [--max-ms 2]
               [-- further arguments of catgs-load]

Exit status: 0 the medians differ by at most --max-percent or --max-ms, whichever is more; 1 they
differ by more; 2 a run failed.
"""

import argparse
import json
import pathlib
import statistics
import subprocess
import sys
import tempfile


def measure(arguments: argparse.Namespace, without: list[str]) -> float:
    """The metric of one run."""
    with tempfile.TemporaryDirectory() as folder:
        report = pathlib.Path(folder) / "report.json"
        command = [arguments.program, "--scenario", arguments.scenario, "--json", str(report),
                   "--server-log", str(pathlib.Path(folder) / "server.log"), *arguments.rest]
        if without:
            command += ["--without", *without]
        result = subprocess.run(command, stdout=subprocess.DEVNULL, check=False)
        if result.returncode not in (0, 1):
            sys.exit(2)
        return json.loads(report.read_text("utf-8"))["metrics"][arguments.metric]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__,
                                     formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("scenario")
    parser.add_argument("--without", nargs="+", required=True, metavar="GROUP")
    parser.add_argument("--metric", default="good.pose_to_frame_p95_ms")
    parser.add_argument("--runs", type=int, default=5)
    parser.add_argument("--program", default="build/release/bin/catgs-load")
    parser.add_argument("--max-percent", type=float, default=10.0)
    parser.add_argument("--max-ms", type=float, default=2.0)
    own, rest = sys.argv[1:], []
    if "--" in own:
        own, rest = own[:own.index("--")], own[own.index("--") + 1:]
    arguments = parser.parse_args(own)
    arguments.rest = rest

    with_all, without = [], []
    for run in range(arguments.runs):
        with_all.append(measure(arguments, []))
        without.append(measure(arguments, arguments.without))
        print(f"run {run + 1}: {with_all[-1]:.2f} with, {without[-1]:.2f} without", flush=True)
    change = statistics.median(with_all) - statistics.median(without)
    allowed = max(arguments.max_ms, arguments.max_percent / 100 * statistics.median(without))
    print(f"median of {arguments.metric}: {statistics.median(with_all):.2f} with, "
          f"{statistics.median(without):.2f} without; changed by {change:.2f}, allowed {allowed:.2f}")
    return 0 if change <= allowed else 1


if __name__ == "__main__":
    sys.exit(main())
