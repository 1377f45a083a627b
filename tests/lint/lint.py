#!/usr/bin/env python3
"""Checks that hold for every source file; each subcommand is one CTest test.

  lint.py rules              layering and number of includes, banned calls, friend classes, file length,
                             marker words, include guards, links between documents, what the security
                             pages name, idioms
  lint.py declarations       universal-ctags: long functions, large classes, names and headers that
                             nothing uses
  lint.py shell              shellcheck over every script
  lint.py format             clang-format 14, the version whose output .clang-format was tuned for
  lint.py cppcheck --build DIR   cppcheck over server and render_core; DIR keeps what it found of each file
  lint.py tidy --build DIR   clang-tidy 14 with DIR/compile_commands.json: half a minute a file, so that
                             --changed takes only what the newest commit and the working tree changed

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

import declarations

EXIT_SKIPPED = 77
PRUNED_FOLDERS = re.compile(r"^(\.git|build.*|node_modules|dist|generated|\.cache|__pycache__)$")
CXX_TEST = re.compile(r"^TEST(?:_F|_P)?\((\w+),\s*(\w+)\)", re.MULTILINE)
CXX = re.compile(r"\.(h|cpp|cu|cuh)$")
SOURCE = re.compile(r"\.(h|cpp|cu|cuh|ts|mjs|js|css|html|py|sh|proto|cmake)$|(^|/)CMakeLists\.txt$")


class IncludeRule(NamedTuple):
    """Files whose path matches `where` must not include what matches `forbidden`."""

    where: str
    forbidden: str
    reason: str


# Folders from the ground up. A file includes its own folder and lower lines, so
# that no folders include each other in a cycle.
LAYERS = {name: rank for rank, line in enumerate([
    "render_core/base", "render_core/math", "render_core/scene", "render_core/scene/analysis render_core/scene/formats",
    "render_core/scene/edit render_core/scene/tree",
    "render_core/motion", "render_core/frame", "render_core/image render_core/video",
    "render_core/metrics render_core/reference render_core/cpu render_core/cuda render_core/walk", "render_core",
    "render_core/first_sight", "render_core/scene/files", "render_core/synth", "render_core/tools",
    "render_core/tools/bench render_core/tools/render render_core/tools/trace",
    "render_core/tools/paper",
    "server/base", "server/encode", "server/pipeline", "server/net", "server/config server/access server/flow server/media",
    "server/scenes server/schedule server/counts", "server/visit server/films", "server",
    "web_client/src/base web_client/src/text web_client/src/wire",
    "web_client/src/camera web_client/src/decode web_client/src/measure web_client/src/transport",
    "web_client/src/input web_client/src/present web_client/src/session web_client/src/stats web_client/src/tour web_client/src/walk",
    "web_client/src/worker web_client/src/captions web_client/src/portals web_client/src/film web_client/src/charts",
    "web_client/src/page", "web_client/src/author", "web_client/src/ui", "web_client/src/media web_client/src/walkable_area web_client/src/headset",
    "web_client/src",
]) for name in line.split()}
LAYERED = re.compile(r"^render_core/|^server/|^web_client/src/(?!\w+/generated/)")


INCLUDE_RULES = [
    IncludeRule(r"^render_core/", r"^(proto|tests|deploy)/|^catgs\.pb\.h$",
                "render_core knows neither server nor wire"),
    IncludeRule(r"^render_core/(?!tools/|video/)",
                r"^(libwebsockets|lib(av|sw)\w+/|google/protobuf|openssl/|boost/(asio|beast))",
                "render_core has no network, codec or protobuf (video/ and tools/ may write files)"),
    IncludeRule(r"^(render_core/(?!cpu/|cuda/|make_renderer\.cpp)|server/)",
                r"^render_core/(cpu|cuda)/",
                "make_renderer.cpp is the only place that chooses a core"),
    IncludeRule(r"^(render_core/(?!reference/|tools/|make_renderer\.cpp)|server/)",
                r"^render_core/reference/", "the oracle serves make_renderer.cpp, tools and tests"),
    IncludeRule(r"^server/(?!scenes/scene_catalog\.cpp)", r"^render_core/synth/",
                "scene_catalog.cpp alone makes procedural scenes"),
    IncludeRule(r"^server/", r"^render_core/tools/", "the command-line tool is nobody's library"),
    IncludeRule(r"^server/", r"^tests/", "the product does not depend on its tests"),
    IncludeRule(r"^server/(?!net/)", r"^libwebsockets\.h$", "server/net alone speaks to the socket"),
    IncludeRule(r"^server/(?!net/wire)", r"\.pb\.h$", "server/net/wire alone speaks protobuf"),
    IncludeRule(r"^server/(?!encode/)", r"^lib(av|sw)\w+/", "server/encode alone speaks to the codecs"),
]
# TypeScript follows the same idea by module path.
IMPORT_RULES = [
    IncludeRule(r"^web_client/src/(?!wire/)", r"^@bufbuild/protobuf|wire/generated/",
                "src/wire alone speaks protobuf"),
    IncludeRule(r"^web_client/src/(page|author|ui|media|walkable_area|headset)/", r"^\.\./(transport/|worker/worker$|session/session$)",
                "the page speaks to the worker through worker/client"),
]

class BannedCall(NamedTuple):
    """What `pattern` finds in files whose path matches `where` must be written otherwise."""

    where: str
    pattern: str
    reason: str


BANNED_CALLS = [
    BannedCall(r"\.(h|cpp|cu|cuh)$", r"\b(str(n?cpy|n?cat)|v?sprintf|gets|strtok)\(",
               "writes beyond its buffer: std::string or fmt"),
    BannedCall(r"^(server|render_core)/.*\.(h|cpp|cu|cuh)$", r"(?<![\w.>])(ato[ilf]|std::sto\w+|sscanf)\(",
               "takes half a number for a number: std::from_chars, and look at its end"),
    BannedCall(r"^(server|render_core)/.*\.(h|cpp|cu|cuh)$", r"(?<![\w.>:])(system|popen)\(",
               "a shell reads what strangers wrote"),
    BannedCall(r"\.(h|cpp|cu|cuh)$", r"(?<![\w.>:])(s?rand|localtime|gmtime|asctime|ctime|tmpnam|mktemp|alloca)\(",
               "shared state, a race for a name, or a stack without an end"),
    BannedCall(r"^(server|render_core)/", r"std::regex\b", "its recursion ends the stack"),
    BannedCall(r"\.(h|cpp|cu|cuh)$", r"\busing namespace std;", "names change their meaning"),
    BannedCall(r"\.(h|cpp|cu|cuh)$", r"\bfriend\s+(class\s+|struct\s+)?[\w:<>]+;",
               "two classes that know each other's inside are one"),
    BannedCall(r"^server/", r"\.detach\(\);.*thread|std::thread\([^;]*\)\.detach\(", "nobody waits for its end"),
    BannedCall(r"^server/(?!base/log).*\.(h|cpp)$", r"\bspdlog::(?!level)",
               "a line without facts: log_info and its like of log_event.h"),
    BannedCall(r"^web_client/src/.*\.ts$",
               r"\.(inner|outer)HTML\b|insertAdjacentHTML|document\.write|\beval\(|new Function\(",
               "text of scenes and servers would become a page's code: textContent"),
    BannedCall(r"^(?!tests/lint/).*\.py$", r"shell=True|os\.system\(|\byaml\.load\(|^import pickle|(?<![\w.])eval\(",
               "input becomes code"),
]

MAX_LINES = 450
MAX_README_WORDS = 1800
MAX_IMPORTS = 20

# Pages and folders whose English is plain. Others follow.
PLAIN = re.compile(r"^(render_core|server|deploy|docker|proto|tests/(render_core|load|fuzz|bench|support|deploy))/|\.md$")
IDIOMS = re.compile(r"\b(of late|for want of|(is|are|was|were) told|go(es)? on)\b", re.IGNORECASE)
NO_CLAIM = re.compile(r"(Of|Who(se)?|That|What|Where|With|For|To|In|By|From)[A-Z]")

# Pages whose tables name constants of the sources, and tests.
SECURITY_PAGES = ("deploy/SECURITY.md", "deploy/FAULTS.md", "deploy/LIMITS.md")

# Spelt in two parts so that this file does not report itself.
MARKER_WORDS = re.compile(r"\b(" + "|".join(a + b for a, b in
                                           [("TO", "DO"), ("FIX", "ME"), ("XX", "X"), ("HA", "CK")]) + r")\b")
INCLUDE = re.compile(r'^\s*#\s*include\s*[<"]([^>"]+)[>"]')
MARKDOWN_LINK = re.compile(r"\]\((?![a-z]+:)([^)#\s]*)#?([^)\s]*)\)")
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


def layer_of(path: str) -> str:
    """The folder of a file, or of a module that is imported by its folder's name."""
    return path if path in LAYERS else os.path.dirname(path)


