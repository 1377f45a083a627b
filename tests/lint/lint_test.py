#!/usr/bin/env python3
"""Plants one fault of each kind and requires that `lint.py rules` reports it, and nothing else."""

import pathlib
import subprocess
import sys
import unittest

import lint

CLEAN = ["#pragma once", "#include <vector>", '#include "render_core/math/camera.h"']


class RuleFindings(unittest.TestCase):
    def findings(self, path, *lines):
        return list(lint.rule_findings(path, list(lines)))

    def expect_one(self, text, path, *lines):
        findings = self.findings(path, *lines)
        self.assertEqual(len(findings), 1, findings)
        self.assertIn(text, findings[0])

    def test_clean_files_have_no_findings(self):
        self.assertEqual(self.findings("render_core/scene/a.h", *CLEAN), [])
        self.assertEqual(self.findings("server/net/wire.cpp", '#include "catgs.pb.h"'), [])
        self.assertEqual(self.findings("server/net/socket.cpp", "#include <libwebsockets.h>"), [])
        self.assertEqual(self.findings("render_core/make_renderer.cpp",
                                       '#include "render_core/cpu/cpu_renderer.h"'), [])
        self.assertEqual(self.findings("web_client/src/wire/codec.ts",
                                       'import { create } from "@bufbuild/protobuf";'), [])

    def test_layering(self):
        self.expect_one("neither server nor wire", "render_core/cpu/a.cpp",
                        '#include "server/session/session.h"')
        self.expect_one("no network", "render_core/scene/a.cpp", "#include <libavcodec/avcodec.h>")
        self.expect_one("does not lie above", "render_core/scene/a.cpp",
                        '#include "render_core/renderer.h"')
        self.expect_one("chooses a core", "server/main.cpp",
                        '#include "render_core/cpu/cpu_renderer.h"')
        self.expect_one("does not lie above", "render_core/scene/formats/a.cpp",
                        '#include "render_core/scene/analysis/a.h"')
        self.expect_one("is not in LAYERS", "render_core/new/a.cpp", '#include "render_core/base/error.h"')
        self.expect_one("scene_catalog.cpp alone", "server/main.cpp", '#include "render_core/synth/synth.h"')
        self.expect_one("speaks to the socket", "server/session/a.cpp",
                        "#include <libwebsockets.h>")
        self.expect_one("speaks protobuf", "server/session/a.cpp", '#include "catgs.pb.h"')
        self.expect_one("speaks to the codecs", "server/pipeline/a.cpp",
                        "#include <libavutil/frame.h>")
        self.expect_one("its tests", "server/main.cpp", '#include "tests/support/video.h"')
        self.expect_one("nobody's library", "server/main.cpp",
                        '#include "render_core/tools/commands.h"')
        self.expect_one("speaks protobuf", "web_client/src/ui/panel.ts",
                        'import { Pose } from "../wire/generated/catgs_pb";')

    def test_layers_of_the_client(self):
        self.assertEqual(self.findings("web_client/src/ui/a.ts", "import { b } from './b';",
                                       "import type { Eye } from '../camera/eye';"), [])
        self.assertEqual(self.findings("web_client/src/main.ts", "import { a } from './ui/viewer';"), [])
        for path, module in [("camera/a.ts", "../present/warp"), ("input/a.ts", "../tour/tour"),
                             ("base/a.ts", "../text"), ("ui/a.ts", "./viewer"), ("ui/a.ts", "../main")]:
            self.expect_one("does not lie above", f"web_client/src/{path}", f"}} from '{module}';")
        self.expect_one("is not in LAYERS", "web_client/src/new/a.ts", "import { b } from '../base/b';")
        self.expect_one("is not in LAYERS", "web_client/src/ui/a.ts", "import { b } from '../new/b';")
        self.expect_one("through worker/client", "web_client/src/ui/a.ts", "import '../worker/worker';")

    def test_length_marker_words_and_guards(self):
        self.expect_one("lines, the limit", "server/a.cpp", *["int x;"] * (lint.MAX_LINES + 1))
        self.expect_one("marker word", "server/a.cpp", "// TO" "DO: later")
        self.expect_one("#pragma once", "server/a.h", "int x;")

    def test_functions_have_an_end(self):
        body = ["int f(int a) {"] + ["  a += 1;"] * lint.MAX_FUNCTION_LINES + ["}"]
        self.expect_one("f has 72 lines", "server/a.cpp", *body)
        self.expect_one("g has 73 lines", "server/a.cpp", "class A {", " public:", "  void g(",
                        "      int a) {", *["    a += 1;"] * lint.MAX_FUNCTION_LINES, "  }", "};")
        self.assertEqual(self.findings("server/a.cpp", "namespace a {", *body[:60], "}",
                                       *["int x;"] * 60, "}"), [])

    def test_banned_calls(self):
        self.expect_one("beyond its buffer", "server/a.cpp", "  strcpy(to, from);")
        self.expect_one("half a number", "server/net/a.cpp", "  return std::stoi(text);")
        self.expect_one("a shell", "render_core/a.cpp", '  system("rm x");')
        self.expect_one("shared state", "tests/a.cpp", "  const int r = rand();")
        self.expect_one("change their meaning", "server/a.cpp", "using namespace std;")
        self.expect_one("textContent", "web_client/src/ui/a.ts", "  box.innerHTML = title;")
        self.expect_one("becomes code", "tests/a.py", "subprocess.run(line, shell=True)")
        self.assertEqual(self.findings("server/a.cpp", "  io.system(1); // rand()", "  fmt::gmtime(t);"), [])

    def test_links(self):
        root = pathlib.Path(__file__).parent
        lines = ["[here](lint.py) [web](https://x.org/y) [part](#a)", "![gone](media/gone.webp)"]
        findings = list(lint.link_findings(root, "README.md", lines))
        self.assertEqual(len(findings), 1, findings)
        self.assertIn("README.md:2: links to media/gone.webp", findings[0])

    def test_the_security_page_names_what_is_there(self):
        code = {"server/a.h": "constexpr int max_a = 3;", "tests/a.cpp": "TEST_F(A, IsBounded) {"}
        row = "| a | 3 | `server/a.h: max_a` | refused | `A.IsBounded`, `A.*` |"
        self.assertEqual(list(lint.security_findings("S.md", [row], code)), [])
        gone = ["`server/a.h: max_b`", "`server/b.h: max_a`", "`A.IsGone`", "`B.*`"]
        self.assertEqual(len(list(lint.security_findings("S.md", gone, code))), len(gone))

    def test_the_security_page_tells_the_values_of_constants(self):
        def findings(told: str, definition: str) -> int:
            row = f"| a | {told} | `a.h: max_a` | refused | |"
            return len(list(lint.security_findings("S.md", [row], {"a.h": definition})))
        for told, value in [("3", "3"), ("64 KiB", "64 * 1024"), ("4, 16 MiB", "16 << 20"),
                            ("2^20", "std::size_t{1} << 20"), ("30 s", "30 * LWS_US_PER_SEC"),
                            ("10 million", "10'000'000"), ("3840 x 2160", "3840 * 2160"),
                            ("`--max-a`", "7"), ("7", "other(7)")]:
            self.assertEqual(findings(told, f"constexpr int max_a = {value};"), 0, told)
        self.assertEqual(findings("30 s", "milliseconds max_a{30'000};"), 0)
        self.assertEqual(findings("3", "constexpr int max_a = 4;"), 1)
        self.assertEqual(findings("64 KiB", "constexpr int max_a = 64 * 1024 + 1;"), 1)
        self.assertEqual(findings("30 s", "milliseconds max_a{30'001};"), 1)

    def test_missing_tool_is_a_skip(self):
        result = subprocess.run([sys.executable, lint.__file__, "shell"], env={"PATH": "/nonexistent"},
                                capture_output=True, text=True, check=False)
        self.assertEqual(result.returncode, lint.EXIT_SKIPPED)
        self.assertIn("shellcheck", result.stdout)


if __name__ == "__main__":
    unittest.main()
