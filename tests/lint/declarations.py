"""Checks of declarations, by universal-ctags: what nothing uses, and what has grown too large."""

import collections
import json
import pathlib
import re
import subprocess
from typing import Iterator, NamedTuple

MAX_FUNCTION_LINES = 70
MAX_METHODS = 25
MAX_FIELDS = 20
# A ratchet: these may shrink, never grow. Functions by "file: name", classes by name.
LONGER_FUNCTIONS = {
    "tests/render_core/scene/formats/encoders.cpp: encode_sog": 101,
}
LARGER_CLASSES = {
    "Metrics": "one field a metric",
    "ServerConfig": "one field a setting",
    "ViewMemory": "one field a buffer, by the table of a View's memory",
}
USED_ELSEWHERE = {
    "access_unit_delimiter", "sei", "si", "sp", "ref_idc",  # H.264's enumerations are whole
    "main", "clone", "flush_", "set_formatter_", "sink_it_",  # the system and spdlog call these
    "boolean", "end_array", "end_object", "number_float", "number_integer", "number_unsigned",
    "start_array", "start_object",  # nlohmann/json calls these
    "deadline_ns", "nice", "period_ns", "priority",  # the kernel reads these
    "about_nobody_", "former_log_handler",  # kept for what their constructors do
    "base_blue", "base_green", "base_red",  # read as one word
    "dropped_frames", "parse_slice_head", "simd_targets", "PinnedBuffer",  # tests look at these
}
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
WORD = re.compile(r"[A-Za-z_]\w*")
METHODS = {"prototype", "function"}


class Tag(NamedTuple):
    name: str
    kind: str
    path: str
    line: int
    end: int
    scope: str


def ctags(tool: str, root: pathlib.Path, paths: list[str]) -> list[Tag]:
    command = [tool, "--options=NONE", "--quiet", "--output-format=json", "-f", "-", "-L", "-",
               "--langmap=C++:+.h.cu.cuh", "--kinds-C++=+p-hdl", "--fields=+neKs", "-I", "__launch_bounds__+"]
    result = subprocess.run(command, input="\n".join(paths), cwd=root, capture_output=True, text=True, check=True)
    tags = []
    for line in result.stdout.splitlines():
        tag = json.loads(line)
        if tag["_type"] == "tag" and not tag["name"].startswith("__anon"):
            tags.append(Tag(tag["name"], tag["kind"], tag["path"], tag["line"], tag.get("end", tag["line"]),
                            tag.get("scope", "")))
    return tags


def size_findings(tags: list[Tag]) -> Iterator[str]:
    """Functions and classes beyond their limits, as 'file:line: text'."""
    methods, fields = collections.defaultdict(set), collections.Counter()
    for tag in tags:
        length = tag.end - tag.line + 1
        if tag.kind == "function" and length > LONGER_FUNCTIONS.get(f"{tag.path}: {tag.name}", MAX_FUNCTION_LINES):
            yield f"{tag.path}:{tag.line}: {tag.name} has {length} lines, the limit is {MAX_FUNCTION_LINES}: split it"
        fields[tag.scope] += tag.kind == "member"
        constructor = tag.name == tag.scope.split("::")[-1]
        if tag.kind in METHODS and not constructor and not tag.name.startswith(("operator", "~")):
            methods[tag.scope].add((tag.name, tag.line if tag.path.endswith(".h") else 0))
    for tag in tags:
        if tag.kind not in ("class", "struct") or tag.name in LARGER_CLASSES or tag.path.startswith("tests/"):
            continue
        scope = f"{tag.scope}::{tag.name}" if tag.scope else tag.name
        own = sum(line > 0 for _, line in methods[scope])
        for count, what, limit in ((own, "methods", MAX_METHODS), (fields[scope], "fields", MAX_FIELDS)):
            if count > limit:
                yield f"{tag.path}:{tag.line}: {tag.name} has {count} {what}, the limit is {limit}: split it"


def unused_findings(tags: list[Tag], code: dict[str, str]) -> Iterator[str]:
    """Names of the product that stand nowhere but in their declarations, as 'file:line: text'. `code`: what the
    product's sources hold, by path."""
    words = collections.Counter()
    for text in code.values():
        words.update(WORD.findall(COMMENT.sub("", text)))
    places = collections.defaultdict(set)
    for tag in tags:
        places[tag.name].add((tag.path, tag.line))
    for name, found in places.items():
        if WORD.fullmatch(name) and name not in USED_ELSEWHERE and words[name] <= len(found):
            path, line = min(found)
            yield f"{path}:{line}: nothing of the product uses {name}"


def unreached_findings(code: dict[str, str]) -> Iterator[str]:
    """Headers that no other file includes, as 'file:line: text'."""
    included = {target for path, text in code.items() for target in re.findall(r'#include "([^"]+)"', text)
                if target != path}
    for path in code:
        if path.endswith((".h", ".cuh")) and path not in included:
            yield f"{path}:1: no file includes it"