def layer_findings(path: str, number: int, target: str) -> Iterator[str]:
    """What is wrong with an #include or import of `target` in line `number` of `path`, by LAYERS."""
    if target.startswith("."):
        target = os.path.normpath(os.path.join(os.path.dirname(path), target))
    own, other = layer_of(path), layer_of(target)
    if LAYERED.search(path) and LAYERED.search(target) and own != other:
        if unknown := [layer for layer in (own, other) if layer not in LAYERS]:
            yield f"{path}:{number}: {unknown[0]} is not in LAYERS of lint.py"
        elif LAYERS[own] <= LAYERS[other]:
            yield f"{path}:{number}: includes {target}: {own} does not lie above {other}"


def import_findings(path: str, targets: set[str]) -> Iterator[str]:
    """Too many modules of ours that a file includes or imports, as 'file:line: text'."""
    count = sum(target.startswith(("./", "../", "#client/", "render_core/", "server/", "tests/")) for target in targets)
    if count > MAX_IMPORTS:
        yield f"{path}:1: includes {count} files of ours, the limit is {MAX_IMPORTS}: split it"


def rule_findings(path: str, lines: list[str]) -> Iterator[str]:
    """Findings of `rules` for one file, as 'file:line: text'."""
    if len(lines) > MAX_LINES:
        yield f"{path}:{len(lines)}: {len(lines)} lines, the limit is {MAX_LINES}: split the file"
    # Highway includes its *-inl.h once per instruction set.
    if re.search(r"(?<!-inl)\.(h|cuh)$", path) and "#pragma once" not in lines:
        yield f"{path}:1: no #pragma once"
    pattern, rules = (IMPORT, IMPORT_RULES) if path.endswith(".ts") else (INCLUDE, INCLUDE_RULES)
    rules = [rule for rule in rules if re.search(rule.where, path)]
    banned = [call for call in BANNED_CALLS if re.search(call.where, path)]
    targets = set()
    for number, line in enumerate(lines, start=1):
        if MARKER_WORDS.search(line):
            yield f"{path}:{number}: marker word: do it, or say in prose what is missing"
        code = line.split("//")[0]
        for call in banned:
            if re.search(call.pattern, code):
                yield f"{path}:{number}: {code.strip()}: {call.reason}"
        target = pattern.search(line)
        if target:
            targets.add(target.group(1))
            yield from layer_findings(path, number, target.group(1))
        for rule in rules if target else []:
            if re.search(rule.forbidden, target.group(1)):
                yield f"{path}:{number}: includes {target.group(1)}: {rule.reason}"
    yield from import_findings(path, targets)


