"""`outcrop align`: where an odometry frame lies, from several fixes of which some may be wrong."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import fail, refusals
from ground.geo.place import Place, heights_named

if TYPE_CHECKING:
    from ground.geo.fixes import Fixes, Poses
    from rover_iface.localization.fix_alignment import FixAlignment

FORMAT = "alignment/1"


def align(
    fixes: Annotated[
        Path, typer.Argument(help="CSV: name, lon, lat (or x, y; east_m, north_m), sigma_m ...")
    ],
    poses: Annotated[Path, typer.Argument(help="CSV: name, x_m, y_m, z_m in the odometry frame")],
    place: Annotated[
        str | None, typer.Option(help="the site's place as JSON, as of a mission; else the first fix")
    ] = None,
    crs: Annotated[str, typer.Option(help="reference of the columns x and y")] = "EPSG:4326",
    heights: Annotated[
        str, typer.Option(help="what height_m counts from: ellipsoid, geoid, areoid or sphere")
    ] = "unknown",
    geoid: Annotated[str, typer.Option(help="EGM96, EGM2008 or NAVD88")] = "EGM96",
    false_outlier: Annotated[float, typer.Option(help="chance that a good fix is called wrong")] = 0.001,
    out: Annotated[Path | None, typer.Option(help="folder for alignment.json and alignment.png")] = None,
) -> None:
    """Align poses of an odometry frame with fixes: turn and shift with covariance, wrong fixes named."""
    from ground.geo.fixes import read_fixes, read_poses
    from rover_iface.localization.fix_alignment import FixAlignmentOptions, align_fixes

    with refusals():
        told = None if place is None else _place(place)
        found, site = read_fixes(
            fixes.read_text("utf-8"), told, crs=crs, heights=heights_named(heights), geoid=geoid
        )
        seen, way = _joined(found, read_poses(poses.read_text("utf-8")))
        answer = align_fixes(
            seen.places_m,
            seen.covariance_m2,
            way.places_m * _scale(site),
            way.covariance_m2,
            options=FixAlignmentOptions(false_outlier=false_outlier),
        )
        for line in _lines(seen, answer):
            typer.echo(line)
        if out is not None:
            out.mkdir(parents=True, exist_ok=True)
            document = _document(seen, answer, site)
            (out / "alignment.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
            _picture(seen, way, answer, _scale(site), out / "alignment.png")
            typer.echo(str(out / "alignment.json"))


def _place(text: str) -> Place:
    try:
        members = json.loads(text)
        return Place(**members)
    except (ValueError, TypeError) as err:
        fail(f"--place is not a place such as {{'crs': 'EPSG:32612', 'x': 518334, 'y': 4251500}}: {err}")


def _scale(site: Place | None) -> float:
    """Return how many metres of the site one of the odometry is: a projection's scale where it lies."""
    from ground.geo.site_frame import site_frame

    return 1.0 if site is None else site_frame(site).stretch


def _joined(fixes: Fixes, poses: Poses) -> tuple[Fixes, Poses]:
    """Return fixes and poses of the names that are in both tables."""
    from ground.geo.fixes import Fixes, Poses

    index = {name: k for k, name in enumerate(poses.names)}
    here = [k for k, name in enumerate(fixes.names) if name in index]
    there = [index[fixes.names[k]] for k in here]
    missing = [name for name in fixes.names if name not in index]
    if missing:
        typer.echo(f"{len(missing)} fixes have no pose: {', '.join(missing[:10])}", err=True)
    names = tuple(fixes.names[k] for k in here)
    return (
        Fixes(names, fixes.places_m[here], fixes.covariance_m2[here]),
        Poses(names, poses.places_m[there], poses.covariance_m2[there]),
    )


def _lines(fixes: Fixes, answer: FixAlignment) -> list[str]:
    sigma = [math.sqrt(answer.covariance[k, k]) for k in range(4)]
    lines = []
    for k, name in enumerate(fixes.names):
        east, north, up = answer.residuals_m[k]
        height = "      no height" if math.isnan(up) else f"  up {up:9.3f}"
        verdict = "" if answer.agrees[k] else "  OUTLIER, not used"
        lines.append(
            f"{name:12s} off by east {east:9.3f}  north {north:9.3f}{height} m, "
            f"{answer.distances[k]:6.1f} sigma{verdict}"
        )
    lines.append(f"turn   {math.degrees(answer.yaw_rad):10.4f} +- {math.degrees(sigma[3]):.4f} degrees")
    for k, axis in enumerate(("east", "north", "up")):
        value = answer.shift_m[k]
        told = "not known: no fix has a height" if math.isnan(value) else f"{value:10.3f} +- {sigma[k]:.3f} m"
        lines.append(f"{axis:6s} {told}")
    left = [name for name, good in zip(fixes.names, answer.agrees, strict=True) if not good]
    lines.append(
        f"{int(answer.agrees.sum())} of {len(fixes.names)} fixes agree"
        + (f"; left out: {', '.join(left)}" if left else "")
    )
    return lines


def _document(fixes: Fixes, answer: FixAlignment, site: Place | None) -> dict[str, object]:
    """Return the answer as `alignment/1`; what is not known is null."""
    from dataclasses import asdict

    def shown(value: float) -> float | None:
        return None if math.isnan(value) else float(value)

    return {
        "format": FORMAT,
        "place": None if site is None else asdict(site),
        "scale": _scale(site),
        "yaw_rad": answer.yaw_rad,
        "shift_m": [shown(v) for v in answer.shift_m],
        "covariance": [[shown(v) for v in row] for row in answer.covariance],
        "covariance_of": ["east_m", "north_m", "up_m", "yaw_rad"],
        "fixes": [
            {
                "name": name,
                "used": bool(answer.agrees[k]),
                "residual_m": [shown(v) for v in answer.residuals_m[k]],
                "sigmas": float(answer.distances[k]),
            }
            for k, name in enumerate(fixes.names)
        ],
    }


def _picture(fixes: Fixes, poses: Poses, answer: FixAlignment, scale: float, path: Path) -> None:
    """Draw the aligned poses, the fixes with their 95 % ellipses, and which fixes were left out."""
    import matplotlib as mpl
    import numpy as np

    mpl.use("Agg")
    import matplotlib.pyplot as plt
    from matplotlib.patches import Ellipse

    figure, axes = plt.subplots(figsize=(8, 8), layout="constrained")
    way = answer.apply(np.nan_to_num(poses.places_m * scale))
    axes.plot(way[:, 0], way[:, 1], "o-", color="tab:blue", ms=4, label="poses, aligned")
    for good, colour, label in ((True, "tab:green", "fixes used"), (False, "tab:red", "fixes left out")):
        which = answer.agrees == good
        axes.plot(*fixes.places_m[which, :2].T, "x", color=colour, label=label)
    for k, name in enumerate(fixes.names):
        x, y = map(float, fixes.places_m[k, :2])
        values, vectors = np.linalg.eigh(fixes.covariance_m2[k][:2, :2])
        size = 2 * math.sqrt(5.991) * np.sqrt(np.maximum(values, 0))  # 95 % of a normal in two dimensions
        angle = math.degrees(math.atan2(vectors[1, 1], vectors[0, 1]))
        axes.add_patch(Ellipse((x, y), size[1], size[0], angle=angle, fill=False, color="grey"))
        axes.annotate(name, fixes.places_m[k, :2], textcoords="offset points", xytext=(5, 5))
    axes.set(xlabel="east, m", ylabel="north, m", aspect="equal")
    axes.legend()
    figure.savefig(path, dpi=110)
    plt.close(figure)
