#!/usr/bin/env python3
"""Plants one fault of each kind and requires that `lint.py rules` reports it, and nothing else."""

import contextlib
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile
import unittest
import unittest.mock

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
        self.expect_one("includes 21 files of ours", "web_client/src/ui/a.ts",
                        *[f"import './{number}';" for number in range(lint.MAX_IMPORTS + 1)])

    def test_length_marker_words_and_guards(self):
        self.expect_one("lines, the limit", "server/a.cpp", *["int x;"] * (lint.MAX_LINES + 1))
        self.expect_one("marker word", "server/a.cpp", "// TO" "DO: later")
        self.expect_one("#pragma once", "server/a.h", "int x;")

    def test_many_imports(self):
        many = [f'#include "server/net/a{i}.h"' for i in range(lint.MAX_IMPORTS + 1)]
        self.expect_one("includes 21 files of ours, the limit is 20", "server/net/a.cpp", *many)
        self.assertEqual(self.findings("server/net/a.cpp", "#include <vector>", *many[1:], many[1]), [])
        modules = [f"import {{ a{i} }} from './a{i}';" for i in range(lint.MAX_IMPORTS)]
        self.expect_one("includes 21 files of ours", "web_client/src/ui/a.ts", *modules, "import '../base/a';")

    def test_friend_classes(self):
        self.expect_one("are one", "server/net/a.h", "#pragma once", "  friend class B;")
        self.expect_one("are one", "tests/a.cpp", "  friend struct b::C<int>;")
        self.expect_one("are one", "render_core/cuda/a.cuh", "#pragma once", "  friend B;")
        self.assertEqual(self.findings("server/net/a.cpp", "  friend bool operator==(const A&, const A&);"), [])

    def test_banned_calls(self):
        self.expect_one("beyond its buffer", "server/a.cpp", "  strcpy(to, from);")
        self.expect_one("half a number", "server/net/a.cpp", "  return std::stoi(text);")
        self.expect_one("a shell", "render_core/a.cpp", '  system("rm x");')
        self.expect_one("shared state", "tests/a.cpp", "  const int r = rand();")
        self.expect_one("change their meaning", "server/a.cpp", "using namespace std;")
        self.expect_one("textContent", "web_client/src/ui/a.ts", "  box.innerHTML = title;")
        self.expect_one("becomes code", "tests/a.py", "subprocess.run(line, shell=True)")
        self.assertEqual(self.findings("server/a.cpp", "  io.system(1); // rand()", "  fmt::gmtime(t);"), [])

    def test_english(self):
        def findings(*lines, path="render_core/a.md"):
            return list(lint.english_findings(path, list(lines)))

        self.assertEqual(findings("It runs.", "told", path="render_core/a.h"), [])
        for line in ("pages that were missing of late", "drawn for want of them", "It is told so.", "which goes on"):
            self.assertEqual(len(findings("", line)), 1, line)
            self.assertEqual(findings(line, path="web_client/a.ts"), [], "not yet plain")
        for name in ("OfNothingIsNothing", "WhoIsLateWaits", "ThatIsSo", "WhatIsRead", "WhereItEnds", "ForAll"):
            for declaration in (f"TEST(A, {name}) {{", f"TEST_F(A,\n       {name}) {{"):
                found = findings("", *declaration.split("\n"), path="tests/server/a.cpp")
                self.assertEqual(found, [f"tests/server/a.cpp:2: {name}: a test's name is a claim"])
        self.assertEqual(findings("TEST(A, OfferIsTaken) {", path="tests/load/a.cpp"), [])

    def test_links(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            page = root / "README.md"

            def findings(*lines):
                page.write_text("\n".join(lines))
                return list(lint.link_findings(root, page.name, list(lines)))

            self.assertEqual(findings("## A's `part`, 2", "[here](README.md#as-part-2) [web](https://x.org/y#z) [part](#as-part-2)"), [])
            self.assertEqual(findings("", "![gone](media/gone.webp)"),
                             ["README.md:2: links to media/gone.webp, which does not exist"])
            self.assertEqual(findings("[part](README.md#b)"), ["README.md:1: README.md has no heading #b"])
            self.assertEqual(findings("word " * lint.MAX_README_WORDS), [])
            self.assertEqual(len(findings("word " * (lint.MAX_README_WORDS + 1))), 1)

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

    def sizes(self, *lines, path="server/a.h"):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / path).parent.mkdir(parents=True)
            (root / path).write_text("\n".join(lines) + "\n", "utf-8")
            return list(declarations.size_findings(declarations.ctags("ctags", root, [path])))

    def test_large_classes(self):
        methods, fields = [f"  int f{i}();" for i in range(24)], [f"  int x{i}_;" for i in range(21)]
        for path in ("server/a.h", "server/a.cpp", "render_core/cuda/a.cuh"):
            self.assertEqual(self.sizes("namespace {", "class A {", "  A();", "  ~A();", *methods, *fields, "};", "}",
                                        *(f"int A::f{i}() {{ return 0; }}" for i in range(24)), path=path),
                             [f"{path}:2: A has 24 methods, the limit is 23: split it",
                              f"{path}:2: A has 21 fields, the limit is 20: split it"])
            self.assertEqual(self.sizes("class A {", *methods[1:], *fields[1:], "};", path=path), [])

    def test_anonymous_structs_hide_no_fields(self):
        hidden = ["  struct {", *(f"    int y{i};" for i in range(6)), "    union { int z1; int z2; };", "  } held;"]
        fields = [f"  int x{i};" for i in range(13)]
        self.assertEqual(self.sizes("struct A {", *fields, *hidden, "};"),
                         ["server/a.h:1: A has 21 fields, the limit is 20: split it"])
        self.assertEqual(self.sizes("struct A {", *fields[1:], *hidden, "};"), [])
        self.assertEqual(self.sizes("struct A {", *fields, *hidden[:1], "  };", "};"), [])

    def test_what_meets_the_limit_leaves_the_list(self):
        lists = {"LONGER_FUNCTIONS": ["server/a.cpp: a"], "TABLES": ["A::B"]}
        with contextlib.ExitStack() as stack:
            for name, listed in lists.items():
                stack.enter_context(unittest.mock.patch.object(declarations, name, dict.fromkeys(listed, 99)))
            body = ["    a();"] * declarations.MAX_FUNCTION_LINES
            large = ["namespace catgs {", "struct A {", "  struct B {", *(f"    int x{i};" for i in range(21)), "  };", "};",
                     "void a() {", *body, "}", "}"]
            with tempfile.TemporaryDirectory() as folder:
                root = pathlib.Path(folder)
                (root / "server").mkdir()
                for lines, stale in ((large, []), ([], sorted(sum(lists.values(), [])))):
                    (root / "server/a.cpp").write_text("\n".join(lines) + "\n", "utf-8")
                    tags = declarations.ctags("ctags", root, ["server/a.cpp"])
                    found = sorted(line.split(": ", 1)[1].split(" meets")[0]
                                   for line in declarations.stale_findings(tags))
                    self.assertEqual(found, stale)
                    self.assertEqual(list(declarations.size_findings(tags)), [])

    def test_what_nothing_uses(self):
        found = self.findings({"server/a.h": ["int used();  // unused", "int unused();"],
                               "server/a.cpp": ['#include "server/a.h"', "int unused() {", "  return used();", "}"],
                               "server/b.h": ["#pragma once"]})
        self.assertEqual(found, ["server/a.cpp:2: nothing of the product uses unused",
                                 "server/b.h:1: no file includes it"])


@unittest.skipUnless(shutil.which("cppcheck"), "cppcheck is not installed")
class Cppcheck(unittest.TestCase):
    def test_what_it_keeps_of_a_file_is_said_again(self):
        with tempfile.TemporaryDirectory() as folder:
            root = pathlib.Path(folder)
            (root / "server").mkdir()
            (root / "server/a.cpp").write_text("int f(int i) { int a[3] = {0, 1, 2}; return a[i == 5 ? 7 : 0]; }\n")
            for _ in range(2):
                result = subprocess.run([sys.executable, "-B", lint.__file__, "cppcheck", "--root", folder,
                                         "--build", root / "build"], capture_output=True, text=True, check=False)
                self.assertEqual(result.returncode, 1, result.stdout + result.stderr)
                self.assertIn("server/a.cpp:1: arrayIndexOutOfBounds", result.stderr)


if __name__ == "__main__":
    unittest.main()