def english_findings(path: str, lines: list[str]) -> Iterator[str]:
    """Idioms that readers stumble over, and names of tests that claim nothing, as 'file:line: text'."""
    for number, line in enumerate(lines if PLAIN.search(path) else [], start=1):
        if idiom := IDIOMS.search(line):
            yield f"{path}:{number}: \"{idiom.group()}\": say it in plain words"
    text = "\n".join(lines)
    for test in CXX_TEST.finditer(text):
        if NO_CLAIM.match(test.group(2)):
            yield f"{path}:{text.count(chr(10), 0, test.start()) + 1}: {test.group(2)}: a test's name is a claim"


def link_findings(root: pathlib.Path, path: str, lines: list[str]) -> Iterator[str]:
    """Links of a Markdown file that lead to no file or heading, and a README that is too long, as 'file:line: text'."""
    for number, line in enumerate(lines, start=1):
        for target, heading in MARKDOWN_LINK.findall(line):
            file = (root / path).parent / target if target else root / path
            if not file.exists():
                yield f"{path}:{number}: links to {target}, which does not exist"
            elif heading and heading not in [re.sub(r"[^\w -]", "", text.lower()).replace(" ", "-")
                                             for text in re.findall(r"^#+ (.+)$", file.read_text("utf-8"), re.MULTILINE)]:
                yield f"{path}:{number}: {target or path} has no heading #{heading}"
    words = sum(len(line.split()) for line in lines)
    if path.endswith("README.md") and words > MAX_README_WORDS:
        yield f"{path}:1: {words} words, the limit is {MAX_README_WORDS}: split it by what readers ask"


