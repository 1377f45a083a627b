#!/usr/bin/env python3
"""Checks that hold for every source file; each subcommand is one CTest test.

  lint.py rules              layering of includes, file length, marker words, include guards,
                             links between documents
  lint.py shell              shellcheck over every script
  lint.py format             clang-format 14, the version whose output .clang-format was tuned for
  lint.py tidy --build DIR   clang-tidy 14 with DIR/compile_commands.json

Exit status: 0 clean, 1 findings (one per line, file:line first), 77 the tool is not installed.
"""

import argparse
import concurrent.futures
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys
from typing import Iterator, NamedTuple

EXIT_SKIPPED = 77
PRUNED_FOLDERS = re.compile(r"^(\.git|build.*|node_modules|dist|generated|\.cache|__pycache__)$")
CXX = re.compile(r"\.(h|cpp|cu|cuh)$")
SOURCE = re.compile(r"\.(h|cpp|cu|cuh|ts|mjs|js|css|html|py|sh|proto|cmake)$|(^|/)CMakeLists\.txt$")


class IncludeRule(NamedTuple):
    """Files whose path matches `where` must not include what matches `forbidden`."""

    where: str
    forbidden: str
    reason: str


INCLUDE_RULES = [
    IncludeRule(r"^render_core/", r"^(server|proto|tests|deploy)/|^catgs\.pb\.h$",
                "render_core knows neither server nor wire"),
    IncludeRule(r"^render_core/(?!tools/)",
                r"^(libwebsockets|lib(av|sw)\w+/|google/protobuf|openssl/|boost/(asio|beast))",
                "render_core has no network, codec or protobuf (tools/ may write video)"),
    IncludeRule(r"^render_core/(math|motion|scene)/",
                r"^render_core/(renderer\.h|reference/|cpu/|cuda/|tools/)",
                "math, motion and scene lie under the renderers"),
    IncludeRule(r"^(render_core/(?!cpu/|cuda/|make_renderer\.cpp)|server/)",
                r"^render_core/(cpu|cuda)/",
                "make_renderer.cpp is the only place that chooses a core"),
    IncludeRule(r"^(render_core/(?!reference/|tools/|make_renderer\.cpp)|server/)",
                r"^render_core/reference/", "the oracle serves make_renderer.cpp, tools and tests"),
    IncludeRule(r"^render_core/(?!tools/)|^server/", r"^render_core/tools/",
                "the command-line tool is nobody's library"),
    IncludeRule(r"^server/", r"^tests/", "the product does not depend on its tests"),
    IncludeRule(r"^server/(?!net/)", r"^libwebsockets\.h$", "server/net alone speaks to the socket"),
    IncludeRule(r"^server/(?!net/wire)", r"\.pb\.h$", "server/net/wire alone speaks protobuf"),
    IncludeRule(r"^server/(?!encode/)", r"^lib(av|sw)\w+/", "server/encode alone speaks to the codecs"),
]
# TypeScript follows the same idea by module path.
IMPORT_RULES = [
    IncludeRule(r"^web_client/src/(?!wire/)", r"^@bufbuild/protobuf|/generated/",
                "src/wire alone speaks protobuf"),
]

MAX_LINES = 450
# A ratchet: files above the limit may shrink, never grow, and leave this table when they fit.
LONGER_FILES: dict[str, int] = {}

# Spelt in two parts so that this file does not report itself.
MARKER_WORDS = re.compile(r"\b(" + "|".join(a + b for a, b in
                                           [("TO", "DO"), ("FIX", "ME"), ("XX", "X"), ("HA", "CK")]) + r")\b")
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')
MARKDOWN_LINK = re.compile(r"\]\((?![a-z]+:|#)([^)#\s]+)")
IMPORT = re.compile(r"""(?:\bfrom\s+|\bimport\s+|\bimport\()['"]([^'"]+)['"]""")


def source_files(root: pathlib.Path) -> Iterator[str]:
    """Paths relative to `root`, sorted, without build output and installed packages."""
    for folder, subfolders, names in os.walk(root):
        subfolders[:] = sorted(s for s in subfolders if not PRUNED_FOLDERS.match(s))
        for name in sorted(names):
            yield (pathlib.Path(folder) / name).relative_to(root).as_posix()


def is_shell(root: pathlib.Path, path: str) -> bool:
    if path.endswith(".sh"):
        return True
    if "." in pathlib.Path(path).name:
        return False
    with open(root / path, "rb") as file:
        return re.match(rb"#!.*\b(ba)?sh\b", file.readline(80)) is not None


