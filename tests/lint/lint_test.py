#!/usr/bin/env python3
"""Plants one fault of each kind and requires that `lint.py rules` reports it, and nothing else."""

import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest

import declarations
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
        self.expect_one("does not lie above", "render_core/cpu/a.cpp",
                        '#include "server/visit/visit.h"')
        self.expect_one("no network", "render_core/scene/a.cpp", "#include <libavcodec/avcodec.h>")
        self.expect_one("does not lie above", "render_core/scene/a.cpp",
                        '#include "render_core/frame/renderer.h"')
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
        self.assertEqual(self.findings("web_client/src/main.ts", "import { a } from './viewer';",
                                       "import { b } from './ui/b';"), [])
        for path, module in [("camera/a.ts", "../present/warp"), ("input/a.ts", "../tour/tour"),
                             ("base/a.ts", "../text"), ("page/a.ts", "../ui/b"), ("ui/a.ts", "../media/b"),
                             ("ui/a.ts", "../viewer")]:
            self.expect_one("does not lie above", f"web_client/src/{path}", f"}} from '{module}';")
        self.expect_one("is not in LAYERS", "web_client/src/new/a.ts", "import { b } from '../base/b';")
        self.expect_one("is not in LAYERS", "web_client/src/ui/a.ts", "import { b } from '../new/b';")
        self.expect_one("through worker/client", "web_client/src/ui/a.ts", "import '../worker/worker';")
        self.expect_one("imports 21 modules", "web_client/src/ui/a.ts",
                        *[f"import './{number}';" for number in range(lint.MAX_IMPORTS + 1)])

    def test_length_marker_words_and_guards(self):
        self.expect_one("lines, the limit", "server/a.cpp", *["int x;"] * (lint.MAX_LINES + 1))
        self.expect_one("marker word", "server/a.cpp", "// TO" "DO: later")
        self.expect_one("#pragma once", "server/a.h", "int x;")

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

    def test_the_security_pages_name_what_is_there(self):
        code = {"server/a.h": "constexpr int max_a = 3;", "tests/a.cpp": "TEST_F(A, IsBounded) {"}
        row = "| a | 3 | `server/a.h: max_a` | refused | `A.IsBounded`, `A.*` |"
        self.assertEqual(list(lint.security_findings("S.md", [row], code)), [])
        gone = ["`server/a.h: max_b`", "`server/b.h: max_a`", "`A.IsGone`", "`B.*`"]
        self.assertEqual(len(list(lint.security_findings("S.md", gone, code))), len(gone))

    def test_every_page_whose_table_names_tests_is_checked(self):
        root = pathlib.Path(lint.__file__).parents[2]
        pages = {f"deploy/{page.name}" for page in (root / "deploy").glob("*.md")
                 if re.search(r"^\|.*`[A-Z]\w*\.[A-Z]\w*`", page.read_text("utf-8"), re.M)}
        self.assertEqual(pages, set(lint.SECURITY_PAGES))


@unittest.skipUnless(shutil.which("ctags"), "universal-ctags is not installed")
class Declarations(unittest.TestCase):
    def findings(self, code):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            for path, lines in code.items():
                (root / path).parent.mkdir(parents=True, exist_ok=True)
                (root / path).write_text("\n".join(lines) + "\n", "utf-8")
            tags = declarations.ctags("ctags", root, list(code))
        texts = {path: "\n".join(lines) for path, lines in code.items()}
        return [*declarations.size_findings(tags), *declarations.unused_findings(tags, texts),
                *declarations.unreached_findings(texts)]

    def test_long_functions_and_constructors(self):
        body = ["    a();"] * declarations.MAX_FUNCTION_LINES
        found = self.findings({"server/a.cpp": ["void a() {", *body, "}", "struct B {", "  B() {", *body, "  }", "};",
                                                "B::B() : b(B{}) {", *body, "}"]})
        self.assertEqual(sorted(line.split(":", 2)[2].split(",")[0] for line in found),
                         [" B has 72 lines", " B has 72 lines", " a has 72 lines"])

    def test_large_classes(self):
        many = [f"  int f{i}();" for i in range(26)] + [f"  int x{i}_;" for i in range(21)]
        used = " ".join(f"f{i} x{i}_" for i in range(26))
        found = self.findings({"server/a.h": ["class A {", *many, "};"],
                               "server/a.cpp": ['#include "server/a.h"', f"A a; {used}"]})
        self.assertEqual(found, ["server/a.h:1: A has 26 methods, the limit is 25: split it",
                                 "server/a.h:1: A has 21 fields, the limit is 20: split it"])

    def test_what_nothing_uses(self):
        found = self.findings({"server/a.h": ["int used();  // unused", "int unused();"],
                               "server/a.cpp": ['#include "server/a.h"', "int unused() {", "  return used();", "}"],
                               "server/b.h": ["#pragma once"]})
        self.assertEqual(found, ["server/a.cpp:2: nothing of the product uses unused",
                                 "server/b.h:1: no file includes it"])


if __name__ == "__main__":
    unittest.main()
