#!/usr/bin/env python3
"""report.py against small real CTest runs, and discover_tests.cmake against what a program lists."""

import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import report

FOLDER = pathlib.Path(__file__).parent
PASSING = 'add_test(passes "/bin/true")\n'
SKIPPED = ('add_test(skips "/bin/sh" "-c" "echo SKIPPED: no such device; exit 77")\n'
           'set_tests_properties(skips PROPERTIES SKIP_RETURN_CODE 77)\n')
FAILING = 'add_test(fails "/bin/sh" "-c" "echo the reason; exit 1")\n'
UNSTEADY = 'add_test(unsteady "/bin/sh" "-c" "test -e tried || { : > tried; exit 1; }")\n'
MISSING = 'add_test(missing "/nonexistent/program")\n'
# As GoogleTest 1.12 writes it.
SUITE_XML = """<testsuites tests="4"><testsuite name="A" tests="4">
<testcase name="Passes" status="run" result="completed" classname="A" />
<testcase name="Fails" status="run" result="completed" classname="A">
  <failure message="a.cpp:1&#x0A;why" type=""><![CDATA[a.cpp:1
why]]></failure>
</testcase>
<testcase name="Skips" status="run" result="skipped" classname="A">
  <skipped message="a.cpp:2&#x0A;no such device"><![CDATA[]]></skipped>
</testcase>
<testcase name="DISABLED_B" status="notrun" result="suppressed" classname="A" />
</testsuite></testsuites>"""
PASSED_XML = ('<testsuites><testsuite><testcase name="Fails" status="run" classname="A" />'
              '<testcase name="Passes" status="run" classname="A" /></testsuite></testsuites>')
FAILED_CASE = ["[ RUN      ] A.Passes", "[       OK ] A.Passes (0 ms)", "[ RUN      ] A.Fails", "what it printed",
               "a.cpp:1: Failure", "[  FAILED  ] A.Fails, where GetParam() = 1 (0 ms)", "[ RUN      ] A.Skips",
               "[  SKIPPED ] A.Skips (0 ms)"]


class Run(unittest.TestCase):
    def setUp(self):
        temporary = tempfile.TemporaryDirectory()
        self.addCleanup(temporary.cleanup)
        self.folder = pathlib.Path(temporary.name)
        self.record = self.folder / "cache/catgs/unsteady-tests.json"

    def script(self, name, *commands):
        path = self.folder / name
        path.write_text("\n".join(["#!/bin/sh", *commands]) + "\n")
        path.chmod(0o755)
        return path

    def suite(self, output, result="", status=0):
        """A CTest test that prints, leaves a GoogleTest result, and ends as such a program does."""
        (self.folder / "output").write_text("\n".join(output) + "\n")
        (self.folder / "result").write_text(result)
        leave = "mkdir -p suites; cp result suites/test_a.A.xml" if result else ":"
        self.script("program", "cat output", leave, f"exit {status}" if status >= 0 else "kill -SEGV $$")
        return 'add_test(test_a.A "./program")\n'

    def report(self, tests):
        (self.folder / "CTestTestfile.cmake").write_text(tests)
        with open(self.folder / "the.log", "w") as log:
            subprocess.run(["ctest", "--test-dir", self.folder, "--repeat", "until-pass:2", "--output-on-failure",
                            "--output-junit", self.folder / "tests.xml"],
                           stdout=log, stderr=subprocess.STDOUT, check=False)
        return subprocess.run(
            [sys.executable, "-B", FOLDER / "report.py", "tests.xml", "suites", "the.log"], cwd=self.folder,
            env={**os.environ, "XDG_CACHE_HOME": str(self.folder / "cache")},
            capture_output=True, text=True, check=False)