def rule_findings(path: str, lines: list[str]) -> Iterator[str]:
    """Findings of `rules` for one file, as 'file:line: text'."""
    limit = LONGER_FILES.get(path, MAX_LINES)
    if len(lines) > limit:
        yield f"{path}:{len(lines)}: {len(lines)} lines, the limit is {limit}: split the file"
    if path in LONGER_FILES and len(lines) <= MAX_LINES:
        yield f"{path}:1: fits {MAX_LINES} lines again: take it out of LONGER_FILES"
    # Highway includes its *-inl.h once per instruction set.
    if re.search(r"(?<!-inl)\.(h|cuh)$", path) and "#pragma once" not in lines:
        yield f"{path}:1: no #pragma once"
    pattern, rules = (IMPORT, IMPORT_RULES) if path.endswith(".ts") else (INCLUDE, INCLUDE_RULES)
    rules = [rule for rule in rules if re.search(rule.where, path)]
    for number, line in enumerate(lines, start=1):
        if MARKER_WORDS.search(line):
            yield f"{path}:{number}: marker word: do it, or say in prose what is missing"
        target = pattern.search(line)
        for rule in rules if target else []:
            if re.search(rule.forbidden, target.group(1)):
                yield f"{path}:{number}: includes {target.group(1)}: {rule.reason}"


def link_findings(root: pathlib.Path, path: str, lines: list[str]) -> Iterator[str]:
    """Links of a Markdown file that lead to no file, as 'file:line: text'."""
    for number, line in enumerate(lines, start=1):
        for target in MARKDOWN_LINK.findall(line):
            if not (root / path).parent.joinpath(target).exists():
                yield f"{path}:{number}: links to {target}, which does not exist"


def check_rules(root: pathlib.Path) -> int:
    findings = []
    for path in source_files(root):
        is_document = path.endswith(".md")
        if not is_document and not SOURCE.search(path) and not is_shell(root, path):
            continue
        lines = (root / path).read_text("utf-8").splitlines()
        findings += link_findings(root, path, lines) if is_document else rule_findings(path, lines)
    missing = [f"{path}:1: in LONGER_FILES, but there is no such file"
               for path in LONGER_FILES if not (root / path).is_file()]
    print("\n".join(findings + missing))
    return 1 if findings or missing else 0


def find_tool(name: str, version: str | None = None) -> str | None:
    """The tool's path; with `version` either name-version or a plain name of that major version."""
    if version is None:
        return shutil.which(name)
    if tool := shutil.which(f"{name}-{version}"):
        return tool
    tool = shutil.which(name)
    if tool and re.search(rf"version {version}\.", subprocess.run(
            [tool, "--version"], capture_output=True, text=True, check=True).stdout):
        return tool
    return None


def skipped(tool: str) -> int:
    print(f"SKIPPED: {tool} is not installed")
    return EXIT_SKIPPED


def check_shell(root: pathlib.Path) -> int:
    tool = find_tool("shellcheck")
    if tool is None:
        return skipped("shellcheck")
    scripts = [path for path in source_files(root) if is_shell(root, path)]
    return subprocess.run([tool, "--external-sources", "--format=gcc", *scripts],
                          cwd=root, check=False).returncode


def check_format(root: pathlib.Path) -> int:
    tool = find_tool("clang-format", "14")
    if tool is None:
        return skipped("clang-format 14")
    sources = [path for path in source_files(root) if CXX.search(path)]
    return subprocess.run([tool, "--dry-run", "-Werror", *sources], cwd=root, check=False).returncode


def check_tidy(root: pathlib.Path, build: pathlib.Path) -> int:
    tool = find_tool("clang-tidy", "14")
    if tool is None:
        return skipped("clang-tidy 14")
    commands = json.loads((build / "compile_commands.json").read_text("utf-8"))
    ours = re.compile(rf"^{re.escape(str(root))}/(render_core|server)/.*\.cpp$")
    sources = sorted({c["file"] for c in commands if ours.match(c["file"])})

    def run(source: str) -> subprocess.CompletedProcess:
        return subprocess.run([tool, "-p", str(build), "--quiet", source],
                              capture_output=True, text=True, check=False)

    status = 0
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        for result in pool.map(run, sources):
            if result.returncode != 0:
                status = 1
                print(result.stdout, end="")
    return status


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("check", choices=["rules", "shell", "format", "tidy"])
    parser.add_argument("--root", type=pathlib.Path,
                        default=pathlib.Path(__file__).resolve().parents[2])
    parser.add_argument("--build", type=pathlib.Path, help="build folder, for tidy")
    arguments = parser.parse_args()
    root = arguments.root.resolve()
    if arguments.check == "tidy":
        if arguments.build is None:
            parser.error("tidy needs --build")
        return check_tidy(root, arguments.build.resolve())
    return {"rules": check_rules, "shell": check_shell, "format": check_format}[arguments.check](root)


if __name__ == "__main__":
    sys.exit(main())
