"""What Grafana would leave out or draw wrongly without a word."""

import itertools
import re

GRID_COLUMNS = 24
BUILT_IN = {"__rate_interval", "__interval", "__range"}
# What operators look for first.
SUBJECTS = {"sessions": "catgs_sessions", "queue": "catgs_sessions_waiting", "places": "catgs_seats",
            "frame rate": "catgs_frames_sent_total", "motion to photon": "catgs_motion_to_photon_seconds_bucket",
            "its stages": "catgs_frame_stage_seconds_bucket", "budget": "catgs_budget_used_ratio",
            "errors": "catgs_frames_failed_total", "alerts": "ALERTS"}


def expressions(dashboard):
    """(where, expression) of all that the panels ask Prometheus."""
    for panel in dashboard["panels"]:
        for target in panel.get("targets", []):
            yield panel["title"], target["expr"]


def findings(dashboard, source_uids):
    """What is wrong with a dashboard, one line each; `source_uids`: data sources that are provisioned."""
    panels = dashboard["panels"]
    variables = {variable["name"] for variable in dashboard["templating"]["list"]} | BUILT_IN
    found = [f"two panels have the id {i}" for i in _repeated(panel["id"] for panel in panels)]
    for panel in panels:
        found += [f"{panel['title']}: {what}" for what in _of_panel(panel, variables, source_uids)]
    for one, other in itertools.combinations(panels, 2):
        if _overlap(one["gridPos"], other["gridPos"]):
            found.append(f"{one['title']} covers {other['title']}")
    shown = " ".join(expression for _, expression in expressions(dashboard))
    found += [f"nothing shows {subject}" for subject, metric in SUBJECTS.items() if not re.search(rf"\b{metric}\b", shown)]
    return found


def _of_panel(panel, variables, source_uids):
    place = panel["gridPos"]
    if place["w"] < 1 or place["h"] < 1 or place["x"] < 0 or place["x"] + place["w"] > GRID_COLUMNS:
        yield f"is not within the {GRID_COLUMNS} columns"
    if panel["type"] == "row":
        return
    if panel.get("datasource", {}).get("uid") not in source_uids:
        yield "its data source is not provisioned"
    if not panel.get("targets"):
        yield "asks for nothing"
    yield from (f"two queries are {ref}" for ref in _repeated(target["refId"] for target in panel.get("targets", [])))
    for target in panel.get("targets", []):
        for name in re.findall(r"\$\{?(\w+)", target["expr"]):
            if name not in variables:
                yield f"there is no variable ${name}"
        for label in re.findall(r"\{\{(\w+)\}\}", target.get("legendFormat", "")):
            if re.match(r"(sum|histogram_quantile)", target["expr"]) and not re.search(rf"by \([^)]*\b{label}\b", target["expr"]):
                yield f"its legend names {label}, which the sum has lost"


def _repeated(names):
    names = list(names)
    return sorted({name for name in names if names.count(name) > 1})


def _overlap(one, other):
    return (one["x"] < other["x"] + other["w"] and other["x"] < one["x"] + one["w"]
            and one["y"] < other["y"] + other["h"] and other["y"] < one["y"] + one["h"])
