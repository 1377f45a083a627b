#!/usr/bin/env python3
"""soak.py's judgement, on samples and log lines that are made up."""

import math
import random
import unittest

import soak
import soak_report


def samples(rss_of, minutes=60.0):
    """One a second. `rss_of`: MB by seconds."""
    return [{"at_s": 5.0 + s, "rss_mb": rss_of(s), "descriptors": 18 + int(8 * math.sin(s / 8.0)), "threads": 6}
            for s in range(int(60 * minutes))]


class Flatness(unittest.TestCase):
    def judge(self, rss_of, minutes=60.0):
        return soak_report.judge(samples(rss_of, minutes))

    def test_what_comes_and_goes_with_visitors_is_flat(self):
        noise = random.Random(1)
        report = self.judge(lambda s: 150.0 + 40.0 * (s % 50 < 30) + noise.uniform(0.0, 5.0))
        self.assertTrue(report["flat"], report)

    def test_filling_caches_at_first_is_flat(self):
        self.assertTrue(self.judge(lambda s: 150.0 - 60.0 * math.exp(-s / 60.0))["flat"])

    def test_one_window_that_stands_out_is_flat(self):
        self.assertTrue(self.judge(lambda s: 150.0 + 80.0 * (2000 <= s < 2300))["flat"])

    def test_a_leak_under_what_comes_and_goes_is_not(self):
        report = self.judge(lambda s: 150.0 + 40.0 * (s % 50 < 30) + 0.002 * s)  # 7 MB an hour
        self.assertFalse(report["flat"])
        self.assertFalse(report["quantities"]["rss_mb"]["flat"])
        self.assertAlmostEqual(report["quantities"]["rss_mb"]["growth"], 0.002 * 3000 * 11 / 12, delta=0.3)

    def test_one_descriptor_a_round_is_not(self):
        many = [sample | {"descriptors": sample["descriptors"] + int(sample["at_s"] / 50)}
                for sample in samples(lambda s: 150.0)]
        report = soak_report.judge(many)
        self.assertFalse(report["quantities"]["descriptors"]["flat"])
        self.assertTrue(report["quantities"]["rss_mb"]["flat"])

    def test_two_runs_of_one_process_are_judged_together(self):
        leak = lambda s: 150.0 + 0.004 * s
        first = samples(leak, 9.0)
        later = [sample | {"at_s": sample["at_s"] + 900.0} for sample in samples(lambda s: leak(s + 900.0), 9.0)]
        self.assertTrue(soak_report.judge(first)["flat"], "too little to be seen in nine minutes")
        self.assertFalse(soak_report.judge(first + later)["flat"])

    def test_too_little_is_not_flat(self):
        self.assertFalse(soak_report.judge([])["flat"])
        self.assertFalse(self.judge(lambda s: 150.0, 0.3)["flat"])

    def test_a_gpu_is_judged_where_there_is_one(self):
        leaking = [sample | {"device_mb": 1000.0 + sample["at_s"]} for sample in samples(lambda s: 150.0)]
        self.assertFalse(soak_report.judge(leaking)["quantities"]["device_mb"]["flat"])
        self.assertNotIn("device_mb", soak_report.judge(samples(lambda s: 150.0))["quantities"])

    def test_the_page_shows_each_quantity_and_error(self):
        report = self.judge(lambda s: 150.0) | {"rounds": 3, "errors": ["log: <bad>"], "explained_log_lines": {"why": 2}}
        page = soak_report.to_html(report, samples(lambda s: 150.0))
        for text in ("Memory, resident", "Open descriptors", "Threads", "log: &lt;bad&gt;", "2 x why", "not explained"):
            self.assertIn(text, page)
        self.assertIn("1 errors that are not explained", soak_report.to_text(report))


class Findings(unittest.TestCase):
    def test_lines_of_both_formats_are_judged_by_their_level(self):
        explained, unexplained = soak.log_findings(
            '{"time":"t","level":"info","message":"fine"}\n'
            '{"time":"t","level":"warning","message":"odd"}\n'
            "12:00:00.000 info session 1f2e3d4c: fine\n"
            "12:00:00.000 error session 1f2e3d4c: bad\n"
            "==1==ERROR: AddressSanitizer\n")
        self.assertEqual(explained, {})
        self.assertEqual(unexplained, ['{"time":"t","level":"warning","message":"odd"}',
                                       "12:00:00.000 error session 1f2e3d4c: bad", "==1==ERROR: AddressSanitizer"])

    def test_labels_of_a_metric_are_summed(self):
        metrics = soak.parse_metrics('# HELP a b\na_total{by="x"} 1\na_total{by="y"} 2\nb 3.5e+01\n')
        self.assertEqual(metrics, {"a_total": 3.0, "b": 35.0})


if __name__ == "__main__":
    unittest.main()
