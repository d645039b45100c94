"""Pictures of a day for people: the plan on its map."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING

from ground.extras import how_to_get

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from planner.plan_tree_document import StepDocument, TreeDocument
    from planner.problem_document import PoseDocument, ProblemDocument, TargetDocument
    from rover_iface.terrain import Terrain

MAINLINE, BRANCH, DRIVEN = "#5ad1ff", "#ff9d2e", "#ffffff"
MARGIN_M = 3.5
WIDEST_POINTS = 7.0
IMAGE_PIXELS = 1200
"""About how many pixels of ortho image a picture of this size can show."""


@dataclass(frozen=True, slots=True)
class Ribbon:
    """One drive of the plan: its corners, the chance that it is driven, and whether a branch leads to it."""

    points_m: tuple[tuple[float, float], ...]
    probability: float
    branch: bool


def ribbons(problem: ProblemDocument, tree: TreeDocument) -> Iterator[Ribbon]:
    """Yield the drives of a plan tree along the routes of its problem."""
    routes = {
        (leg["from"], leg["to"]): tuple((float(x), float(y)) for x, y in leg.get("route") or ())
        for leg in problem["legs"]
    }

    def follow(steps: Sequence[StepDocument], place: str, branch: bool) -> Iterator[Ribbon]:
        for step in steps:
            match step["op"]:
                case "branch":
                    for option in step["options"]:
                        yield from follow(option["plan"], place, True)
                case "navigate" | "visit":
                    to = str(step.get("to", step.get("target")))
                    corners = routes.get((place, to), ())
                    if len(corners) > 1:
                        yield Ribbon(corners, float(step.get("p_reached", 1.0)), branch)
                    place = to

    yield from follow(tree["plan"], "start", False)


def undrawn() -> str:
    """Return why no map can be drawn here; empty if one can."""
    return "" if find_spec("matplotlib") else f"The map needs {how_to_get('matplotlib')}"


def draw_day(
    path: Path,
    terrain: Terrain,
    problem: ProblemDocument,
    tree: TreeDocument,
    *,
    driven_m: Sequence[tuple[float, float]] = (),
    observed: Mapping[str, int] | None = None,
    lost: Sequence[str] = (),
    keep_outs: Sequence[Sequence[tuple[float, float]]] = (),
    title: str = "",
) -> None:
    """Write a PNG of the plan on the terrain's ortho image.

    Ribbons are as wide as the chance that they are driven: blue for the mainline, orange for branches. The
    white line is what the rover drove. `observed` gives the number of products per target (None before a
    run), `lost` names the tracks that were lost.
    """
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.patches import Polygon

    start: PoseDocument = problem.get("start") or {"east_m": 0.0, "north_m": 0.0}
    corners = [(start["east_m"], start["north_m"])]
    corners += map(_point, problem["targets"])
    for leg in problem["legs"]:
        corners.extend((x, y) for x, y in leg.get("route") or ())
    corners.extend(corner for ring in keep_outs for corner in ring)
    west, east = min(c[0] for c in corners) - MARGIN_M, max(c[0] for c in corners) + MARGIN_M
    south, north = min(c[1] for c in corners) - MARGIN_M, max(c[1] for c in corners) + MARGIN_M

    size = 9.0
    figure = Figure(
        figsize=(size, max(4.0, min(14.0, size * (north - south) / (east - west)) + 0.9)), dpi=110
    )
    axes = figure.add_axes((0.07, 0.11, 0.91, 0.83))
    _ortho(axes, terrain, (west, south, east, north))
    for leg in problem["legs"]:
        route = leg.get("route") or ()
        axes.plot([p[0] for p in route], [p[1] for p in route], color="white", lw=0.5, alpha=0.35, zorder=2)
    for ring in keep_outs:
        axes.add_patch(
            Polygon(list(ring), facecolor="#d6404055", edgecolor="#ff5c5c", lw=1.2, hatch="//", zorder=3)
        )
    drawn = sorted(ribbons(problem, tree), key=lambda r: (r.branch, -r.probability))
    for ribbon in drawn:
        axes.plot(
            [p[0] for p in ribbon.points_m],
            [p[1] for p in ribbon.points_m],
            color=BRANCH if ribbon.branch else MAINLINE,
            lw=max(0.8, WIDEST_POINTS * ribbon.probability),
            alpha=0.85,
            solid_capstyle="round",
            zorder=5 if ribbon.branch else 4,
        )
    if driven_m:
        axes.plot(
            [p[0] for p in driven_m], [p[1] for p in driven_m], color=DRIVEN, lw=1.4, ls=(0, (3, 2)), zorder=6
        )
    _targets(axes, problem, observed or {}, set(lost))
    axes.plot(start["east_m"], start["north_m"], marker="s", ms=9, color="white", mec="black", zorder=8)
    axes.annotate(
        "start",
        (start["east_m"], start["north_m"]),
        (8, -12),
        textcoords="offset points",
        color="white",
        fontsize=9,
    )
    axes.set_xlim(west, east)
    axes.set_ylim(south, north)
    axes.set_aspect("equal")
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.set_title(title, fontsize=11, loc="left")
    keys = [
        Line2D([], [], color=MAINLINE, lw=5, label="mainline, width = probability"),
        Line2D([], [], color=BRANCH, lw=5, label="contingency branch"),
    ]
    if driven_m:
        keys.append(Line2D([], [], color="#888888", lw=1.4, ls=(0, (3, 2)), label="driven"))
    if observed is not None:
        keys.append(Line2D([], [], color="#6fe06f", marker="o", ls="", mec="black", label="observed"))
        keys.append(
            Line2D([], [], color="none", marker="o", ls="", mec="#ff5050", mew=2.0, ms=10, label="track lost")
        )
    rest = "target (value)" if observed is None else "not observed"
    keys.append(Line2D([], [], color="#e8e8e8", marker="o", ls="", mec="black", label=rest))
    figure.legend(
        handles=keys, loc="lower center", ncols=len(keys), fontsize=8, frameon=False, handlelength=1.6
    )
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def _point(target: TargetDocument) -> tuple[float, float]:
    """Return where a target lies, east and north."""
    point = target.get("point_m")
    assert point is not None  # the targets of a day all lie somewhere
    return point[0], point[1]


def _ortho(axes: Axes, terrain: Terrain, window: tuple[float, float, float, float]) -> None:
    """Show what lies of each ortho layer in `window` (west, south, east, north), coarse ones below."""
    for layer in sorted(terrain.orthos, key=lambda ortho: ortho.spacing, reverse=True):
        west, south, east, north = layer.bounds
        rows, columns = layer.rgb.shape[:2]
        left = max(0, math.floor((window[0] - west) / (east - west) * columns))
        right = min(columns, math.ceil((window[2] - west) / (east - west) * columns))
        top = max(0, math.floor((north - window[3]) / (north - south) * rows))
        bottom = min(rows, math.ceil((north - window[1]) / (north - south) * rows))
        if left >= right or top >= bottom:
            continue
        step = max(1, (right - left) // IMAGE_PIXELS)
        axes.imshow(
            layer.rgb[top:bottom:step, left:right:step],
            extent=(
                west + left / columns * (east - west),
                west + right / columns * (east - west),
                north - bottom / rows * (north - south),
                north - top / rows * (north - south),
            ),
            origin="upper",
            interpolation="bilinear",
            zorder=1,
        )


def _targets(axes: Axes, problem: ProblemDocument, observed: Mapping[str, int], lost: set[str]) -> None:
    from matplotlib.patheffects import withStroke

    for target in problem["targets"]:
        east, north = _point(target)
        count = observed.get(target["id"], 0)
        colour = "#6fe06f" if count else "#e8e8e8"
        if target["id"] in lost:
            axes.plot(east, north, marker="o", ms=14, mfc="none", mec="#ff5050", mew=2.0, zorder=8)
        axes.plot(east, north, marker="o", ms=8, color=colour, mec="black", zorder=9)
        name = (target.get("refs") or {}).get("name", target["id"])
        value = sum(o["utility"] for o in target["observations"])
        axes.annotate(
            f"{name} ({value:g})",
            (east, north),
            (7, 5),
            textcoords="offset points",
            fontsize=8.5,
            color="white",
            zorder=10,
            path_effects=[withStroke(linewidth=2.2, foreground="black")],
        )
