"""A page for a meeting: one HTML document that loads nothing. Pure, apart from the picture's file."""

from __future__ import annotations

import base64
import html
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ground.reports.failure_modes import failure_modes
from ground.reports.figures import draw_day, undrawn
from ground.reports.plan_drawing import boxes, target_names, to_svg
from ground.reports.sol_kind_modes import sol_kind_modes

if TYPE_CHECKING:
    from planner.plan_tree_document import TreeDocument
    from planner.problem_document import ProblemDocument
    from rover_iface.terrain import Terrain

STYLE = """body{font:14px/1.45 sans-serif;color:#14202a;max-width:70em;margin:2em auto;padding:0 1em}
table{border-collapse:collapse;margin:0 0 1em}
td,th{border-bottom:1px solid #ccd5da;padding:.25em .7em;text-align:left;
vertical-align:top;overflow-wrap:break-word}td.n,th.n{text-align:right;white-space:nowrap}
img{max-width:100%}.tree{overflow-x:auto;border:1px solid #ccd5da}
.go,.stop{margin:0 0 1em;border-left:.5em solid #2f8f4e;background:#eef7f0;padding:.5em 1em}
.stop{border-color:#c0392b;background:#fbeeec}pre{overflow-x:auto;background:#f4f7f9;padding:.7em}
@media print{body{margin:0;max-width:none}h2{break-after:avoid}tr,img{break-inside:avoid}}"""

CHART_W, CHART_H, CHART_EDGE = 560.0, 130.0, 34.0


def page(title: str, parts: Iterable[str]) -> str:
    """Return the document; `title` is text, `parts` are HTML."""
    return (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        f"<title>{safe(title)}</title><style>{STYLE}</style></head>\n<body><h1>{safe(title)}</h1>\n"
        + "\n".join(part for part in parts if part)
        + "\n</body></html>\n"
    )


def safe(value: object) -> str:
    """Return a value as text that may stand in HTML."""
    return html.escape(str(value))


def table(head: Sequence[str], rows: Iterable[Sequence[object]], *, numbers: Iterable[int] = ()) -> str:
    """Return a table, or nothing without rows; `numbers` are the columns that stand to the right."""
    right = set(numbers)

    def line(tag: str, cells: Sequence[object]) -> str:
        marks = (' class="n"' if k in right else "" for k in range(len(cells)))
        shown = (f"<{tag}{mark}>{safe(cell)}</{tag}>" for mark, cell in zip(marks, cells, strict=True))
        return "<tr>" + "".join(shown) + "</tr>"

    lines = [line("td", row) for row in rows]
    if not lines:
        return ""
    return "<table>" + "".join(([line("th", head)] if head else []) + lines) + "</table>"


def number(value: float | None, unit: str = "") -> str:
    """Return a number for people, `-` for none."""
    return "-" if value is None else f"{value:.1f}{unit}"


def map_picture(
    terrain: Terrain, problem: ProblemDocument, tree: TreeDocument, alt: str, **shown: Any
) -> str:
    """Return the map as an image inside the page, or why there is none; `shown` goes to `draw_day`."""
    if reason := undrawn():
        return f"<p>{safe(reason)}</p>"
    with tempfile.TemporaryDirectory(prefix="outcrop-report-") as work:
        picture = Path(work) / "map.png"
        draw_day(picture, terrain, problem, tree, **shown)
        image = base64.b64encode(picture.read_bytes()).decode()
    return f'<img alt="{safe(alt)}" src="data:image/png;base64,{image}">'


def tree_drawing(tree: TreeDocument, problem: ProblemDocument) -> str:
    """Return the plan tree as a drawing."""
    return f'<div class="tree">{to_svg(boxes(tree, target_names(problem)), outline=True)}</div>'


def failure_table(tree: TreeDocument, problem: ProblemDocument) -> str:
    """Return what is most likely to go wrong with a plan, with what hangs on it."""
    beside = sol_kind_modes(tree, problem)
    modes = failure_modes(tree, problem, target_names(problem), beside=beside)
    rows = [
        (mode.what, f"{mode.chance:.1%}", f"{mode.at_stake:g}", f"{mode.expected_loss:.2f}") for mode in modes
    ]
    head = ("what may go wrong", "chance", "value at stake", "expected loss")
    return table(head, rows, numbers=(1, 2, 3)) or "<p>None known.</p>"


