#!/usr/bin/env python3
"""usage: report.py JUNIT_XML SUITES LOG

Prints what a CTest run left to know: the failed tests with the end of their output, those that
passed at their second try only, the skipped ones with their reason, the summary line. Exit status 1
when a test failed or no run was recorded. LOG holds what CTest printed. A CTest test test_PROGRAM.SUITE
left a GoogleTest result of that name in the folder SUITES: its cases are counted, not the suite.

A test that passed at its second try only is remembered for a week in unsteady-tests.json of the
user's cache folder. The second such pass within the week counts as a failure.
"""

import contextlib
import json
import os
import pathlib
import re
import sys
import time
import xml.etree.ElementTree as ElementTree
from typing import NamedTuple

OUTPUT_LINES = 15
# Scripts print "SKIPPED: reason".
SKIP_REASON = re.compile(r"SKIPPED: (.+)")
# The JUnit file records the last try alone, and no signal; CTest's terminal output has a line of each.
FAILED_TRY = re.compile(r"Test +#\d+: (\S+) \.*([^.*]*\*\*\*(?!Skipped|Not Run).*?) +[\d.]+ sec")
GTEST_SUITE = re.compile(r"test_\w+\.")
GTEST_BEGIN = re.compile(r"^\[ RUN      \] (\S+)$", re.MULTILINE)
GTEST_END = re.compile(r"\[ +(OK|FAILED|SKIPPED) +\] ([^\s,]+).* \(\d+ ms\)$", re.MULTILINE)
WEEK_S = 7 * 24 * 3600
MAX_REMEMBERED = 200
MAX_RECORD_BYTES = 1 << 20


class Case(NamedTuple):
    name: str
    status: str  # passed, failed, skipped
    lines: list[str] = []  # the end of a failed case's output, or why it was skipped


def output_of(case: str, output: str) -> list[str]:
    """What a GoogleTest program printed during a case."""
    begin = output.find(f"[ RUN      ] {case}\n")
    if begin < 0:
        return []
    end = GTEST_END.search(output, begin)
    return output[begin:end.start() if end else None].splitlines()[1:]


def suite_cases(path: pathlib.Path, output: str) -> list[Case]:
    """The cases of a GoogleTest result; none where the program ended before it wrote one."""
    try:
        found = ElementTree.fromstring(path.read_text("utf-8", "replace")).iter("testcase")
    except (OSError, ElementTree.ParseError):
        return []
    cases = []
    for case in found:
        name = f"{case.get('classname')}.{case.get('name')}"
        failures, skipped = case.findall("failure"), case.find("skipped")
        if failures:
            lines = output_of(name, output) or "\n".join(failure.text or "" for failure in failures).splitlines()
            cases.append(Case(name, "failed", lines[-OUTPUT_LINES:]))
        elif case.get("status") == "notrun":
            cases.append(Case(name, "skipped", ["disabled"]))
        elif skipped is not None:
            cases.append(Case(name, "skipped", (skipped.get("message") or "").split("\n", 1)[1:]))
        else:
            cases.append(Case(name, "passed"))
    return cases


def interrupted_cases(name: str, output: str, message: str) -> list[Case]:
    """The cases of a GoogleTest program that wrote no result, and the one in which it ended."""
    cases = [Case(case, {"OK": "passed", "FAILED": "failed"}.get(status, "skipped"),
                  output_of(case, output)[-OUTPUT_LINES:] if status == "FAILED" else [])
             for status, case in GTEST_END.findall(output)]
    begun = GTEST_BEGIN.findall(output)
    inside = begun[-1] if begun and all(case.name != begun[-1] for case in cases) else name
    return [*cases, Case(inside, "failed", [message, *output.splitlines()[-OUTPUT_LINES:]])]


