#!/usr/bin/env python3
"""soak.py's judgement, on samples and log lines that are made up, and its strangers, at a server that is."""

import collections
import math
import pathlib
import random
import socket
import socketserver
import tempfile
import threading
import unittest

import acts
import misdeeds
import soak
import soak_report
import strangers


def samples(rss_of, minutes=60.0):
    """One a second. `rss_of`: MB by seconds."""
    return [{"at_s": 5.0 + s, "rss_mb": rss_of(s), "heap_mb": rss_of(s),
             "descriptors": 18 + int(8 * math.sin(s / 8.0)), "threads": 6}
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

    def test_heaps_that_fill_for_a_quarter_of_an_hour_are_flat_in_an_hour(self):
        fills = lambda s: 150.0 - 60.0 * max(0.0, 1.0 - s / 900.0)
        self.assertTrue(self.judge(fills)["flat"])
        short = self.judge(fills, 18.0)
        self.assertFalse(short["flat"], "of eighteen minutes too few are left")
        self.assertGreater(len(short["quantities"]["rss_mb"]["envelope"]), 0)
        said = {"rounds": 3, "errors": []}
        self.assertIn("too short to judge rss_mb by", soak_report.to_text(short | said))
        long = self.judge(lambda s: 150.0 + 0.002 * s) | said
        self.assertIn("NOT FLAT", soak_report.to_text(long))
        self.assertNotIn("too short", soak_report.to_text(long))

    def test_a_short_run_is_judged_by_the_use_of_the_heap(self):
        fragments = [sample | {"heap_mb": 60.0} for sample in samples(lambda s: 150.0 + 0.02 * s, 15.0)]
        self.assertTrue(soak_report.judge(fragments)["flat"])
        leak = [sample | {"heap_mb": 60.0 + 0.02 * sample["at_s"]} for sample in samples(lambda s: 150.0, 15.0)]
        self.assertFalse(soak_report.judge(leak)["flat"])

    def test_a_warm_up_that_is_told_is_left_out(self):
        fills = samples(lambda s: 150.0 - 60.0 * max(0.0, 1.0 - s / 600.0), 15.0)
        self.assertFalse(soak_report.judge(fills)["flat"])
        self.assertTrue(soak_report.judge(fills, 600.0)["flat"])
        leaks = samples(lambda s: 150.0 + 0.01 * s, 15.0)
        self.assertFalse(soak_report.judge(leaks, 300.0)["flat"])

    def test_one_window_that_stands_out_is_flat(self):
        self.assertTrue(self.judge(lambda s: 150.0 + 80.0 * (2000 <= s < 2300))["flat"])

    def test_a_leak_under_what_comes_and_goes_is_not(self):
        report = self.judge(lambda s: 150.0 + 40.0 * (s % 50 < 30) + 0.002 * s)  # 7 MB an hour
        self.assertFalse(report["flat"])
        self.assertFalse(report["quantities"]["rss_mb"]["flat"])
        self.assertAlmostEqual(report["quantities"]["rss_mb"]["growth"], 0.002 * 2700 * 11 / 12, delta=0.3)

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

    def test_the_page_has_each_quantity_and_its_envelope(self):
        taken = samples(lambda s: 150.0)
        report = soak_report.judge(taken) | {"rounds": 3, "errors": []}
        plots = soak_report.chart_document(report, taken)["parts"][0]["plots"]
        self.assertEqual([plot["title"] for plot in plots], ["rss_mb", "heap_mb", "descriptors", "threads"])
        self.assertEqual([len(curve["x"]) for curve in plots[0]["curves"]], [len(taken), soak_report.WINDOWS])

    def test_too_little_is_not_flat(self):
        self.assertFalse(soak_report.judge([])["flat"])
        self.assertFalse(self.judge(lambda s: 150.0, 0.3)["flat"])

    def test_a_gpu_is_judged_where_there_is_one(self):
        leaking = [sample | {"device_mb": 1000.0 + sample["at_s"]} for sample in samples(lambda s: 150.0)]
        self.assertFalse(soak_report.judge(leaking)["quantities"]["device_mb"]["flat"])
        self.assertNotIn("device_mb", soak_report.judge(samples(lambda s: 150.0))["quantities"])



class Findings(unittest.TestCase):
    def test_lines_of_both_formats_are_judged_by_their_level(self):
        bad = soak.bad_lines(
            '{"time":"t","level":"info","message":"fine"}\n'
            '{"time":"t","level":"warning","message":"odd"}\n'
            "12:00:00.000 info session 1f2e3d4c: fine\n"
            "12:00:00.000 error session 1f2e3d4c: bad\n"
            "==1==ERROR: AddressSanitizer\n", collections.Counter(), collections.Counter())
        self.assertEqual(bad, ['{"time":"t","level":"warning","message":"odd"}',
                               "12:00:00.000 error session 1f2e3d4c: bad", "==1==ERROR: AddressSanitizer"])

    def test_warnings_that_strangers_caused_are_as_many_as_they_caused(self):
        lines = ['{"time":"t","level":"warning","session":"1f2e3d4c","message":"127.0.0.1: refused"}',
                 "12:00:00.000 warning session 1f2e3d4c: 127.0.0.1: refused",
                 "12:00:00.000 \x1b[1;33mwarning\x1b[m 127.0.0.1 by link abe6d002dd8b: refused"]
        caused = lambda times: collections.Counter({"127.0.0.1: refused": times})
        of = lambda times, text=lines, more=0: soak.bad_lines("\n".join(text), caused(times), caused(more))
        self.assertEqual(of(3), [])
        self.assertEqual(of(2), lines[2:], "one that nobody caused")
        self.assertEqual(of(5), ["2 lines too few: 127.0.0.1: refused"])
        self.assertEqual((of(2, more=1), of(3, more=1)), ([], []))
        self.assertEqual(of(1, more=1), lines[2:])
        for other in ("12:00:00.000 error 127.0.0.1: refused", "12:00:00.000 warning 127.0.0.1: refused, too"):
            self.assertEqual(of(1, [other]), [other, "1 lines too few: 127.0.0.1: refused"])

    def test_labels_of_a_metric_are_summed(self):
        metrics = soak.parse_metrics(
            '{"a_total": [{"labels": {"by": "x"}, "value": 1}, {"labels": {"by": "y"}, "value": 2}], '
            '"b": [{"labels": {}, "value": 35}]}')
        self.assertEqual(metrics, {"a_total": 3.0, "b": 35.0})

    def test_a_metric_that_is_no_longer_there_does_not_stand_still(self):
        all_of_them = {name: 0.0 for name in (*soak.GAUGES, *soak.COUNTERS, *soak.NEVER)}
        self.assertEqual(soak.looked_at(all_of_them | {"another": 1.0}), all_of_them)
        for name in all_of_them:
            with self.assertRaisesRegex(soak.Cannot, name):
                soak.looked_at({other: 0.0 for other in all_of_them if other != name})

    def test_counters_are_judged_from_where_the_soak_began(self):
        before = {name: 2.0 for name in soak.NEVER}
        nobody = collections.Counter()
        self.assertEqual(soak.moved(before, before, nobody), [])
        after = before | {"catgs_log_lines_lost_total": 5.0}
        self.assertEqual(soak.moved(before, after, nobody),
                         ["catgs_log_lines_lost_total grew by 3, and strangers caused 0"])

    def test_counters_move_by_what_strangers_did_and_nothing_else(self):
        before = {name: 2.0 for name in soak.NEVER}
        after = before | {misdeeds.REQUESTS: 5.0}
        self.assertEqual(soak.moved(before, after, collections.Counter({misdeeds.REQUESTS: 3})), [])
        for caused in (2, 4):
            self.assertEqual(soak.moved(before, after, collections.Counter({misdeeds.REQUESTS: caused})),
                             [f"{misdeeds.REQUESTS} grew by 3, and strangers caused {caused}"])
        for misdeed in misdeeds.all_misdeeds("a link"):
            self.assertLessEqual(set(misdeed.moves), set(soak.NEVER), misdeed.name)


class StandIn:
    """A process with given metrics."""

    def __init__(self, pid, value):
        self.folder, self.begin_s, self.value = pathlib.Path("/proc") / str(pid), 7.0, value

    def metrics(self):
        return {name: self.value for name in soak.NEVER}


class Beginnings(unittest.TestCase):
    def test_a_later_run_with_the_same_process_goes_on_and_another_begins_anew(self):
        with tempfile.TemporaryDirectory() as folder:
            path, log = pathlib.Path(folder) / "samples.jsonl", pathlib.Path(folder) / "log"
            log.write_text("old\n")
            first = soak.begin(path, StandIn(1, 3.0), log)
            self.assertEqual((first["metrics"]["catgs_frames_failed_total"], first["log_bytes"]), (3.0, 4))
            with path.open("a") as file:
                file.write('{"at_s": 1}\n')
            log.write_text("old\nnew\n")
            done = soak.misdeeds_of(path)
            done.write_text("junk\n")
            self.assertEqual(soak.begin(path, StandIn(1, 4.0), log), first)
            self.assertTrue(done.exists())
            self.assertEqual(soak.read_samples(path), [{"at_s": 1}])
            self.assertEqual(soak.begin(path, StandIn(2, 4.0), log)["log_bytes"], 8)
            self.assertEqual(soak.read_samples(path), [])
            self.assertFalse(done.exists())


class Door(socketserver.StreamRequestHandler):
    """Refuses who asks, and lets the others stand."""

    def handle(self):
        if self.rfile.readline():
            self.wfile.write(b"HTTP/1.1 403 Forbidden\r\n\r\n")


class Drip(socketserver.StreamRequestHandler):
    """Hangs up when three bytes more have come."""

    def handle(self):
        self.rfile.readline()
        self.rfile.read(3)


class LongAnswer(socketserver.StreamRequestHandler):
    def handle(self):
        self.rfile.readline()
        self.wfile.write(b"l" * 1200)


class StrangersTest(unittest.TestCase):
    """One round each."""

    def go_round(self, path, sends, answer, patience_s=60.0, door=Door, **manners):
        deed = misdeeds.Misdeed("deed", sends, answer, "a line", (misdeeds.REQUESTS,), **manners)
        with socketserver.ThreadingTCPServer(("127.0.0.1", 0), door) as server:
            threading.Thread(target=server.serve_forever).start()
            crowd = strangers.Strangers(f"ws://127.0.0.1:{server.server_address[1]}", path,
                                        [deed, deed._replace(name="other")], patience_s)
            crowd.stopped.set()
            with crowd:
                pass
            server.shutdown()
        return crowd

    def test_what_they_did_is_counted_over_all_runs(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "misdeeds.txt"
            for times in (1, 2):
                crowd = self.go_round(path, b"GET /\r\n", rb"HTTP/1\.1 403 ")
                self.assertEqual(crowd.errors(), [])
                self.assertEqual(crowd.done(), {"deed": times})
                self.assertEqual(crowd.lines(), {"a line": times})
                self.assertEqual(crowd.moves(), {misdeeds.REQUESTS: times})

    def test_a_wrong_answer_is_an_error_with_what_came(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder) / "misdeeds.txt"
            for wanted in (rb"HTTP/1\.1 404 ", misdeeds.NOTHING):
                self.assertEqual(self.go_round(path, b"GET /\r\n", wanted).errors(),
                                 [r"stranger, deed: was answered b'HTTP/1.1 403 Forbidden\r\n\r\n'"])

    def test_who_is_not_hung_up_is_an_error(self):
        with tempfile.TemporaryDirectory() as folder:
            crowd = self.go_round(pathlib.Path(folder) / "misdeeds.txt", b"GET /", misdeeds.NOTHING, 0.0)
            self.assertEqual(crowd.errors(), ["stranger, deed: was not hung up after 0 s: b''"])

    def test_who_drips_sends_until_they_are_hung_up(self):
        with tempfile.TemporaryDirectory() as folder:
            crowd = self.go_round(pathlib.Path(folder) / "misdeeds.txt", b"PUT /\r\n", misdeeds.NOTHING, door=Drip,
                                  drips=True)
            self.assertEqual(crowd.errors(), [])

    def test_who_sips_takes_all_of_it_in_the_end(self):
        with tempfile.TemporaryDirectory() as folder:
            for length, errors in ((1200, 0), (1201, 1)):
                crowd = self.go_round(pathlib.Path(folder) / "misdeeds.txt", b"GET /\r\n", rb"l{%d}\Z" % length,
                                      door=LongAnswer, sips=512)
                self.assertEqual(len(crowd.errors()), errors)

    def test_acts_say_what_was_wrong(self):
        with tempfile.TemporaryDirectory() as folder:
            for says, errors in (("", []), ("is wrong", ["stranger, act: is wrong"])):
                crowd = strangers.Strangers("ws://127.0.0.1:1", pathlib.Path(folder) / "misdeeds.txt", [],
                                            acts=[acts.Act("act", lambda _, says=says: says, "a line", 3)])
                crowd.stopped.set()
                with crowd:
                    pass
                self.assertEqual(crowd.errors(), errors)
            self.assertEqual((crowd.done(), crowd.lines()), ({"act": 2}, {"a line": 6}))

    def test_misdeeds_have_names_of_their_own(self):
        for link in ("", "a link"):
            names = [misdeed.name for misdeed in [*misdeeds.all_misdeeds(link), *acts.all_acts(link)]]
            self.assertEqual(len(set(names)), len(names))

    def test_saves_without_end_are_an_authors(self):
        loops = [misdeed for misdeed in misdeeds.all_misdeeds("a link") if misdeed.closes]
        self.assertEqual([b"If-Match" in loop.sends for loop in loops], [False, True])
        self.assertFalse([misdeed.name for misdeed in misdeeds.all_misdeeds() if misdeed.closes])

    def test_who_closes_comes_as_often_as_told_and_waits_for_nothing(self):
        deed = misdeeds.Misdeed("deed", b"PUT /", misdeeds.NOTHING, closes=True, times=3)
        with tempfile.TemporaryDirectory() as folder, socket.create_server(("127.0.0.1", 0)) as door:
            crowd = strangers.Strangers(f"ws://127.0.0.1:{door.getsockname()[1]}", pathlib.Path(folder) / "misdeeds.txt",
                                        [deed], 0.0)
            crowd.stopped.set()
            with crowd:
                pass
            door.settimeout(0.0)
            for _ in range(deed.times):
                with door.accept()[0] as visit:
                    self.assertEqual((visit.recv(9), visit.recv(9)), (b"PUT /", b""))
            self.assertRaises(BlockingIOError, door.accept)
            self.assertEqual((crowd.errors(), crowd.done()), ([], {"deed": 1}))


if __name__ == "__main__":
    unittest.main()
