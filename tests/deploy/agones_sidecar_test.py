#!/usr/bin/env python3
"""The sidecar of deploy/kubernetes/overlays/agones between a catgs-server and an SDK, both played."""

import http.server
import os
import pathlib
import subprocess
import threading
import time
import unittest

SIDECAR = pathlib.Path(__file__).resolve().parents[2] / "deploy/kubernetes/overlays/agones/sidecar.sh"


class Played:
    """An HTTP server on a port of its own that answers by `answer(method, path)`."""

    def __init__(self, answer):
        outer = self
        self.calls = []

        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def handle_any(self):
                self.rfile.read(int(self.headers.get("Content-Length", 0)))
                outer.calls.append((self.command, self.path))
                status, body = answer(self.command, self.path)
                self.send_response(status)
                self.send_header("Content-Length", str(len(body)))
                self.end_headers()
                self.wfile.write(body.encode())

            do_GET = do_POST = handle_any

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        self.port = self.server.server_port
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def said(self, path):
        return self.calls.count(("POST", path))

    def close(self):
        self.server.shutdown()
        self.server.server_close()


class Sidecar(unittest.TestCase):
    def setUp(self):
        self.ready, self.healthy, self.sessions = False, True, 0
        self.catgs = Played(self.answer)
        self.sdk = Played(lambda method, path: (200, "{}"))
        self.addCleanup(self.catgs.close)
        self.addCleanup(self.sdk.close)
        environment = os.environ | {"CATGS_ADMIN_PORT": str(self.catgs.port), "AGONES_SDK_HTTP_PORT": str(self.sdk.port),
                                    "CATGS_EMPTY_S": "3"}
        self.sidecar = subprocess.Popen([SIDECAR], env=environment)
        self.addCleanup(self.end)

    def end(self):
        self.sidecar.kill()
        self.sidecar.wait()

    def answer(self, _, path):
        if path == "/readyz":
            return (200, "ready\n") if self.ready else (503, "not ready\n")
        if path == "/healthz":
            return (200, "ok\n") if self.healthy else (500, "")
        return 200, f"# TYPE catgs_sessions gauge\ncatgs_sessions {self.sessions}\ncatgs_sessions_lost 7\n"

    def wait_for(self, holds, what):
        for _ in range(600):
            if holds():
                return
            time.sleep(0.05)
        self.fail(what)

    def test_it_follows_the_life_of_a_server(self):
        self.wait_for(lambda: self.catgs.calls.count(("GET", "/readyz")) >= 2, "it asks whether the server is ready")
        self.assertEqual(self.sdk.calls, [], "Ready before the server is")
        self.ready = True
        self.wait_for(lambda: self.sdk.said("/ready") == 1, "Ready")
        self.wait_for(lambda: self.sdk.said("/health") >= 2, "Health")

        # Empty from the start, it is there for the next allocation.
        self.assertIsNone(self.sidecar.poll())
        self.assertEqual(self.sdk.said("/shutdown"), 0)

        # A server that hangs is not healthy.
        self.healthy = False
        self.wait_for(lambda: self.catgs.calls[-1] == ("GET", "/healthz"), "it looks")
        before, looks = self.sdk.said("/health"), len(self.catgs.calls)
        self.wait_for(lambda: len(self.catgs.calls) >= looks + 2, "it looks again")
        self.assertLessEqual(self.sdk.said("/health"), before + 1)

        self.healthy, self.sessions = True, 2
        seen = self.catgs.calls.count(("GET", "/metrics"))
        self.wait_for(lambda: self.sdk.said("/health") > before + 1, "Health again")
        self.wait_for(lambda: self.catgs.calls.count(("GET", "/metrics")) >= seen + 2, "it counts the sessions")
        self.assertEqual(self.sdk.said("/shutdown"), 0)
        self.sessions = 0
        self.wait_for(lambda: self.sdk.said("/shutdown") == 1, "Shutdown when its visitors have left")
        self.assertEqual(self.sidecar.wait(timeout=30), 0)


if __name__ == "__main__":
    unittest.main()
