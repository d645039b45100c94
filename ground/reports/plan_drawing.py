"""A plan tree as a drawing: one layout, written as SVG; and as DOT for other programs."""

from __future__ import annotations

import html
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from planner.plan_tree_document import ConditionDocument, StepDocument, TreeDocument
    from planner.problem_document import ProblemDocument

BOX_W, LINE_H, PAD, GAP_X, GAP_Y = 210.0, 15.0, 7.0, 18.0, 46.0
WIDE_W, INDENT, GAP_OUTLINE = 300.0, 34.0, 26.0
"""Of an outline: width of a box, how far options stand to the right of their box, room for a label."""


@dataclass(slots=True)
class Box:
    """A run of steps without a choice, and the options that may follow it; `label` says when it is taken."""

    lines: list[str]
    label: str = ""
    probability: float = 1.0
    options: list[Box] = field(default_factory=list)
    x: float = 0.0
    y: float = 0.0
    width: float = BOX_W
    shade: float | None = None
    """Share from 0 to 1 that colours the box; None is not coloured."""

    @property
    def height(self) -> float:
        return 2 * PAD + LINE_H * max(1, len(self.lines))

    def walk(self) -> list[Box]:
        """Return this box and all below it, each before its options."""
        return [self, *(box for option in self.options for box in option.walk())]


def target_names(problem: ProblemDocument) -> dict[str, str]:
    """Return the names that people gave to the targets of a problem."""
    return {t["id"]: (t.get("refs") or {}).get("name", t["id"]) for t in problem.get("targets", ())}


def describe_step(step: StepDocument, names: Mapping[str, str]) -> str:
    """Return a step in a few words."""
    place = str(step.get("to", step.get("target", step.get("observation", ""))))
    words = {"track_start": "track", "track_stop": "stop tracking", "navigate": "drive to"}
    text = f"{words.get(step['op'], str(step['op']).replace('_', ' '))} {names.get(place, place)}"
    if "p_reached" in step:
        text += f"  ({float(step['p_reached']):.0%})"
    return text.strip()


def describe_when(when: Sequence[ConditionDocument], names: Mapping[str, str]) -> str:
    """Return an option's condition in a few words; `else` where there is none."""
    return " and ".join(_describe_term(term, names) for term in when) or "else"


def _describe_term(term: ConditionDocument, names: Mapping[str, str]) -> str:
    match term["var"]:
        case "tracked":
            return f"{names.get(term['target'], term['target'])} {'tracked' if term['is'] else 'lost'}"
        case "done":
            return f"{term.get('observation', term.get('target'))} {'done' if term['is'] else 'not done'}"
        case name:
            what, show = ("time", _clock) if name == "time_s" else ("energy used", _watt_hours)
            bounds = (("≥", term.get("ge")), ("<", term.get("lt")))
            return " and ".join(f"{what} {sign} {show(x)}" for sign, x in bounds if x is not None)


def _clock(seconds: float) -> str:
    whole = round(seconds)
    return f"{whole // 3600}:{whole % 3600 // 60:02}:{whole % 60:02}"


def _watt_hours(joules: float) -> str:
    return f"{joules / 3600:.4g} Wh"


def boxes(tree: TreeDocument, names: Mapping[str, str]) -> Box:
    """Return the tree as boxes: a branch ends one; its options, and what follows else, begin others."""

    def build(steps: Sequence[StepDocument], box: Box) -> Box:
        for number, step in enumerate(steps):
            if step["op"] != "branch":
                box.lines.append(describe_step(step, names))
                continue
            taken = 0.0
            for option in step["options"]:
                chance = float(option.get("p_taken", 0.0))
                taken += chance
                below = Box([], describe_when(option.get("when", ()), names), chance)
                box.options.append(build(option["plan"], below))
            if number + 1 < len(steps):
                rest = Box([], "go on", max(0.0, box.probability - taken))
                box.options.append(build(steps[number + 1 :], rest))
            break
        if not box.lines:
            box.lines.append("end" if not box.options else "choose")
        return box

    return build(tree["plan"], Box([]))


def lay_out(root: Box) -> tuple[float, float]:
    """Give each box its place, parents over the middle of their options; return its size, px."""

    def place(box: Box, left: float, top: float) -> tuple[float, float]:
        box.y = top
        if not box.options:
            box.x = left
            return left + box.width, top + box.height
        right, bottom = left, top + box.height
        for option in box.options:
            edge, low = place(option, right, top + box.height + GAP_Y)
            right, bottom = edge + GAP_X, max(bottom, low)
        right -= GAP_X
        box.x = (box.options[0].x + box.options[-1].x) / 2
        return right, bottom

    right, bottom = place(root, PAD, PAD)
    return right + PAD, bottom + PAD