def security_findings(page: str, lines: list[str], code: dict[str, str]) -> Iterator[str]:
    """Constants and tests named by a security page that are not there, as 'file:line: text'.
    `code`: what the sources hold, by path."""
    tests = set()
    for text in code.values():
        tests.update(f"{suite}.{name}" for suite, name in CXX_TEST.findall(text))
    suites = {test.split(".")[0] for test in tests}
    for number, line in enumerate(lines, start=1):
        for path, name in re.findall(r"`([\w/]+\.(?:h|cpp)): (\w+)`", line):
            if not re.search(rf"\b{name}\b", code.get(path, "")):
                yield f"{page}:{number}: {path} has no {name}"
        for test in re.findall(r"`([A-Z]\w*\.(?:\w+|\*))`", line):
            if test not in tests and not (test.endswith(".*") and test[:-2] in suites):
                yield f"{page}:{number}: there is no test {test}"


def check_rules(root: pathlib.Path) -> int:
    findings = []
    code: dict[str, str] = {}
    for path in source_files(root):
        is_document = path.endswith(".md")
        if not is_document and not SOURCE.search(path) and not is_shell(root, path):
            continue
        lines = (root / path).read_text("utf-8").splitlines()
        findings += link_findings(root, path, lines) if is_document else rule_findings(path, lines)
        findings += english_findings(path, lines)
        if CXX.search(path):
            code[path] = "\n".join(lines)
    for page in SECURITY_PAGES:
        findings += security_findings(page, (root / page).read_text("utf-8").splitlines(), code)
    print("\n".join(findings))
    return 1 if findings else 0


class Missing(Exception):
    """A tool is not installed."""


def find_tool(name: str, version: str = "") -> str:
    """The tool's path; with `version` either name-version or a plain name of that major version."""
    if tool := version and shutil.which(f"{name}-{version}"):
        return tool
    tool = shutil.which(name)
    if tool and (not version or re.search(rf"version {version}\.", subprocess.run(
            [tool, "--version"], capture_output=True, text=True, check=True).stdout)):
        return tool
    raise Missing(f"{name} {version}".strip())


def check_declarations(root: pathlib.Path) -> int:
    tool = find_tool("ctags")
    code = {path: (root / path).read_text("utf-8") for path in source_files(root) if CXX.search(path)}
    product = {path: text for path, text in code.items() if not path.startswith("tests/")}
    tags = declarations.ctags(tool, root, list(code))
    findings = [*declarations.size_findings(tags), *declarations.stale_findings(tags),
                *declarations.unreached_findings(code),
                *declarations.unused_findings([tag for tag in tags if tag.path in product], product)]
    print("\n".join(findings))
    return 1 if findings else 0