def histogram(
    edges: Sequence[float], shares: Sequence[float], what: str, *, mark: float | None = None
) -> str:
    """Return shares of the futures as bars over `edges` (one more than bars); `mark` is a line across."""
    low, high = edges[0], edges[-1]
    if mark is not None:
        low, high = min(low, mark), max(high, mark)
    scale = CHART_W / max(high - low, 1e-9)
    top = max([*shares, 1e-9])
    total = CHART_H + CHART_EDGE
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{safe(what)}" '
        f'viewBox="-10 -14 {CHART_W + 20:.0f} {total + 14:.0f}" width="{CHART_W + 20:.0f}" '
        f'height="{total + 14:.0f}" font-family="sans-serif" font-size="11" fill="#14202a">'
    ]
    for left, right, share in zip(edges, edges[1:], shares, strict=False):
        tall = CHART_H * share / top
        out.append(
            f'<rect x="{(left - low) * scale:.1f}" y="{CHART_H - tall:.1f}" '
            f'width="{max(0.5, (right - left) * scale - 1):.1f}" height="{tall:.1f}" fill="#2b7fa8">'
            f"<title>{left:.1f} to {right:.1f}: {share:.1%}</title></rect>"
        )
    out.append(f'<line x1="0" y1="{CHART_H}" x2="{CHART_W}" y2="{CHART_H}" stroke="#44545f"/>')
    for at, anchor in ((low, "start"), ((low + high) / 2, "middle"), (high, "end")):
        out.append(
            f'<text x="{(at - low) * scale:.1f}" y="{CHART_H + 14}" text-anchor="{anchor}">{at:.1f}</text>'
        )
    if mark is not None:
        x = (mark - low) * scale
        out.append(
            f'<line x1="{x:.1f}" y1="-2" x2="{x:.1f}" y2="{CHART_H}" stroke="#c8660b" stroke-width="2"/>'
        )
    out.append(
        f'<text x="{CHART_W / 2}" y="{CHART_H + 29}" text-anchor="middle">{safe(what)}</text>'
        f'<text x="0" y="-4">{top:.0%}</text></svg>'
    )
    return "".join(out)


CURVES = ("#2b7fa8", "#c8660b", "#2f8f4e", "#8a4fa3", "#c0392b", "#6b7a2a", "#44545f")


def confidence_chart(
    ways_m: Sequence[float | None], curves: Mapping[str, Sequence[float | None]], what: str
) -> str:
    """Return confidence of trackers, 0 to 1, over the distance driven; nothing without a curve.

    `curves` are by name of the target and as long as `ways_m`; a curve breaks where its value is None or 0
    (not tracked).
    """
    far = max((w for w in ways_m if w is not None), default=0.0)
    shown = {name: values for name, values in curves.items() if any(v for v in values)}
    if not shown or far <= 0.0:
        return ""
    scale = CHART_W / far
    total = CHART_H + CHART_EDGE + 16 * len(shown)
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{safe(what)}" '
        f'viewBox="-30 -14 {CHART_W + 40:.0f} {total + 14:.0f}" width="{CHART_W + 40:.0f}" '
        f'height="{total + 14:.0f}" font-family="sans-serif" font-size="11" fill="#14202a">'
    ]
    for level in (0.0, 0.5, 1.0):
        y = CHART_H * (1.0 - level)
        dash = ' stroke-dasharray="4 3"' if level == 0.5 else ""
        out.append(
            f'<line x1="0" y1="{y:.1f}" x2="{CHART_W}" y2="{y:.1f}" stroke="#ccd5da"{dash}/>'
            f'<text x="-4" y="{y + 4:.1f}" text-anchor="end">{level:g}</text>'
        )
    for number_, (name, values) in enumerate(shown.items()):
        colour = CURVES[number_ % len(CURVES)]
        for piece in _pieces(ways_m, values):
            points = " ".join(f"{w * scale:.1f},{CHART_H * (1.0 - v):.1f}" for w, v in piece)
            out.append(f'<polyline points="{points}" fill="none" stroke="{colour}" stroke-width="1.6"/>')
        y = CHART_H + CHART_EDGE + 16 * number_ + 8
        out.append(
            f'<rect x="0" y="{y - 8:.0f}" width="18" height="4" fill="{colour}"/>'
            f'<text x="24" y="{y:.0f}">{safe(name)}</text>'
        )
    for at, anchor in ((0.0, "start"), (far / 2, "middle"), (far, "end")):
        out.append(f'<text x="{at * scale:.1f}" y="{CHART_H + 14}" text-anchor="{anchor}">{at:.1f} m</text>')
    return "".join(out) + "</svg>"


def _pieces(
    ways_m: Sequence[float | None], values: Sequence[float | None]
) -> list[list[tuple[float, float]]]:
    pieces: list[list[tuple[float, float]]] = [[]]
    for way, value in zip(ways_m, values, strict=True):
        if way is None or not value:
            pieces.append([])
        else:
            pieces[-1].append((way, value))
    return [piece for piece in pieces if len(piece) > 1]