class Report(Run):
    def test_skips_are_listed_with_their_reason_and_do_not_fail(self):
        result = self.report(PASSING + SKIPPED)
        self.assertEqual(result.returncode, 0, result.stdout)
        self.assertIn("skips: no such device", result.stdout)
        self.assertIn("1 tests passed, 0 failed, 1 skipped of 2", result.stdout)

    def test_many_skips_for_one_reason_are_one_line(self):
        tests = "".join(SKIPPED.replace("skips", f"skips{i}") for i in range(5))
        result = self.report(PASSING + tests)
        self.assertIn("skips0, skips1, skips2 and 2 more: no such device", result.stdout)
        self.assertIn("5 skipped of 6", result.stdout)

    def test_failures_show_their_output(self):
        result = self.report(PASSING + FAILING)
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILED fails", result.stdout)
        self.assertIn("the reason", result.stdout)

    def test_a_second_try_that_passes_is_named(self):
        for failing in ("exit 1", "kill -ABRT  $$", "kill -SEGV $$"):
            tests = UNSTEADY.replace("exit 1", failing).replace("unsteady", f"unsteady{len(failing)}")
            (self.folder / "tried").unlink(missing_ok=True)
            result = self.report(PASSING + SKIPPED + tests)
            self.assertEqual(result.returncode, 0, result.stdout)
            self.assertRegex(result.stdout, r"Passed at the second try only, 1: unsteady\d+\n")
            self.assertIn("2 tests passed, 0 failed, 1 skipped of 3", result.stdout)

    def test_a_second_pass_at_the_second_try_within_a_week_is_a_failure(self):
        self.report(UNSTEADY)
        (self.folder / "tried").unlink()
        result = self.report(PASSING + UNSTEADY)
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILED unsteady", result.stdout)
        self.assertIn("1 tests passed, 1 failed, 0 skipped of 2", result.stdout)
        self.assertEqual(self.report(UNSTEADY).returncode, 0)

    def test_a_program_that_is_not_there_is_a_failure(self):
        result = self.report(PASSING + MISSING)
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILED missing", result.stdout)

    def test_a_run_that_left_no_result_is_a_failure(self):
        result = subprocess.run([sys.executable, "-B", FOLDER / "report.py", "/nonexistent/tests.xml", "suites",
                                 "the.log"], capture_output=True, text=True, check=False)
        self.assertEqual(result.returncode, 1)
        self.assertIn("the.log", result.stderr)


class Suites(Run):
    def test_cases_are_counted_and_the_failed_ones_shown(self):
        result = self.report(PASSING + self.suite(FAILED_CASE, SUITE_XML, 1))
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILED A.Fails\n    what it printed\n    a.cpp:1: Failure\n\n", result.stdout)
        self.assertIn("    A.Skips: no such device\n    A.DISABLED_B: disabled\n", result.stdout)
        self.assertIn("2 tests passed, 1 failed, 2 skipped of 5", result.stdout)

    def test_a_failure_shows_its_result_where_the_output_is_cut(self):
        result = self.report(self.suite([], SUITE_XML, 1))
        self.assertIn("FAILED A.Fails\n    a.cpp:1\n    why\n", result.stdout)

    def test_bytes_that_are_no_text_hide_no_case(self):
        tests = self.suite([], SUITE_XML, 1)
        (self.folder / "result").write_bytes(SUITE_XML.replace("why]]", "caf\xe9]]").encode("latin-1"))
        self.assertIn("1 tests passed, 1 failed, 2 skipped of 4", self.report(tests).stdout)

    def test_a_program_that_ends_inside_a_case_fails_there(self):
        result = self.report(self.suite([*FAILED_CASE, "[ RUN      ] A.Ends", "last words"], status=-1))
        self.assertEqual(result.returncode, 1)
        self.assertRegex(result.stdout, r"FAILED A\.Ends\n    Exception: SegFault\n(    .*\n)+    last words\n")
        self.assertIn("1 tests passed, 2 failed, 1 skipped of 4", result.stdout)

    def test_a_program_that_ends_early_without_an_error_is_a_failure(self):
        result = self.report(self.suite(["[ RUN      ] A.Ends"]))
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILED A.Ends\n    ended before its last test\n", result.stdout)

    def test_a_suite_that_fails_outside_its_cases_is_a_failure(self):
        result = self.report(self.suite(["[  FAILED  ] A: SetUpTestSuite or TearDownTestSuite"], PASSED_XML, 1))
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILED test_a.A\n", result.stdout)
        self.assertIn("2 tests passed, 1 failed, 0 skipped of 3", result.stdout)

    def test_the_case_that_needed_a_second_try_is_named(self):
        tests = self.suite(FAILED_CASE, PASSED_XML)
        self.script("program", "cat output; mkdir -p suites; cp result suites/test_a.A.xml",
                    "test -e tried || { : > tried; exit 1; }")
        result = self.report(tests)
        self.assertEqual(result.returncode, 0, result.stdout)
        self.assertIn("Passed at the second try only, 1: A.Fails\n", result.stdout)
        self.assertIn("2 tests passed, 0 failed, 0 skipped of 2", result.stdout)