def cases_of(test: ElementTree.Element, suites: pathlib.Path, end: str) -> list[Case]:
    """What a CTest test counts for: the cases of its GoogleTest suite, or itself. `end`: how its last try failed."""
    name, status, output = test.get("name"), test.get("status"), test.findtext("system-out") or ""
    skipped = test.find("skipped")
    message = skipped.get("message") if skipped is not None else end
    # A test whose program is missing is "notrun" as well; only a declared skip is no failure.
    if message.startswith("SKIP_") or status == "disabled":
        reason = SKIP_REASON.search(output)
        return [Case(name, "skipped", [reason.group(1)] if reason else [])]
    if GTEST_SUITE.match(name) and status in ("run", "fail"):
        cases = suite_cases(suites / f"{name}.xml", output)
        if not cases:
            return interrupted_cases(name, output, message if status == "fail" else "ended before its last test")
        if status == "run" or any(case.status == "failed" for case in cases):
            return cases
        return [*cases, Case(name, "failed", [message, *output.splitlines()[-OUTPUT_LINES:]])]
    if status == "run":
        return [Case(name, "passed")]
    return [Case(name, "failed", [message, *output.splitlines()[-OUTPUT_LINES:]])]


def unsteady_names(test: str, cases: list[Case], log: str) -> list[str]:
    """The cases of a CTest test that failed at the first try, when the second one passed."""
    if any(case.status == "failed" for case in cases):
        return []
    failed = {name for status, name in GTEST_END.findall(log) if status == "FAILED"}
    return [case.name for case in cases if case.name in failed] or [test]


def record_file() -> pathlib.Path:
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    return pathlib.Path(cache) / "catgs" / "unsteady-tests.json"


def record_unsteady(path: pathlib.Path, names: list[str], now_s: float) -> list[str]:
    """Remembers that these tests were unsteady now. Returns those that were so within the last week."""
    known = {}
    try:
        with open(path, encoding="utf-8") as file:
            read = json.loads(file.read(MAX_RECORD_BYTES))
        known = {name: then for name, then in read.items()
                 if isinstance(then, (int, float)) and 0 <= now_s - then <= WEEK_S}
    except (OSError, ValueError, AttributeError, ArithmeticError, RecursionError):
        pass  # no record yet, or a damaged one: it begins anew
    repeated = [name for name in names if name in known]
    known.update((name, int(now_s)) for name in names)
    newest = sorted(known.items(), key=lambda item: -item[1])[:MAX_REMEMBERED]
    part = path.with_name(f"{path.name}.{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        part.write_text(json.dumps(dict(newest), indent=1), encoding="utf-8")
        part.replace(path)
    except OSError as error:
        with contextlib.suppress(OSError):
            part.unlink()
        print(f"\nUnsteady tests are not remembered: {error}")
    return repeated


def group_by_reason(skipped: list[Case]) -> dict:
    groups = {}
    for case in skipped:
        reason = " ".join("\n".join(case.lines).split())
        groups.setdefault(reason or "no reason given", []).append(case.name)
    return groups


def main() -> int:
    results, suites, log = (pathlib.Path(argument) for argument in sys.argv[1:4])
    if not results.is_file():
        print(f"CTest recorded no result. The whole log: {log}", file=sys.stderr)
        return 1
    run = ElementTree.parse(results).getroot()
    log_text = log.read_text(errors="replace")
    failed_try = {name: end.replace("***", " ").strip(" :") for name, end in FAILED_TRY.findall(log_text)}
    all_cases, unsteady = [], []
    for test in run.iter("testcase"):
        cases = cases_of(test, suites, failed_try.get(test.get("name"), ""))
        all_cases += cases
        if test.get("name") in failed_try:
            unsteady += unsteady_names(test.get("name"), cases, log_text)
    repeated = record_unsteady(record_file(), unsteady, time.time()) if unsteady else []
    all_cases = [case for case in all_cases if case.name not in repeated]
    all_cases += [Case(name, "failed", ["passed at the second try only, for the second time in a week"])
                  for name in repeated]
    failed = [case for case in all_cases if case.status == "failed"]
    skipped = [case for case in all_cases if case.status == "skipped"]
    for case in failed:
        print(f"\nFAILED {case.name}")
        print("\n".join(f"    {line}" for line in case.lines))
    if unsteady:
        print(f"\nPassed at the second try only, {len(unsteady)}: {', '.join(unsteady)}")
    if skipped:
        print(f"\nSkipped, {len(skipped)}:")
        for reason, names in group_by_reason(skipped).items():
            more = f" and {len(names) - 3} more" if len(names) > 3 else ""
            print(f"    {', '.join(names[:3])}{more}: {reason}")
    total = len(all_cases)
    print(f"\n{total - len(failed) - len(skipped)} tests passed, {len(failed)} failed, "
          f"{len(skipped)} skipped of {total} in {float(run.get('time')):.0f} s. Log: {log}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
