#!/usr/bin/env python3
"""The checks of the dashboard find what they are for; operations.py uses them on the real one."""

import unittest

import dashboard_check
import operations


class Dashboard(unittest.TestCase):
    def findings(self, change):
        dashboard = operations.dashboard()
        stat = next(p for p in dashboard["panels"] if p["type"] == "stat")
        change(dashboard, stat)
        return " ".join(dashboard_check.findings(dashboard, {"prometheus"}))

    def test_each_mistake_is_named(self):
        for change, finding in (
            (lambda d, s: None, ""),
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
    unittest.main()
