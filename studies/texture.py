"""Texture of rendered and real pictures: table of docs/results/cameras.md and docs/img/render_and_real.png.

    .venv/bin/python -m studies.texture --out docs          about a minute of one core
    .venv/bin/python -m studies.texture --sites 2 --all     every picture's own figures

Each site has its own terrain seed, rock and sun (behind the rover within 40 degrees, 35 to 55 degrees high).
Ends with status 1 if a rendered picture lies outside the ranges of the flight frames.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator
from dataclasses import astuple, dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.labels import read_product
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.rocks import Rock
from studies.common.pages import table, write_section
from studies.common.texture_statistics import RANGES, TextureStatistics, measure, stretch

Grey = npt.NDArray[np.float32]
Mask = npt.NDArray[np.bool_]
IMAGERY = Path(__file__).resolve().parents[1].parent / "shared/data/imagery"
REAL = {
    "Spirit Navcam, sol 1869": ("mer/2n292280938effb100p0703l0m1.img.gz", 400),
    "Spirit Navcam, sol 1907": ("mer/2n295663162fflb1dnp1902l0m1.img.gz", 400),
    "Opportunity Navcam": ("mer/1n579700548ffld2fcp1981l0m1.img.gz", 0),
    "Curiosity Navcam, sol 3422": ("msl/NRB_701384494RAD_F0933408NCAM00200M1.IMG.gz", 0),
    "Perseverance Navcam, sol 670": (
        "m2020/NLF_0670_0726421423_362ECM_N0320604NCAM08111_01_095J01-metadata.json",
        300,
    ),
}
"""Product and first row that shows neither sky nor horizon."""

TILTS = {"ground, to 14 m": -0.25, "ground, 2 to 5 m": -0.6}
ROCK_RANGES_M = 1.6, 2.4, 3.2
HEAD = ["picture", "slope", "energy above f/4", "rms contrast", "half-width", "second peak", "SIFT per Mpx"]
FORMATS = "{:.1f}", "{:.2f}", "{:.2f}", "{:.0f}", "{:.2f}", "{:,.0f}"


@dataclass(frozen=True)
class Picture:
    """An image with the pixels that are measured."""

    kind: str
    image: Grey
    mask: Mask


def real_pictures() -> Iterator[Picture]:
    """Yield the flight frames that are there."""
    for name, (path, first_row) in REAL.items():
        if (IMAGERY / path).is_file():
            image = read_product(IMAGERY / path).image
            assert image is not None
            grey = np.asarray(image, dtype=np.float32)[first_row:]
            grey = grey.mean(axis=-1) if grey.ndim == 3 else grey
            yield Picture(name, grey, grey > 0)


def rendered_pictures(site: int) -> Iterator[Picture]:
    """Yield pictures of one site: ground, and the sunlit part of its rock from three ranges."""
    rng = np.random.default_rng([site, 0x7E87])
    terrain = generate_terrain(
        site, 48.0, inner_m=24.0, rock_cover=0.07, crater=False, outcrop=False, ortho=False
    )
    width = float(rng.uniform(0.8, 1.3))
    rock = Rock(
        "BIG",
        0.0,
        0.0,
        terrain.height_at(0.0, 0.0),
        diameter=width,
        height=width * float(rng.uniform(0.65, 0.85)),
        yaw=float(rng.uniform(0, math.tau)),
        burial=0.25,
        seed=int(rng.integers(1 << 20)),
    )
    # nothing stands on the rock or between it and the rover, who comes from the west
    others = (
        r
        for r in terrain.rocks
        if math.hypot(r.x, r.y) > 0.5 * r.diameter + 0.7 and not (-6.0 < r.x < 0.0 and abs(r.y) < 0.9)
    )
    terrain = replace(terrain, rocks=(rock, *others))
    renderer = Renderer(scene_from_terrain(terrain, radius_m=12.0, far_m=40.0, seed=site))
    rig = CameraRig(load_cameras("mer"), (0.5, 0.1, 1.3))
    sun = Sun.from_angles(math.radians(270.0 + rng.uniform(-40, 40)), math.radians(rng.uniform(35, 55)))

    west = Pose(-1.5, 0.0, terrain.height_at(-1.5, 0.0), math.pi)
    for kind, tilt in TILTS.items():
        frame = renderer.render(rig.camera("navcam_left", 0.0, tilt), west, sun)
        yield Picture(kind, frame.unit, (frame.truth.object_index >= 0) & (frame.truth.range_m < 14.0))
    for metres in ROCK_RANGES_M:
        x = -0.5 - metres
        pose = Pose(x, 0.0, terrain.height_at(x, 0.0), 0.0)
        middle = pose.site_from_rover.inverse().apply((0.0, 0.0, rock.z + 0.5 * rock.height))
        frame = renderer.render(rig.camera("navcam_left", *rig.point_at(middle, "navcam_left")), pose, sun)
        on_rock = frame.truth.object_index == frame.truth.ids.index(rock.id)
        yield Picture(f"rock, {metres:.1f} m", frame.unit, on_rock & frame.truth.lit)


def outside(found: TextureStatistics) -> list[str]:
    """Return which figures lie outside the ranges of the flight frames."""
    return [name for name, (low, high) in RANGES.items() if not low <= getattr(found, name) <= high]


def _cells(found: TextureStatistics) -> list[str]:
    return [form.format(value) for form, value in zip(FORMATS, astuple(found), strict=True)]


def _spread(several: list[TextureStatistics]) -> list[str]:
    """Return least and greatest of each figure."""
    figures = zip(*(astuple(s) for s in several), strict=True)
    ends = [(form.format(min(v)), form.format(max(v))) for form, v in zip(FORMATS, figures, strict=True)]
    return [low if low == high else f"{low} to {high}" for low, high in ends]


def _crop(picture: Picture, top: int, left: int) -> npt.NDArray[np.uint8]:
    return stretch(picture.image[top : top + 400, left : left + 400]).astype(np.uint8)


def main() -> int:
    """Print the table; with --out write it and the picture into the docs."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sites", type=int, default=6)
    parser.add_argument("--all", action="store_true", help="print every rendered picture")
    parser.add_argument("--out", type=Path, help="docs folder that gets the table and the picture")
    arguments = parser.parse_args()
    rows: list[list[str]] = []
    crops: list[npt.NDArray[np.uint8]] = []
    for picture in real_pictures():
        rows.append([picture.kind, *_cells(measure(picture.image, picture.mask))])
        if picture.kind == "Opportunity Navcam":
            crops.append(_crop(picture, 100, 420))
        elif picture.kind == "Spirit Navcam, sol 1907":
            crops.append(_crop(picture, 20, 200))
    found: dict[str, list[TextureStatistics]] = {}
    beyond = 0
    for site in range(1, arguments.sites + 1):
        for picture in rendered_pictures(site):
            figures = measure(picture.image, picture.mask)
            found.setdefault(picture.kind, []).append(figures)
            wrong = outside(figures)
            beyond += bool(wrong)
            if arguments.all or wrong:
                print(
                    f"site {site}, {picture.kind}: {', '.join(_cells(figures))} {' '.join(wrong)}", flush=True
                )
            if site == 1 and picture.kind == "ground, to 14 m":
                crops.append(_crop(picture, 480, 300))
            elif site == 1 and picture.kind == "rock, 2.4 m":
                crops.append(_crop(picture, 312, 312))
    rows += [[f"rendered {kind}", *_spread(several)] for kind, several in found.items()]
    pictures = sum(len(several) for several in found.values())
    body = table(HEAD, rows) + (
        f"\n{arguments.sites} sites, each with its own ground, rock and sun: {pictures} rendered pictures, "
        f"{beyond} of them outside the flight frames' ranges in any figure.\n"
    )
    print(body)
    if arguments.out is not None:
        write_section(arguments.out, "cameras", "texture", body)
        if len(crops) == 4:
            from PIL import Image

            Image.fromarray(np.hstack(crops)).resize((1280, 320), Image.Resampling.LANCZOS).save(
                arguments.out / "img/render_and_real.png", optimize=True
            )
    return 1 if beyond else 0


if __name__ == "__main__":
    sys.exit(main())
