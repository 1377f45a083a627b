"""Checks of declarations, by universal-ctags: what nothing uses, and what has grown too large.

Methods of a class are those that it declares, each overload, without constructors, the destructor and operators.
Fields are its own and those of its anonymous structs and unions.
"""

import collections
import json
import pathlib
import re
import subprocess
from typing import Iterator, NamedTuple

MAX_FUNCTION_LINES = 70
MAX_METHODS = 23
MAX_FIELDS = 20
# A ratchet: these may shrink, never grow, and leave the list when they meet the limit. By "file: name".
LONGER_FUNCTIONS = {
    "tests/render_core/scene/formats/encoders.cpp: encode_sog": 101,
}
# Classes of many fields, since each is a row of a table.
TABLES = {
    "Metrics": "one field a metric",
    "ServerConfig": "one field a setting",
    "ViewMemory": "one field a buffer, by the table of a View's memory",
}
USED_ELSEWHERE = {
    "access_unit_delimiter", "idr_slice", "sei", "ref_idc",  # H.264's enumerations are whole
    "main", "clone", "flush_", "set_formatter_", "sink_it_",  # the system and spdlog call these
    "boolean", "end_array", "end_object", "number_float", "number_integer", "number_unsigned",
    "start_array", "start_object",  # nlohmann/json calls these
    "deadline_ns", "nice", "period_ns", "priority",  # the kernel reads these
    "about_nobody_", "former_log_handler",  # kept for what their constructors do
    "base_blue", "base_green", "base_red",  # read as one word
}
COMMENT = re.compile(r"//[^\n]*|/\*.*?\*/", re.DOTALL)
WORD = re.compile(r"[A-Za-z_]\w*")
METHODS = {"prototype", "function"}
CLASSES = {"class", "struct", "union"}


class Tag(NamedTuple):
    name: str
    kind: str
    path: str
    line: int
    end: int
    scope: str
    typeref: str


def ctags(tool: str, root: pathlib.Path, paths: list[str]) -> list[Tag]:
    command = [tool, "--options=NONE", "--quiet", "--output-format=json", "-f", "-", "-L", "-",
               "--langmap=C++:+.h.cu.cuh", "--kinds-C++=+p-hdl", "--fields=+neKst", "-I", "__launch_bounds__+"]
    result = subprocess.run(command, input="\n".join(paths), cwd=root, capture_output=True, text=True, check=True)
    found = [tag for tag in map(json.loads, result.stdout.splitlines()) if tag["_type"] == "tag"]
    return [Tag(tag["name"], tag["kind"], tag["path"], tag["line"], tag.get("end", tag["line"]),
                tag.get("scope", ""), tag.get("typeref", "")) for tag in found]


def short_name(scope: str) -> str:
    """A class's name with the classes around it and without namespaces, as the lists above have it."""
    return re.sub(r"^([a-z]\w*::|__anon\w+::)+", "", scope)


def class_sizes(tags: list[Tag]) -> tuple[dict[str, int], dict[str, int]]:
    """How many methods and fields each class has, by its whole name."""
    methods, fields = collections.Counter(), collections.Counter()
    classes = {(tag.path, f"{tag.scope}::{tag.name}" if tag.scope else tag.name): range(tag.line, tag.end + 1)
               for tag in tags if tag.kind in CLASSES}
    for tag in tags:
        # Not a definition that stands outside its class.
        declared = tag.line in classes.get((tag.path, tag.scope), ())
        special = tag.name == tag.scope.split("::")[-1] or tag.name.startswith(("operator", "~", "__anon"))
        if tag.kind in METHODS and declared and not special:
            methods[tag.scope] += 1
        # What an anonymous struct holds counts, and not the name that holds it.
        if tag.kind == "member" and not re.search(r":__anon\w+$", tag.typeref):
            scope = tag.scope
            while (tag.path, scope) in classes and scope.split("::")[-1].startswith("__anon"):
                scope = scope.rpartition("::")[0]
            fields[scope] += 1
    return methods, fields


def size_findings(tags: list[Tag]) -> Iterator[str]:
    """Functions and classes beyond their limits, as 'file:line: text'."""
    methods, fields = class_sizes(tags)
    for tag in tags:
        place = f"{tag.path}:{tag.line}: {tag.name}"
        length = tag.end - tag.line + 1
        if tag.kind == "function" and length > LONGER_FUNCTIONS.get(f"{tag.path}: {tag.name}", MAX_FUNCTION_LINES):
            yield f"{place} has {length} lines, the limit is {MAX_FUNCTION_LINES}: split it"
        if tag.kind not in CLASSES or tag.name.startswith("__anon") or tag.path.startswith("tests/"):
            continue
        scope = f"{tag.scope}::{tag.name}" if tag.scope else tag.name
        name = short_name(scope)
        if methods[scope] > MAX_METHODS:
            yield f"{place} has {methods[scope]} methods, the limit is {MAX_METHODS}: split it"
        if fields[scope] > MAX_FIELDS and name not in TABLES:
            yield f"{place} has {fields[scope]} fields, the limit is {MAX_FIELDS}: split it"


def stale_findings(tags: list[Tag]) -> Iterator[str]:
    """Names on the lists above that need not stand there any more, as 'file:line: text'."""
    fields = {short_name(scope): count for scope, count in sorted(class_sizes(tags)[1].items(), key=lambda size: size[1])}
    lengths = {f"{tag.path}: {tag.name}": tag.end - tag.line + 1 for tag in tags if tag.kind == "function"}
    for title, listed, sizes, limit in (("LONGER_FUNCTIONS", LONGER_FUNCTIONS, lengths, MAX_FUNCTION_LINES),
                                        ("TABLES", TABLES, fields, MAX_FIELDS)):
        for name in listed:
            if sizes.get(name, 0) <= limit:
                yield f"tests/lint/declarations.py:1: {name} meets the limit of {limit}: take it off {title}"


def unused_findings(tags: list[Tag], code: dict[str, str]) -> Iterator[str]:
    """Names of the product that stand nowhere but in their declarations, as 'file:line: text'. `code`: what the
    product's sources hold, by path."""
    words = collections.Counter()
    for text in code.values():
        words.update(WORD.findall(COMMENT.sub("", text)))
    places = collections.defaultdict(set)
    for tag in tags:
        if not tag.name.startswith("__anon"):
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
