"""`outcrop localize`: where the rover was, from the panoramas of recorded runs."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import fail, refusals
from ground.cli.geo_group.align import align
from ground.cli.geo_group.relocalize import relocalize

if TYPE_CHECKING:
    from rover_iface.localization.ground_points import GroundPoints
    from rover_iface.localization.traverse import Traverse

ENDINGS = (".csv", ".txt", ".xyz", ".npz", ".ply")


def register(app: typer.Typer) -> None:
    """Add the commands to the program."""
    app.command("localize")(localize)
    app.command("sites")(sites)
    app.command("align")(align)
    app.command("relocalize")(relocalize)


def localize(
    runs: Annotated[
        list[Path],
        typer.Argument(help="run folders, panorama folders or point files (.npz with eye), as driven"),
    ],
    out: Annotated[Path | None, typer.Option(help="folder for localization.json and traverse.png")] = None,
    odometry: Annotated[float, typer.Option(help="error of odometry, share of the distance")] = 0.05,
    heading: Annotated[float, typer.Option(help="error of heading between stops, degrees")] = 3.0,
    sun: Annotated[float | None, typer.Option(help="error of each stop's own heading, degrees")] = None,
    longest: Annotated[float, typer.Option(help="longest leg, metres")] = 30.0,
) -> None:
    """Match rocks between stops, judge every leg and adjust the traverse. Exit 3 if no leg is accepted."""
    from rover_iface.localization.leg import FaultLimits
    from rover_iface.localization.traverse import TraverseOptions, localise_traverse

    with refusals():
        stops = [(name, _points(path)) for name, path in _stops(runs)]
        options = TraverseOptions(
            share=odometry,
            heading_sigma_rad=math.radians(heading),
            sun_sigma_rad=None if sun is None else math.radians(sun),
        )
        found = localise_traverse(
            stops, options, limits=FaultLimits(longest_m=longest), report=lambda line: typer.echo(line)
        )
    for k, name in enumerate(found.names):
        pose = found.adjustment.poses[name]
        x, y, z = pose.site_from_rover.translation
        sigma = math.sqrt(float(pose.position_covariance[:2, :2].trace()))
        dx, dy, _ = pose.site_from_rover.translation - found.before[k]
        typer.echo(
            f"{name:12s} east {x:9.3f}  north {y:9.3f}  up {z:8.3f} m  +- {sigma:.2f} m, "
            f"moved {math.hypot(dx, dy):.2f} m"
        )
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        (out / "localization.json").write_text(
            json.dumps(found.document(), indent=1) + "\n", encoding="utf-8"
        )
        _picture(found, out / "traverse.png")
        typer.echo(str(out / "localization.json"))
    if not any(leg.result.accepted for leg in found.legs):
        raise typer.Exit(3)


def _stops(runs: list[Path]) -> list[tuple[str, Path]]:
    """Return names and places of every panorama or point file in what was given, in order."""
    found: list[Path] = []
    for run in runs:
        if run.is_dir():
            inside = sorted(path.parent for path in run.rglob("panorama.json"))
            if not inside:
                fail(f"{run} holds no panorama.json; a stereo panorama (form panorama/1) is needed")
            found += inside
        elif run.suffix.lower() in ENDINGS:
            found.append(run)
        else:
            fail(f"{run} is not a run folder, panorama folder or point file ({', '.join(ENDINGS)})")
    names: list[str] = []
    for path in found:
        name = path.stem
        names.append(name if name not in names else f"{path.parent.name}-{name}-{len(names)}")
    return list(zip(names, found, strict=True))


def _points(path: Path) -> GroundPoints:
    from rover_iface.cameras.panorama import load_panorama
    from rover_iface.localization.ground_points import points_of_panorama, read_points

    return points_of_panorama(load_panorama(path)) if path.is_dir() else read_points(path)


def _picture(found: Traverse, path: Path) -> None:
    """Draw the traverse with its 95 % ellipses before and after, and the rocks that tie it."""
    import matplotlib as mpl
    import numpy as np

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Ellipse

    figure, axes = plt.subplots(figsize=(8, 8), layout="constrained")
    after = np.array([found.adjustment.poses[name].site_from_rover.translation for name in found.names])
    for places, colour, label in ((found.before, "tab:orange", "odometry"), (after, "tab:blue", "adjusted")):
        axes.plot(places[:, 0], places[:, 1], "o-", color=colour, ms=4, label=label)
    for k, name in enumerate(found.names):
        for place, spread, colour in (
            (found.before[k], found.before_covariance[k], "tab:orange"),
            (after[k], found.adjustment.poses[name].position_covariance, "tab:blue"),
        ):
            values, vectors = np.linalg.eigh(spread[:2, :2])
            size = 2 * math.sqrt(5.991) * np.sqrt(np.maximum(values, 0))
            angle = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
            axes.add_patch(Ellipse(place[:2], size[1], size[0], angle=angle, fill=False, color=colour))
        axes.annotate(name, after[k][:2], textcoords="offset points", xytext=(5, 5))
    ties = np.array([p for key, p in found.adjustment.points.items()]).reshape(-1, 3)
    axes.plot(ties[:, 0], ties[:, 1], "k^", ms=4, label="rocks that tie two stops")
    axes.set(xlabel="east, m", ylabel="north, m", aspect="equal")
    axes.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)


def sites(
    files: Annotated[list[Path], typer.Argument(help="mission frame files, .svf and .rvf")],
    into: Annotated[int, typer.Option(help="site in whose frame to answer")] = 0,
    of: Annotated[int | None, typer.Option(help="site whose place is asked; the last if absent")] = None,
    target: Annotated[
        str | None, typer.Option(help="north,east,nadir of a target in the frame of the asked site, metres")
    ] = None,
    history: Annotated[bool, typer.Option(help="every solution of the asked site")] = False,
    out: Annotated[
        Path | None, typer.Option(help="write all frames, with their history, as one mission frame file")
    ] = None,
) -> None:
    """Chain site frames, carry a target from one site to another, and write frames out again."""
    from rover_iface.localization.site_frames import (
        SITE,
        FrameFile,
        SiteFrames,
        print_frame_file,
        read_frame_file,
        site,
    )

    with refusals():
        read = [read_frame_file(path) for path in files]
        frames = SiteFrames.of(read)
        known = [frame.counter[0] for frame in frames.frames if frame.name == SITE]
        if of is None and not known:
            fail(f"{', '.join(map(str, files))}: no site frame in it; give --of")
        asked = site(max(known) if of is None else of)
        transform = frames.transform(site(into), asked)
        place = transform.translation if target is None else transform.apply(_numbers(target))
        north, east, nadir = (float(v) for v in place)
        what = f"{asked}" if target is None else f"target ({target}) of {asked}"
        typer.echo(f"{what} in {site(into)}: north {north:.3f}  east {east:.3f}  nadir {nadir:.3f} m")
        if history:
            used = frames.in_use(asked)
            for solution in frames.history(asked):
                mark = "in use" if solution is used else "      "
                offset = ", ".join(f"{v:.4f}" for v in solution.offset_m)
                typer.echo(
                    f"  {mark}  {solution.added_utc:%Y-%m-%d %H:%M}  {solution.solution_id}: {offset} m"
                )
        if out is not None:
            missions = list(dict.fromkeys(file.mission for file in read))
            if len(missions) > 1:
                fail(f"{out}: frames of {' and '.join(missions)} do not go into one file")
            records = tuple(record for file in read for record in file.records)
            merged = FrameFile(read[0].mission, read[0].variant, read[0].counter, frames.priority, records)
            out.write_text(print_frame_file(merged), encoding="utf-8")
            typer.echo(f"{out}: {len(frames.frames)} frames, {len(frames.solutions)} solutions")


def _numbers(text: str) -> list[float]:
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        fail(f'target "{text}" is not NORTH,EAST,NADIR in metres')
    return numbers
