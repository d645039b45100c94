"""Plots of docs/results/localization.md."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np

from rover_iface.localization.leg import LegResult
from studies.common.localization_drive import Kilometre
from studies.common.localization_legs import LegRecord

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.patches import Ellipse


def _ellipse(place: Any, spread: Any, colour: str) -> Ellipse:
    """Return the 95 % ellipse of a covariance [3, 3] in the plane."""
    values, vectors = np.linalg.eigh(np.asarray(spread)[:2, :2])
    size = 2 * math.sqrt(5.991) * np.sqrt(np.maximum(values, 0))
    angle = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
    return Ellipse(place[:2], size[1], size[0], angle=angle, fill=False, color=colour, lw=0.8)


def draw_kilometre(run: Kilometre, path: Path) -> None:
    """Draw a kilometre: truth, wheels, pictures, adjusted, with ellipses before and after."""
    figure, axes = plt.subplots(figsize=(9, 4.5), layout="constrained")
    for places, colour, label in (
        (run.true, "black", "true"),
        (run.wheels, "tab:red", "wheels"),
        (run.odometry, "tab:orange", "+ visual odometry"),
        (run.adjusted, "tab:blue", "+ adjustment"),
    ):
        axes.plot(places[:, 0], places[:, 1], color=colour, lw=1.2, label=label)
    for k in range(0, len(run.true), 5):
        axes.add_patch(_ellipse(run.odometry[k], run.before[k], "tab:orange"))
        axes.add_patch(_ellipse(run.adjusted[k], run.adjustment.poses[k].position_covariance, "tab:blue"))
    axes.set(xlabel="m", ylabel="m", aspect="equal")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def draw_leg(record: LegRecord, result: LegResult, path: Path) -> None:
    """Draw the rocks that both ends of a leg saw, as truly placed, and the pairs found."""
    figure, axes = plt.subplots(figsize=(9, 5), layout="constrained")
    shift = record.eyes[1] - record.eyes[0]
    for end, marker, colour, origin in ((0, "^", "tab:green", np.zeros(3)), (1, "v", "tab:red", shift)):
        places = np.array([rock.position for rock in record.ends[end].rocks]) + origin
        axes.plot(
            places[:, 0],
            places[:, 1],
            marker,
            color=colour,
            ms=5,
            mfc="none",
            label=f"rocks of stop {end + 1}",
        )
        axes.plot(*origin[:2], "o", color=colour, ms=9)
    for pair in result.match.pairs if result.match is not None else ():
        one = record.ends[0].rocks[pair.first].position
        two = record.ends[1].rocks[pair.second].position + shift
        right = bool(record.ends[0].bodies[pair.first] & record.ends[1].bodies[pair.second])
        axes.plot([one[0], two[0]], [one[1], two[1]], color="black" if right else "magenta", lw=2)
        axes.plot(*(0.5 * (one + two))[:2], "o", ms=14, mfc="none", mec="black" if right else "magenta")
    axes.set(xlabel="m", ylabel="m", aspect="equal", title=result.verdict)
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)


def draw_trials(entries: list[dict[str, Any]], path: Path) -> None:
    """Draw right pairs against rocks seen from both ends, shipped and published."""
    figure, axes = plt.subplots(figsize=(7, 4), layout="constrained")
    common = [e["common"] for e in entries]
    axes.plot(common, [e["published"][1] for e in entries], "x", color="tab:orange", ms=5, label="published")
    axes.plot(
        common,
        [e["right"] if e["accepted"] else 0 for e in entries],
        "o",
        color="tab:blue",
        ms=4,
        label="shipped (refused: 0)",
    )
    axes.axhline(4, color="grey", lw=0.8)
    axes.set(xlabel="rocks that could be seen from both ends", ylabel="right pairs")
    axes.legend(fontsize=8)
    figure.savefig(path, dpi=90)
    plt.close(figure)