class UnsteadyRecord(Run):
    now_s = 1e9

    def record_at(self, days, *names):
        return report.record_unsteady(self.record, list(names), self.now_s + days * 24 * 3600)

    def test_twice_within_a_week_is_repeated(self):
        self.assertEqual(self.record_at(0, "a", "b"), [])
        self.assertEqual(self.record_at(6.9, "a", "c"), ["a"])

    def test_a_week_later_it_is_forgotten(self):
        self.record_at(0, "a")
        self.assertEqual(self.record_at(7.1, "a"), [])

    def test_it_is_bounded(self):
        for day in range(3):
            self.record_at(day, *(f"{day}.{i}" for i in range(report.MAX_REMEMBERED)))
        self.assertEqual(len(json.loads(self.record.read_text())), report.MAX_REMEMBERED)
        self.assertEqual(self.record_at(3, "0.0", "2.0"), ["2.0"])

    def test_a_damaged_record_begins_anew(self):
        for damaged in ("", "{", "[1]", '{"a": "yesterday"}', '{"a": 1e999}', '{"a": 1' + "0" * 400 + "}", "[" * 99999,
                        '{"a": 99999999999}', "\0\xff", " " * (2 * report.MAX_RECORD_BYTES)):
            with self.subTest(damaged[:20]):
                self.record.parent.mkdir(parents=True, exist_ok=True)
                self.record.write_text(damaged, encoding="latin-1")
                self.assertEqual(self.record_at(0, "a"), [])
                self.assertEqual(self.record_at(1, "a"), ["a"])

    def test_a_folder_that_cannot_be_written_is_no_failure(self):
        self.record.mkdir(parents=True)
        self.assertEqual(self.record_at(0, "a"), [])
        self.assertEqual([path.name for path in self.record.parent.iterdir()], [self.record.name])
        self.record = self.record / "below" / "unsteady-tests.json"
        (self.record.parent).write_text("a file where a folder should be")
        self.assertEqual(self.record_at(0, "a"), [])


class Discovery(Run):
    listed = ["Running main() from gtest_main.cc", "Plain.", "  A", "  B", "Typed/0.  # TypeParam = std::vector<int>",
              "  A", "In/P.", '  Holds/first  # GetParam() = "a;b[. c"', "  Holds/second  # GetParam() = x.y"]

    def discover(self, *settings):
        """The tests by name that ctest knows of a program with these suites."""
        program = self.script("program", "cat <<'LIST'", *self.listed, "LIST")
        subprocess.run(["cmake", f"-DPROGRAM={program}", f"-DFILE={self.folder}/CTestTestfile.cmake",
                        f"-DFOLDER={self.folder}", "-DLABELS=unit", "-DTIMEOUT=60", *settings,
                        "-P", FOLDER / "discover_tests.cmake"], check=True, capture_output=True)
        listed = subprocess.run(["ctest", "--test-dir", self.folder, "--show-only=json-v1"], check=True,
                                capture_output=True, text=True)
        return {test["name"]: test for test in json.loads(listed.stdout)["tests"]}

    def test_a_suite_is_a_test(self):
        tests = self.discover("-DNAME=test_a", f"-DRESULTS={self.folder}/suites")
        self.assertEqual(list(tests), ["test_a.Plain", "test_a.Typed/0", "test_a.In/P"])
        self.assertEqual(tests["test_a.In/P"]["command"][1:],
                         ["--gtest_filter=In/P.*", f"--gtest_output=xml:{self.folder}/suites/test_a.In/P.xml"])
        properties = {entry["name"]: entry["value"] for entry in tests["test_a.Plain"]["properties"]}
        self.assertEqual((properties["LABELS"], properties["TIMEOUT"]), (["unit"], 60))

    def test_a_long_suite_starts_first_and_in_parts(self):
        tests = self.discover("-DNAME=test_a", "-DLONG=In/P,Plain:2")
        self.assertEqual(list(tests), ["test_a.Plain.1of2", "test_a.Plain.2of2", "test_a.Typed/0", "test_a.In/P"])
        properties = {entry["name"]: entry["value"] for entry in tests["test_a.Plain.2of2"]["properties"]}
        self.assertEqual(properties["ENVIRONMENT"], ["GTEST_TOTAL_SHARDS=2", "GTEST_SHARD_INDEX=1"])
        self.assertEqual(properties["COST"], 100)

    def test_a_parameter_is_a_test(self):
        tests = self.discover("-DNAME=smoke", "-DPARAMETERS_OF=*.Holds/*", "-DENVIRONMENT=A=1")
        self.assertEqual(list(tests), ["smoke.first", "smoke.second"])
        self.assertEqual(tests["smoke.second"]["command"][1:], ["--gtest_filter=*.Holds/second"])

    def test_a_program_that_lists_nothing_ends_the_build(self):
        self.listed = self.listed[:1]
        for filtered in ("", "*.Gone/*"):
            with self.assertRaises(subprocess.CalledProcessError):
                self.discover("-DNAME=test_a", f"-DPARAMETERS_OF={filtered}")


if __name__ == "__main__":
    unittest.main()
