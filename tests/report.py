#!/usr/bin/env python3
"""usage: report.py JUNIT_XML LOG

Prints what a CTest run left to know: the failed tests with the end of their output, those that
passed at their second try only, the skipped ones with their reason, the summary line. Exit status 1
when a test failed or no run was recorded. LOG holds what CTest printed.
"""

import pathlib
import re
import sys
import xml.etree.ElementTree as ElementTree

OUTPUT_LINES = 15
# GoogleTest prints "file:line: Skipped" and the reason below it; scripts print "SKIPPED: reason".
SKIP_REASON = re.compile(r"(?:: Skipped\n|SKIPPED: )(.+)")
# The JUnit file records the last try alone; CTest's terminal output has a line of each.
FAILED_TRY = re.compile(r"Test +#\d+: (.+?) \.*\*\*\*(?!Skipped|Not Run)")


def skip_reason(output: str) -> str:
    match = SKIP_REASON.search(output)
    return match.group(1).strip() if match else "no reason given"


def group_by_reason(skipped: list) -> dict:
    groups = {}
    for name, reason in skipped:
        groups.setdefault(reason, []).append(name)
    return groups


def main() -> int:
    results, log = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
    if not results.is_file():
        print(f"CTest recorded no result. The whole log: {log}", file=sys.stderr)
        return 1
    suite = ElementTree.parse(results).getroot()
    failed_try = set(FAILED_TRY.findall(log.read_text(errors="replace")))
    failed, skipped, unsteady = [], [], []
    for case in suite.iter("testcase"):
        output = case.findtext("system-out") or ""
        # A test whose program is missing is "notrun" as well; only a declared skip is no failure.
        message = case.find("skipped").get("message") if case.find("skipped") is not None else ""
        if message.startswith("SKIP_") or case.get("status") == "disabled":
            skipped.append((case.get("name"), skip_reason(output)))
        elif case.get("status") != "run":
            failed.append((case.get("name"), [message, *output.splitlines()[-OUTPUT_LINES:]]))
        elif case.get("name") in failed_try:
            unsteady.append(case.get("name"))
    for name, lines in failed:
        print(f"\nFAILED {name}")
        print("\n".join(f"    {line}" for line in lines))
    if unsteady:
        print(f"\nPassed at the second try only, {len(unsteady)}: {', '.join(unsteady)}")
    if skipped:
        print(f"\nSkipped, {len(skipped)}:")
        for reason, names in group_by_reason(skipped).items():
            more = f" and {len(names) - 3} more" if len(names) > 3 else ""
            print(f"    {', '.join(names[:3])}{more}: {reason}")
    total = int(suite.get("tests"))
    print(f"\n{total - len(failed) - len(skipped)} tests passed, {len(failed)} failed, "
          f"{len(skipped)} skipped of {total} in {float(suite.get('time')):.0f} s. Log: {log}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