def lay_out_as_outline(root: Box) -> tuple[float, float]:
    """Give each box its place, options below their box and a step to the right; return the size, px.

    The width grows with the depth of the tree alone, so that a page holds it; the height with its boxes.
    """
    right = bottom = 0.0

    def place(box: Box, left: float, top: float) -> float:
        nonlocal right
        box.x, box.y, box.width = left, top, WIDE_W
        right = max(right, left + box.width)
        below = top + box.height
        for option in box.options:
            below = place(option, left + INDENT, below + GAP_OUTLINE)
        return below

    bottom = place(root, PAD, PAD)
    return right + PAD, bottom + PAD


def _text(text: str) -> str:
    """Return text that may stand in an XML document: no control characters, markup escaped."""
    return html.escape("".join(c if c >= " " else " " for c in text))


def _fill(shade: float | None) -> str:
    """Return the colour of a box: the more runs came there, the deeper the blue; text stays readable."""
    if shade is None:
        return "#f4f7f9"
    red, green, blue = (round(255 + (deep - 255) * shade**0.5) for deep in (158, 202, 225))
    return f"#{red:02x}{green:02x}{blue:02x}"


def _cut(text: str, most: int) -> str:
    return text if len(text) <= most else f"{text[: most - 1]}…"


def to_svg(root: Box, *, outline: bool = False) -> str:
    """Return the drawing; edges are as wide as the chance that they are taken.

    As an outline it fits the width of a page; else options stand beside each other.
    """
    width, height = lay_out_as_outline(root) if outline else lay_out(root)
    parts = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width:.0f} {height:.0f}" '
        f'width="{width:.0f}" height="{height:.0f}" font-family="sans-serif" font-size="11">',
        f'<rect width="{width:.0f}" height="{height:.0f}" fill="#ffffff"/>',
    ]
    labels = []
    for box in root.walk():
        for option in box.options:
            colour = "#2b7fa8" if option.label == "go on" else "#c8660b"
            thick = 1 + 5 * min(1.0, option.probability)
            line, x, anchor = _elbow(box, option) if outline else _curve(box, option)
            parts.append(f'<path d="{line}" fill="none" stroke="{colour}" stroke-width="{thick:.1f}"/>')
            label = _text(_cut(f"{option.label}  {option.probability:.0%}", 54 if outline else 38))
            labels.append(
                f'<text x="{x:.1f}" y="{option.y - 6:.1f}" text-anchor="{anchor}" fill="{colour}" '
                f'stroke="#ffffff" stroke-width="3" paint-order="stroke">{label}</text>'
            )
    parts += labels  # over all lines
    for box in root.walk():
        parts.append(
            f'<rect x="{box.x:.1f}" y="{box.y:.1f}" width="{box.width:.1f}" height="{box.height:.1f}" rx="5" '
            f'fill="{_fill(box.shade)}" stroke="#44545f"/>'
        )
        parts += [
            f'<text x="{box.x + PAD:.1f}" y="{box.y + PAD + LINE_H * (n + 0.75):.1f}" fill="#14202a">'
            f"{_text(_cut(line, 54 if outline else 36))}</text>"
            for n, line in enumerate(box.lines)
        ]
    return "\n".join([*parts, "</svg>"]) + "\n"


def _curve(box: Box, option: Box) -> tuple[str, float, str]:
    """Return a line down from the middle of a box to an option, and where its label stands, how anchored."""
    x1, y1 = box.x + box.width / 2, box.y + box.height
    x2, y2 = option.x + option.width / 2, option.y
    curve = f"M{x1:.1f} {y1:.1f} C{x1:.1f} {y1 + 24:.1f} {x2:.1f} {y2 - 34:.1f} {x2:.1f} {y2:.1f}"
    return curve, x2, "middle"


def _elbow(box: Box, option: Box) -> tuple[str, float, str]:
    """Return a line down from a box's left end and to the right into an option, and its label's place."""
    x1, y1, y2 = box.x + INDENT / 3, box.y + box.height, option.y + option.height / 2
    return f"M{x1:.1f} {y1:.1f} V{y2:.1f} H{option.x:.1f}", option.x + PAD, "start"


def to_dot(root: Box) -> str:
    """Return the tree as a DOT graph."""
    numbers = {id(box): f"n{number}" for number, box in enumerate(root.walk())}
    lines = ["digraph plan {", '  node [shape=box, fontname="sans-serif"];']
    for box in root.walk():
        lines.append(f"  {numbers[id(box)]} [label={_quoted(chr(10).join(box.lines))}];")
        lines += [
            f"  {numbers[id(box)]} -> {numbers[id(option)]} "
            f"[label={_quoted(f'{option.label} ({option.probability:.0%})')}];"
            for option in box.options
        ]
    return "\n".join([*lines, "}"]) + "\n"


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False)
