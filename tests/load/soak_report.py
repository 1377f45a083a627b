"""What the samples of a soak say: flat or not.

A quantity is flat when its lower envelope does not rise. Warm-up, when heaps fill, and the silence
after a run's last round are left out. Unless told, warm-up is the first quarter of the time, and a
quarter of an hour at most. What is left, in a short run with some of the warm-up in it, is cut into
twelve windows of as many samples, of which each gives its least value: what is still there when
most visitors have just gone. Theil and Sen's slope through those, the median of the slopes of all
pairs, times the time from the first to the last is the growth. One window that stands out moves it
little; a leak moves all of them.
"""

import itertools
import statistics
from typing import NamedTuple

WARM_UP_SHARE, WARM_UP_S = 0.25, 900.0
WINDOWS = 12


class Quantity(NamedTuple):
    """May grow by the larger of `allowed` and `allowed_share` of its median."""

    name: str
    allowed: float
    allowed_share: float
    minutes: float = 0.0  # of samples that judge it


QUANTITIES = [
    # A heap keeps what it was once asked for, in fragments: it fills to the peak of its use first.
    Quantity("rss_mb", 2.0, 0.02, minutes=WARM_UP_S / WARM_UP_SHARE / 60.0 - 1.0),
    Quantity("heap_mb", 2.0, 0.02),
    Quantity("descriptors", 1.0, 0.0),
    Quantity("threads", 1.0, 0.0),
    Quantity("device_mb", 16.0, 0.01),
]

Sample = dict[str, float]
Points = list[tuple[float, float]]


def points_of(samples: list[Sample], name: str) -> Points:
    return [(sample["at_s"], sample[name]) for sample in samples if name in sample]


def lower_envelope(points: Points, warm_up_s: float | None = None) -> Points:
    """The least of each window after the warm-up, at the window's middle; empty with too few."""
    if not points:
        return []
    begin_s, end_s = points[0][0], points[-1][0]
    if warm_up_s is None:
        warm_up_s = min(WARM_UP_S, WARM_UP_SHARE * (end_s - begin_s))
    points = [point for point in points if point[0] >= begin_s + warm_up_s]
    if len(points) < 2 * WINDOWS:
        return []
    bounds = [round(i * len(points) / WINDOWS) for i in range(WINDOWS + 1)]
    windows = [points[a:b] for a, b in itertools.pairwise(bounds)]
    return [((w[0][0] + w[-1][0]) / 2, min(value for _, value in w)) for w in windows]


def growth(envelope: Points) -> float:
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.combinations(envelope, 2)]
    return statistics.median(slopes) * (envelope[-1][0] - envelope[0][0])


def judge(samples: list[Sample], warm_up_s: float | None = None) -> dict:
    """The report, as JSON: "flat" is false also where there is too little to judge by."""
    report: dict = {"flat": bool(samples), "samples": len(samples), "quantities": {}}
    if samples:
        report["minutes"] = round((samples[-1]["at_s"] - samples[0]["at_s"]) / 60.0, 1)
    for quantity in QUANTITIES:
        points = points_of(samples, quantity.name)
        if not points and quantity.name == "device_mb":
            continue  # no GPU
        envelope = lower_envelope(points_of([s for s in samples if "settling" not in s], quantity.name), warm_up_s)
        allowed = max(quantity.allowed,
                      quantity.allowed_share * (statistics.median(v for _, v in points) if points else 0.0))
        grown = growth(envelope) if envelope else float("nan")
        flat = grown < allowed or 0.0 < report.get("minutes", 0.0) < quantity.minutes
        report["flat"] = report["flat"] and flat
        report["quantities"][quantity.name] = {
            "flat": flat, "growth": round(grown, 3), "allowed": round(allowed, 3), "envelope": envelope,
            "first": points[0][1] if points else None, "last": points[-1][1] if points else None,
            "max": max((v for _, v in points), default=None)}
    last = next((sample for sample in reversed(samples) if "catgs_sessions" in sample), {})
    report["counters"] = {name: value for name, value in last.items() if name.endswith("_total")}
    return report


def chart_document(report: dict, samples: list[Sample]) -> dict:
    """For charts.html of the web client."""
    def curve(name: str, points: Points) -> dict:
        return {"name": name, "x": [at_s for at_s, _ in points], "y": [value for _, value in points]}

    plots = [{"title": name, "unit": "", "curves": [curve(name, points_of(samples, name)),
                                                    curve("lower envelope", quantity["envelope"])]}
             for name, quantity in report["quantities"].items()]
    return {"title": "Soak", "facts": to_text(report).splitlines()[0],
            "parts": [{"heading": "Over time, in seconds", "plots": plots}]}


def to_text(report: dict) -> str:
    lines = [f"{report.get('minutes', 0)} minutes, {report['rounds']} rounds: "
             f"{'flat' if report['flat'] else 'NOT FLAT'}, {len(report['errors'])} errors"]
    for name, quantity in report["quantities"].items():
        lines.append(f"  {name:12} first {quantity['first']}, last {quantity['last']}, max {quantity['max']}; lower "
                     f"envelope grew by {quantity['growth']}, allowed {quantity['allowed']}"
                     f"{'' if quantity['flat'] else '  <- NOT FLAT'}")
    if report.get("minutes", 0.0) < QUANTITIES[0].minutes:
        lines.append(f"  too short to judge rss_mb by: take {QUANTITIES[0].minutes + 1.0:.0f} minutes")
    lines += [f"  ERROR {error}" for error in report["errors"]]
    return "\n".join(lines)
