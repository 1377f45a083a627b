"""What the samples of a soak say: flat or not, and a page with plots.

A quantity is flat when its lower envelope does not rise. Warm-up, the first quarter of the time and
a quarter of an hour at most (so long heaps may fill), and the silence after a run's last
round are left out. What is left, in a short run with some of the warm-up in it, is cut into
twelve windows of as many samples, of which each gives its least value: what is still there when
most visitors have just gone. Theil and Sen's slope through those, the median of the slopes of all
pairs, times the time from the first to the last is the growth. One window that stands out moves it little; a leak moves all of them.
"""

import html
import itertools
import statistics
from typing import NamedTuple

WARM_UP_SHARE, WARM_UP_S = 0.25, 900.0
WINDOWS = 12


class Quantity(NamedTuple):
    """May grow by the larger of `allowed` and `allowed_share` of its median."""

    name: str
    title: str
    unit: str
    allowed: float
    allowed_share: float


QUANTITIES = [
    Quantity("rss_mb", "Memory, resident", "MB", 2.0, 0.02),
    Quantity("descriptors", "Open descriptors", "", 1.0, 0.0),
    Quantity("threads", "Threads", "", 1.0, 0.0),
    Quantity("device_mb", "Memory in use on the GPU", "MB", 16.0, 0.01),
]

Sample = dict[str, float]
Points = list[tuple[float, float]]


def points_of(samples: list[Sample], name: str) -> Points:
    return [(sample["at_s"], sample[name]) for sample in samples if name in sample]


def lower_envelope(points: Points) -> Points:
    """The least of each window after the warm-up, at the window's middle; empty with too few."""
    if not points:
        return []
    begin_s, end_s = points[0][0], points[-1][0]
    warm_s = begin_s + min(WARM_UP_S, WARM_UP_SHARE * (end_s - begin_s))
    points = [point for point in points if point[0] >= warm_s]
    if len(points) < 2 * WINDOWS:
        return []
    bounds = [round(i * len(points) / WINDOWS) for i in range(WINDOWS + 1)]
    windows = [points[a:b] for a, b in itertools.pairwise(bounds)]
    return [((w[0][0] + w[-1][0]) / 2, min(value for _, value in w)) for w in windows]


def growth(envelope: Points) -> float:
    slopes = [(b[1] - a[1]) / (b[0] - a[0]) for a, b in itertools.combinations(envelope, 2)]
    return statistics.median(slopes) * (envelope[-1][0] - envelope[0][0])


def judge(samples: list[Sample]) -> dict:
    """The report, as JSON: "flat" is false also where there is too little to judge by."""
    report: dict = {"flat": bool(samples), "samples": len(samples), "quantities": {}}
    if samples:
        report["minutes"] = round((samples[-1]["at_s"] - samples[0]["at_s"]) / 60.0, 1)
    for quantity in QUANTITIES:
        points = points_of(samples, quantity.name)
        if not points and quantity.name == "device_mb":
            continue  # no GPU
        envelope = lower_envelope(points_of([s for s in samples if "settling" not in s], quantity.name))
        allowed = max(quantity.allowed,
                      quantity.allowed_share * (statistics.median(v for _, v in points) if points else 0.0))
        grown = growth(envelope) if envelope else float("nan")
        flat = grown < allowed
        report["flat"] = report["flat"] and flat
        report["quantities"][quantity.name] = {
            "flat": flat, "growth": round(grown, 3), "allowed": round(allowed, 3), "envelope": envelope,
            "first": points[0][1] if points else None, "last": points[-1][1] if points else None,
            "max": max((v for _, v in points), default=None)}
    last = next((sample for sample in reversed(samples) if "catgs_sessions" in sample), {})
    report["counters"] = {name: value for name, value in last.items() if name.endswith("_total")}
    return report


def to_text(report: dict) -> str:
    lines = [f"{report.get('minutes', 0)} minutes, {report['rounds']} rounds: "
             f"{'flat' if report['flat'] else 'NOT FLAT'}, {len(report['errors'])} errors"]
    for name, quantity in report["quantities"].items():
        lines.append(f"  {name:12} first {quantity['first']}, last {quantity['last']}, max {quantity['max']}; lower "
                     f"envelope grew by {quantity['growth']}, allowed {quantity['allowed']}"
                     f"{'' if quantity['flat'] else '  <- NOT FLAT'}")
    memory = report["quantities"].get("rss_mb")
    whole_warm_up_min = WARM_UP_S / WARM_UP_SHARE / 60.0
    if memory and not memory["flat"] and report["minutes"] < whole_warm_up_min - 1.0:
        lines.append(f"  too short to judge memory by: heaps fill at first; take {whole_warm_up_min:.0f} minutes")
    lines += [f"  ERROR {error}" for error in report["errors"]]
    return "\n".join(lines)