def check_shell(root: pathlib.Path) -> int:
    tool = find_tool("shellcheck")
    scripts = [path for path in source_files(root) if is_shell(root, path)]
    return subprocess.run([tool, "--external-sources", "--format=gcc", *scripts],
                          cwd=root, check=False).returncode


def check_format(root: pathlib.Path) -> int:
    tool = find_tool("clang-format", "14")
    sources = [path for path in source_files(root) if CXX.search(path)]
    return subprocess.run([tool, "--dry-run", "-Werror", *sources], cwd=root, check=False).returncode


# Left out: what it takes for a mistake because it does not know lambdas with template parameters,
# chrono's literals, check() functions that throw, and logarithms of 0 that are meant.
CPPCHECK_SUPPRESSED = ["cppcheckError", "internalAstError", "invalidFunctionArg", "missingIncludeSystem",
                       "nullPointerRedundantCheck", "passedByValue", "returnDanglingLifetime", "syntaxError",
                       "toomanyconfigs", "unknownMacro", "useInitializationList"]


def check_cppcheck(root: pathlib.Path, build: pathlib.Path) -> int:
    tool = find_tool("cppcheck")
    build.mkdir(parents=True, exist_ok=True)
    # Not Highway's file, which includes itself once for each instruction set.
    sources = [path for path in source_files(root)
               if re.match(r"(server|render_core)/.*\.cpp$", path) and not path.endswith("/kernels.cpp")]
    return subprocess.run(
        [tool, f"-j{os.cpu_count()}", f"--cppcheck-build-dir={build}", "--std=c++20", "--language=c++",
         "--enable=warning,performance,portability", "--inline-suppr",
         "--quiet", "--error-exitcode=1", "-I.", "--template={file}:{line}: {id}: {message}",
         *(f"--suppress={name}" for name in CPPCHECK_SUPPRESSED), *sources],
        cwd=root, check=False).returncode


# Of a large commit the first ones: all of them are looked at by `deploy/test.sh --full`.
MAX_CHANGED = 6


def changed_files(root: pathlib.Path) -> set[str]:
    """What the newest commit and the working tree changed; empty where this is no clone."""
    result = subprocess.run(["git", "diff", "--name-only", "--diff-filter=d", "HEAD~1"], cwd=root,
                            capture_output=True, text=True, check=False)
    return {str(root / path) for path in result.stdout.splitlines()}


def check_tidy(root: pathlib.Path, build: pathlib.Path, only_changed: bool) -> int:
    tool = find_tool("clang-tidy", "14")
    commands = json.loads((build / "compile_commands.json").read_text("utf-8"))
    ours = re.compile(rf"^{re.escape(str(root))}/(render_core|server)/.*\.cpp$")
    sources = sorted({c["file"] for c in commands if ours.match(c["file"])})
    if only_changed:
        changed = changed_files(root)
        sources = [source for source in sources if source in changed][:MAX_CHANGED]
        print("\n".join(["looks at:", *sources]))

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
    parser.add_argument("check", choices=["rules", "declarations", "shell", "format", "cppcheck", "tidy"])
    parser.add_argument("--root", type=pathlib.Path,
                        default=pathlib.Path(__file__).resolve().parents[2])
    parser.add_argument("--build", type=pathlib.Path, help="build folder, for tidy; cppcheck's own")
    parser.add_argument("--changed", action="store_true", help="tidy: what the newest commit changed")
    arguments = parser.parse_args()
    root = arguments.root.resolve()
    if arguments.check in ("tidy", "cppcheck") and arguments.build is None:
        parser.error(f"{arguments.check} needs --build")
    checks = {"rules": check_rules, "declarations": check_declarations, "shell": check_shell, "format": check_format,
              "cppcheck": lambda root: check_cppcheck(root, arguments.build.resolve()),
              "tidy": lambda root: check_tidy(root, arguments.build.resolve(), arguments.changed)}
    try:
        return checks[arguments.check](root)
    except Missing as tool:
        print(f"SKIPPED: {tool} is not installed")
        return EXIT_SKIPPED


if __name__ == "__main__":
    sys.exit(main())
