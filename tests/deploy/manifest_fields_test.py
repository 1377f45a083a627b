#!/usr/bin/env python3
"""The checks of manifests and of the dashboard find what they are for; operations.py uses them on the real ones."""

import copy
import sys
import unittest

import dashboard_check
import manifest_fields
import operations

TABLE = {
    "v1 Thing": {
        "metadata!": {"name!": "str"},
        "spec!": {"size!": "int", "port": "int|str", "mode": "Fast|Slow", "on": "bool", "free": "any",
                  "labels": {"*": "str"}, "parts": [{"name!": "str"}]},
    }
}
GOOD = {
    "apiVersion": "v1", "kind": "Thing", "metadata": {"name": "a"},
    "spec": {"size": 1, "port": "web", "mode": "Fast", "on": True, "free": {"x": 1}, "labels": {"a": "b"},
             "parts": [{"name": "one"}, {"name": "two"}]},
}


def with_field(path, value):
    manifest = copy.deepcopy(GOOD)
    place = manifest
    for name in path[:-1]:
        place = place[name]
    place[path[-1]] = value
    return manifest


class ManifestFields(unittest.TestCase):
    def test_a_good_one(self):
        self.assertEqual(manifest_fields.findings(TABLE, GOOD), [])

    def test_each_mistake_is_named(self):
        for path, value, finding in (
            (("kind",), "Thong", "v1 Thong is no kind that manifest_fields.yaml knows"),
            (("spec", "sice"), 2, "v1 Thing.spec.sice is no field"),
            (("spec", "size"), "1", "v1 Thing.spec.size is '1', not int"),
            (("spec", "size"), True, "v1 Thing.spec.size is True, not int"),
            (("spec", "mode"), "fast", "v1 Thing.spec.mode is 'fast', not Fast|Slow"),
            (("spec", "port"), 1.5, "v1 Thing.spec.port is 1.5, not int|str"),
            (("spec", "labels", "n"), 7, "v1 Thing.spec.labels.n is 7, not str"),
            (("spec", "parts"), {}, "v1 Thing.spec.parts is not a list"),
            (("spec", "parts", 1), {"nam": "two"}, "v1 Thing.spec.parts[1].nam is no field"),
            (("metadata",), {}, "v1 Thing.metadata.name is missing"),
            (("spec",), None, "v1 Thing.spec has no fields"),
        ):
            self.assertIn(finding, manifest_fields.findings(TABLE, with_field(path, value)))


class Dashboard(unittest.TestCase):
    def findings(self, change):
        dashboard = operations.dashboard()
        stat = next(p for p in dashboard["panels"] if p["type"] == "stat")
        change(dashboard, stat)
        return " ".join(dashboard_check.findings(operations.field_table(), dashboard, {"prometheus"}))

    def test_each_mistake_is_named(self):
        for change, finding in (
            (lambda d, s: None, ""),
            (lambda d, s: s.update(tpye="stat"), "Dashboard.panels[0].tpye is no field"),
            (lambda d, s: s["fieldConfig"]["defaults"].update(unit="sec"), "unit is 'sec'"),
            (lambda d, s: s.update(id=d["panels"][1]["id"]), "two panels have the id"),
            (lambda d, s: s["datasource"].update(uid="other"), "its data source is not provisioned"),
            (lambda d, s: s.update(targets=[]), "asks for nothing"),
            (lambda d, s: s["targets"].append(s["targets"][0]), "two queries are A"),
            (lambda d, s: s["targets"][0].update(expr="up{a=~\"$server\"}"), "there is no variable $server"),
            (lambda d, s: s["targets"][0].update(legendFormat="{{instance}}"), "its legend names instance"),
            (lambda d, s: s["gridPos"].update(w=25), "is not within the 24 columns"),
            (lambda d, s: s["gridPos"].update(w=5), "covers"),
            (lambda d, s: d["panels"].clear(), "nothing shows budget"),
        ):
            found = self.findings(change)
            self.assertIn(finding, found)
            self.assertEqual(bool(finding), bool(found))


if __name__ == "__main__":
    try:
        operations.field_table()
    except operations.Skip as why:
        print(f"SKIPPED: {why}")
        sys.exit(operations.EXIT_SKIPPED)
    unittest.main()
