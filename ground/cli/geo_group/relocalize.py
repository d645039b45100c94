"""`outcrop relocalize`: where a stop lies on a map, as a fix with covariance."""

from __future__ import annotations

import csv
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import refusals

if TYPE_CHECKING:
    from rover_iface.localization.relief_map import ReliefMap
    from rover_iface.localization.relocalisation import Relocalisation, RelocalisedPose
    from rover_iface.localization.stop_relief import StopView

FORMAT = "relocalisation/1"
SPREAD = {
    "cov_ee": (0, 0),
    "cov_en": (0, 1),
    "cov_nn": (1, 1),
    "cov_eu": (0, 2),
    "cov_nu": (1, 2),
    "cov_uu": (2, 2),
}
"""Columns of a table of fixes, and which member of the covariance each is."""


def relocalize(
    stop: Annotated[
        Path,
        typer.Argument(help="panorama folder or point file (.npz with eye), as the rover believed to stand"),
    ],
    maps: Annotated[
        list[Path],
        typer.Option(
            "--map", help="terrain folder, or panorama folder or point file of an earlier stop (repeat)"
        ),
    ],
    sigma: Annotated[float, typer.Option(help="deviation of the believed place, each way, metres")] = 5.0,
    heading: Annotated[float, typer.Option(help="deviation of the believed heading, degrees")] = 5.0,
    name: Annotated[str | None, typer.Option(help="name of the fix; else that of the stop's file")] = None,
    out: Annotated[Path | None, typer.Option(help="folder for relocalisation.json and fixes.csv")] = None,
) -> None:
    """Find a stop on a map from 2.5 deviations away. Exit 3 if it is refused.

    fixes.csv is what `outcrop align` reads.
    """
    from rover_iface.localization.relocalisation import RelocalisationPrior, relocalise

    with refusals():
        prior = RelocalisationPrior(sigma, math.radians(heading))
        view = _view(stop)
        grid = _map(maps, view, prior.reach.shift_m)
        answer = relocalise(grid, view, prior)
        called = name or stop.stem
        typer.echo(f"{called}: {answer.verdict}")
        if answer.accepted:
            _tell(answer.pose, view)
        if out is not None:
            _write(called, answer, view, out)
    if not answer.accepted:
        raise typer.Exit(3)


def _view(path: Path) -> StopView:
    from rover_iface.cameras.panorama import load_panorama
    from rover_iface.localization.ground_points import read_points
    from rover_iface.localization.stop_relief import StopView, view_of_panorama

    return view_of_panorama(load_panorama(path)) if path.is_dir() else StopView(read_points(path))


def _map(maps: list[Path], view: StopView, reach_m: float) -> ReliefMap:
    """Return the map: of the one terrain that was named, else of the earlier stops."""
    from rover_iface.localization.relief_map import relief_map, relief_map_of_views
    from rover_iface.localization.relocalisation import RelocalisationOptions
    from rover_iface.terrain import load_terrain

    first = maps[0]
    if len(maps) > 1 or first.is_file() or (first / "panorama.json").is_file():
        return relief_map_of_views([_view(path) for path in maps])
    east, north = (float(v) for v in view.seen.eye[:2])
    return relief_map(load_terrain(first), (east, north), reach_m + RelocalisationOptions().farthest_m + 2.0)


def _tell(pose: RelocalisedPose, view: StopView) -> None:
    sigma = [math.sqrt(float(pose.covariance[k, k])) for k in range(4)]
    eye = view.seen.eye
    for k, (axis, value) in enumerate((("east", pose.east_m), ("north", pose.north_m), ("up", pose.up_m))):
        typer.echo(f"{axis:7s} {value:10.3f} +- {sigma[k]:.3f} m, {value - float(eye[k]):+.3f} from believed")
    typer.echo(f"turn    {math.degrees(pose.turn_rad):10.3f} +- {math.degrees(sigma[3]):.3f} degrees")


def _write(name: str, answer: Relocalisation, view: StopView, out: Path) -> None:
    """Write the answer as `relocalisation/1`, and an accepted one as a table of fixes too."""
    out.mkdir(parents=True, exist_ok=True)
    document: dict[str, object] = {
        "format": FORMAT,
        "name": name,
        "accepted": answer.accepted,
        "verdict": answer.verdict,
        "faults": [refusal.fault.value for refusal in answer.refusals],
        "evidence_nats": answer.evidence,
        "false_probability": None if math.isnan(answer.false_probability) else answer.false_probability,
        "believed_m": [float(v) for v in view.seen.eye],
    }
    table = out / "fixes.csv"
    table.unlink(missing_ok=True)  # that of an earlier answer would pass for this one
    if answer.accepted:
        pose = answer.pose
        document |= {
            "eye_m": [pose.east_m, pose.north_m, pose.up_m],
            "turn_rad": pose.turn_rad,
            "covariance": pose.covariance.tolist(),
            "covariance_of": ["east_m", "north_m", "up_m", "turn_rad"],
        }
        spread = [float(pose.covariance[at]) for at in SPREAD.values()]
        with table.open("w", newline="", encoding="utf-8") as file:
            writer = csv.writer(file)
            writer.writerow(["name", "east_m", "north_m", "height_m", *SPREAD])
            places = (f"{v:.4f}" for v in (pose.east_m, pose.north_m, pose.up_m))
            writer.writerow([name, *places, *(f"{v:.6g}" for v in spread)])
    path = out / "relocalisation.json"
    path.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    typer.echo(str(path))
