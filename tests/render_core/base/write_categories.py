#!/usr/bin/env python3
"""Writes the general categories of all characters, as Python's unicodedata has them, as a C++ header.

Unassigned characters have a category of their own: a later Unicode may assign them to any.
"""

import itertools
import sys
import unicodedata


def kind(code_point: int) -> str:
    category = unicodedata.category(chr(code_point))
    if category in ("Cc", "Cf", "Zl", "Zp"):
        return "unprintable"
    return "unassigned" if category == "Cn" else "printable"


print("constexpr CategoryRange categories[] = {")
for name, run in itertools.groupby(range(sys.maxunicode + 1), kind):
    points = list(run)
    print(f"    {{0x{points[0]:x}, 0x{points[-1]:x}, Category::{name}}},")
print("};")
