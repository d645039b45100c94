"""`outcrop sky`: where sun and Earth stand over a site, by SPICE kernels."""

from __future__ import annotations

import json
import math
from datetime import datetime, timedelta
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

MOST = 10_000


def sky(
    kernels: Annotated[
        list[Path], typer.Argument(help="leap seconds, ephemerides and orientation: LSK, SPK, PCK")
    ],
    start: Annotated[
        datetime, typer.Option("--utc", help="first moment, UTC", formats=["%Y-%m-%dT%H:%M:%S"])
    ],
    longitude: Annotated[float, typer.Option(help="degrees east")],
    latitude: Annotated[float, typer.Option(help="planetographic, degrees north")],
    body: Annotated[str, typer.Option(help="MARS, MOON or EARTH")] = "MARS",
    height: Annotated[float, typer.Option(help="metres over the ellipsoid")] = 0.0,
    step: Annotated[float, typer.Option(help="minutes between lines")] = 60.0,
    count: Annotated[int, typer.Option(min=1, max=MOST, help="lines")] = 25,
    out: Annotated[Path | None, typer.Option("--json", help="write the lines as JSON")] = None,
) -> None:
    """Say where sun and Earth stand, how long light is on its way, and how far our formulas are off."""
    from datetime import UTC

    import numpy as np

    from mission.soltime import SunClock
    from neighbours.geodata.spice_sky import Site, look

    if not step > 0:
        fail(f"--step is {step:g} minutes; it must be above 0")
    first = start.replace(tzinfo=UTC)
    times = [first + timedelta(minutes=step * k) for k in range(count)]
    with refusals():
        seen = look(kernels, Site(body.upper(), longitude, latitude, height), times)
    clock = SunClock(first, latitude, longitude)
    lines: list[dict[str, object]] = []
    worst = 0.0
    for k, time in enumerate(times):
        line: dict[str, object] = {"utc": time.isoformat(), **_angles("sun", seen.sun[k])}
        if seen.earth is not None and seen.earth_light_time_s is not None:
            line |= {**_angles("earth", seen.earth[k]), "light_time_s": float(seen.earth_light_time_s[k])}
        if body.upper() == "MARS":
            ours = np.array(clock.direction((time - first).total_seconds()))
            apart = 2 * math.degrees(math.asin(min(1.0, float(np.linalg.norm(ours - seen.sun[k])) / 2)))
            worst = max(worst, apart)
            line["formula_off_deg"] = apart
        lines.append(line)
        typer.echo("  ".join(_shown(name, value) for name, value in line.items()))
    if body.upper() == "MARS":
        typer.echo(f"the formulas are off by at most {worst:.3f} degrees")
    if out is not None:
        out.write_text(json.dumps(lines, indent=1) + "\n", encoding="utf-8")


def _angles(what: str, way: NDArray[np.float64]) -> dict[str, object]:
    east, north, up = (float(v) for v in way)
    return {
        f"{what}_azimuth_deg": math.degrees(math.atan2(east, north)) % 360.0,
        f"{what}_elevation_deg": math.degrees(math.asin(max(-1.0, min(1.0, up)))),
    }


def _shown(name: str, value: object) -> str:
    if not isinstance(value, float):
        return str(value)
    word = name.removesuffix("_deg").removesuffix("_s").replace("_", " ")
    return f"{word} {value:.3f}" if name == "formula_off_deg" else f"{word} {value:.2f}"
