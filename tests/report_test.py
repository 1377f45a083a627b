#!/usr/bin/env python3
"""report.py against a small real CTest run: one test of each outcome."""

import pathlib
import subprocess
import sys
import tempfile
import unittest

REPORT = str(pathlib.Path(__file__).with_name("report.py"))
PASSING = 'add_test(passes "/bin/true")\n'
SKIPPED = ('add_test(skips "/bin/sh" "-c" "echo SKIPPED: no such device; exit 77")\n'
           'set_tests_properties(skips PROPERTIES SKIP_RETURN_CODE 77)\n')
FAILING = 'add_test(fails "/bin/sh" "-c" "echo the reason; exit 1")\n'
UNSTEADY = 'add_test(unsteady "/bin/sh" "-c" "test -e tried || { : > tried; exit 1; }")\n'
MISSING = 'add_test(missing "/nonexistent/program")\n'


class Report(unittest.TestCase):
    def report(self, tests):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder)
            (path / "CTestTestfile.cmake").write_text(tests)
            with open(path / "the.log", "w") as log:
                subprocess.run(["ctest", "--test-dir", folder, "--repeat", "until-pass:2",
                                "--output-junit", folder + "/tests.xml"],
                               stdout=log, stderr=subprocess.STDOUT, check=False)
            return subprocess.run(
                [sys.executable, "-B", REPORT, folder + "/tests.xml", folder + "/the.log"],
                capture_output=True, text=True, check=False)

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
        result = self.report(PASSING + SKIPPED + UNSTEADY)
        self.assertEqual(result.returncode, 0, result.stdout)
        self.assertIn("Passed at the second try only, 1: unsteady\n", result.stdout)
        self.assertIn("2 tests passed, 0 failed, 1 skipped of 3", result.stdout)

    def test_a_program_that_is_not_there_is_a_failure(self):
        result = self.report(PASSING + MISSING)
        self.assertEqual(result.returncode, 1)
        self.assertIn("FAILED missing", result.stdout)

    def test_a_run_that_left_no_result_is_a_failure(self):
        result = subprocess.run([sys.executable, "-B", REPORT, "/nonexistent/tests.xml", "the.log"],
                                capture_output=True, text=True, check=False)
        self.assertEqual(result.returncode, 1)
        self.assertIn("the.log", result.stderr)


if __name__ == "__main__":
    unittest.main()
