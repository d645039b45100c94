"""Places in another reference than the site's, as people type them: `--crs NAME`, or `--lonlat`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import typer

from ground.cli.failure import fail

CRS_HELP = "the coordinates count in this reference: EPSG:32612, IAU_2015:49900 ...; x before y"
LONLAT_HELP = "short for --crs lonlat: longitude before latitude, in degrees"
CRS = typer.Option(None, "--crs", help=CRS_HELP)
LONLAT = typer.Option(False, "--lonlat", help=LONLAT_HELP)


def reference_of(crs: str | None, lonlat: bool) -> str | None:
    """Return the reference that the two options name; None for site metres."""
    if lonlat and crs not in (None, "lonlat"):
        fail(f"--lonlat and --crs {crs} name two references; give one")
    return "lonlat" if lonlat else crs


def corners_of(words: Sequence[str]) -> list[list[float]]:
    """Return corners from words such as `1.5,-2`."""
    found = []
    for word in words:
        parts = word.split(",")
        try:
            found.append([float(part) for part in parts])
        except ValueError:
            parts = []
        if len(parts) != 2:
            fail(f"{word!r} is not a corner: one is EAST,NORTH, such as 1.5,-2")
    return found


def at_of(crs: str, words: Sequence[str]) -> tuple[Mapping[str, object], list[str]]:
    """Return the member `at` of a form, and the words that are left.

    A place is two numbers, `x=... y=...`, or three corners and more as `X,Y`.
    """
    bare = [word for word in words if "=" not in word]
    named = dict(word.split("=", 1) for word in words if word.startswith(("x=", "y=")))
    left = [word for word in words if "=" in word and not word.startswith(("x=", "y="))]
    if bare and all("," in word for word in bare):
        return {"crs": crs, "polygon": corners_of(bare)}, left
    numbers = [*bare, *(named[axis] for axis in ("x", "y") if axis in named)]
    if len(numbers) != 2:
        fail(f"a place in {crs} is X Y (longitude before latitude), not {' '.join(numbers) or 'nothing'}")
    try:
        x, y = (float(number) for number in numbers)
    except ValueError:
        fail(f"a place in {crs} is two numbers, not {' '.join(numbers)}")
    return {"crs": crs, "x": x, "y": y}, left