WIDTH, HEIGHT, LEFT, RIGHT, TOP, BOTTOM = 900, 220, 56, 16, 30, 28
STYLE = """
:root { color-scheme: light dark; --ink: #1d2430; --soft: #667085; --paper: #fbfbf9; --line: #e2e4e8; --c0: #0b6bcb;
  --c1: #d9540b; --bad: #c8201e; --good: #1a8a4c; }
@media (prefers-color-scheme: dark) { :root { --ink: #e6e8ec; --soft: #98a2b3; --paper: #14171c; --line: #2b313a;
  --c0: #5aa9f5; --c1: #f58a4b; --bad: #ff6b66; --good: #4cc283; } }
body { margin: 2rem auto; max-width: 60rem; padding: 0 1rem; background: var(--paper); color: var(--ink);
  font: 15px/1.45 system-ui, sans-serif; }
h1 { font-size: 1.5rem; margin-bottom: .2rem; } p { color: var(--soft); margin: 0 0 1rem; }
svg { width: 100%; font: 11px system-ui, sans-serif; fill: var(--soft); }
svg .title { font-size: 13px; font-weight: 600; fill: var(--ink); }
.grid { stroke: var(--line); } .warm { fill: var(--line); opacity: .5; }
.samples { fill: none; stroke: var(--c0); stroke-width: 1.2; }
.envelope { fill: none; stroke: var(--c1); stroke-width: 2; }
.good { color: var(--good); } .bad { color: var(--bad); }
"""


def ticks(least: float, most: float) -> list[float]:
    """Round values about a fifth of the range apart, from under the least to above the most."""
    rough = max(most - least, 1e-6) / 4
    power = 10.0 ** (len(str(int(rough))) - 1) if rough >= 1 else 1.0 if most > 20 else 0.1
    step = power * next(digit for digit in (1, 2, 5, 10, 20) if digit * power >= rough)
    first, last = int(least // step), int(-(-most // step))
    return [i * step for i in range(first, max(last, first + 1) + 1)]


def plot(title: str, points: Points, envelope: Points, warm_s: float) -> str:
    """An SVG: samples over minutes, their lower envelope, the warm-up shaded. The y axis begins at 0,
    so that flat looks flat."""
    if not points:
        return ""
    begin, end = points[0][0], max(points[-1][0], points[0][0] + 1.0)
    y_ticks = ticks(0.0, max(v for _, v in points))

    def x(at_s: float) -> float:
        return LEFT + (WIDTH - LEFT - RIGHT) * (at_s - begin) / (end - begin)

    def y(value: float) -> float:
        return HEIGHT - BOTTOM - (HEIGHT - TOP - BOTTOM) * value / y_ticks[-1]

    parts = [f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img" aria-label="{html.escape(title)}">',
             f'<rect class="warm" x="{x(begin):.1f}" y="{TOP}" width="{x(warm_s) - x(begin):.1f}" '
             f'height="{HEIGHT - TOP - BOTTOM}"/>',
             f'<text class="title" x="{LEFT}" y="18">{html.escape(title)}</text>']
    for value in y_ticks:
        parts.append(f'<line class="grid" x1="{LEFT}" y1="{y(value):.1f}" x2="{WIDTH - RIGHT}" y2="{y(value):.1f}"/>'
                     f'<text x="{LEFT - 6}" y="{y(value) + 4:.1f}" text-anchor="end">{value:g}</text>')
    for minute in ticks(begin / 60, end / 60):
        if begin <= 60 * minute <= end:
            parts.append(f'<text x="{x(60 * minute):.1f}" y="{HEIGHT - 10}" text-anchor="middle">{minute:g} min</text>')
    for name, curve in (("samples", points), ("envelope", envelope)):
        # A pen that is lifted where nothing was measured.
        gap_s = 30.0 if name == "samples" else float("inf")
        steps = "".join(f"{'L' if i and s - curve[i - 1][0] < gap_s else 'M'}{x(s):.1f} {y(v):.1f}"
                        for i, (s, v) in enumerate(curve))
        parts.append(f'<path class="{name}" d="{steps}"/>')
    return "".join(parts) + "</svg>\n"


def to_html(report: dict, samples: list[Sample]) -> str:
    """One page without anything from elsewhere."""
    body = []
    for quantity in QUANTITIES:
        if quantity.name not in report["quantities"]:
            continue
        result = report["quantities"][quantity.name]
        title = (f"{quantity.title}{f' ({quantity.unit})' if quantity.unit else ''}: lower envelope grew by "
                 f"{result['growth']:.2f}, allowed {result['allowed']:.1f}")
        points = points_of(samples, quantity.name)
        span_s = points[-1][0] - points[0][0] if points else 0.0
        warm_s = points[0][0] + min(WARM_UP_S, WARM_UP_SHARE * span_s) if points else 0.0
        body.append(plot(title, points, result["envelope"], warm_s))
    body.append(plot("Sessions, those that lost their socket included", points_of(samples, "catgs_sessions"), [],
                     samples[0]["at_s"] if samples else 0.0))
    good = report["flat"] and not report["errors"]
    facts = ", ".join(f"{value:,.0f} {name.removeprefix('catgs_').removesuffix('_total').replace('_', ' ')}"
                      for name, value in report["counters"].items())
    return (f"<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Soak</title><style>{STYLE}</style>\n"
            f"<h1>Soak: <span class=\"{'good' if good else 'bad'}\">{'flat' if report['flat'] else 'not flat'}, "
            f"{len(report['errors'])} errors</span></h1>\n"
            f"<p>{report.get('minutes', 0)} minutes of one process, {facts}. Blue: once a second. Orange: the least of each "
            f"of {WINDOWS} windows. Grey: warm-up, not judged, as the silence at the end.</p>\n"
            + "".join(body)
            + "".join(f"<p class=\"bad\">{html.escape(error)}</p>\n" for error in report["errors"])
            + "</html>\n")
