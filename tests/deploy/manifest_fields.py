"""Are a manifest's fields those that its kind has? By the table in manifest_fields.yaml, whose head explains it."""

# True is an int to Python, and to nobody else.
WORDS = {"str": (str,), "int": (int,), "num": (int, float), "bool": (bool,), "null": (type(None),)}


def findings(table, manifest):
    """What is wrong with a manifest, one line each."""
    kind = f"{manifest.get('apiVersion')} {manifest.get('kind')}"
    if kind not in table:
        return [f"{kind} is no kind that manifest_fields.yaml knows"]
    content = {key: value for key, value in manifest.items() if key not in ("apiVersion", "kind")}
    return list(_compare(table[kind], content, kind))


def _compare(expected, value, where):
    if expected == "any":
        return
    if isinstance(expected, dict):
        yield from _compare_fields(expected, value, where)
    elif isinstance(expected, list):
        if not isinstance(value, list):
            yield f"{where} is not a list"
            return
        for i, entry in enumerate(value):
            yield from _compare(expected[0], entry, f"{where}[{i}]")
    elif not any(_is(word, value) for word in expected.split("|")):
        yield f"{where} is {value!r}, not {expected}"


def _compare_fields(expected, value, where):
    if not isinstance(value, dict):
        yield f"{where} has no fields"
        return
    fields = {name.rstrip("!"): kind for name, kind in expected.items()}
    for name in fields:
        if name + "!" in expected and name not in value:
            yield f"{where}.{name} is missing"
    for name, content in value.items():
        if name not in fields and "*" not in fields:
            yield f"{where}.{name} is no field"
        else:
            yield from _compare(fields.get(name, fields.get("*")), content, f"{where}.{name}")


def _is(word, value):
    return type(value) in WORDS[word] if word in WORDS else value == word
