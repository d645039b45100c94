"""Texture of rendered and real pictures: table for docs/cameras.md and docs/img/render_and_real.png.

.venv/bin/python benchmarks/texture.py --out docs
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.labels import read_product
from rover_iface.cameras.rig import CameraRig, load_cameras
from rover_iface.frames import Pose
from rover_iface.simulator.render.from_terrain import scene_from_terrain
from rover_iface.simulator.render.renderer import Renderer, Sun
from rover_iface.simulator.render.statistics import measure, stretch
from rover_iface.terrain.generate import generate_terrain
from rover_iface.terrain.rocks import Rock

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


def main() -> None:
    """Print the table; with --out also draw the picture."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--out", type=Path)
    out = parser.parse_args().out
    crops: list[npt.NDArray[np.uint8]] = []
    head = "spectrum slope | energy above f/4 | rms contrast | NCC half-width | second peak | SIFT per Mpx"
    print(f"| picture | {head} |")
    print("|---|---|---|---|---|---|---|")
    for name, (path, first_row) in REAL.items():
        if not (IMAGERY / path).is_file():
            continue
        image = read_product(IMAGERY / path).image
        assert image is not None
        grey = np.asarray(image, dtype=np.float32)
        grey = grey.mean(axis=-1) if grey.ndim == 3 else grey
        _print(name, grey[first_row:], grey[first_row:] > 0)
        if name == "Opportunity Navcam":
            crops.append(stretch(grey[100:500, 420:820]).astype(np.uint8))
        if name == "Spirit Navcam, sol 1907":
            crops.append(stretch(grey[420:820, 200:600]).astype(np.uint8))
    terrain = generate_terrain(3, rock_cover=0.07, ortho=False)
    renderer = Renderer(scene_from_terrain(terrain, (0.0, 0.0), seed=1))
    rig = CameraRig(load_cameras("mer"), (0.5, 0.1, 1.3))
    pose = Pose(0.0, 0.0, terrain.height_at(0.0, 0.0), 0.4)
    sun = Sun.from_angles(math.radians(100.0), math.radians(40.0))
    for name, tilt in (("rendered, to 14 m", -0.25), ("rendered, 2 to 5 m", -0.6)):
        frame = renderer.render(rig.camera("navcam_left", 0.3, tilt), pose, sun)
        seen = (frame.truth.object_index >= 0) & (frame.truth.range_m < 14.0)
        _print(name, frame.unit, seen)
        if name == "rendered, to 14 m":
            crops.append(stretch(frame.unit[480:880, 300:700]).astype(np.uint8))
    heading = 0.4 + 0.3
    behind = Sun.from_angles(math.radians(240.0), math.radians(45.0))
    for metres in (1.6, 2.4, 3.2):
        x, y = (0.5 + metres) * math.cos(heading), (0.5 + metres) * math.sin(heading)
        rock = Rock("BIG", x, y, terrain.height_at(x, y), diameter=1.2, height=0.9, burial=0.25, seed=7)
        rocky = replace(terrain, rocks=(*terrain.rocks, rock))
        near = Renderer(scene_from_terrain(rocky, (0.0, 0.0), radius_m=8.0, seed=1))
        frame = near.render(rig.camera("navcam_left", 0.3, -math.atan2(0.9, metres)), pose, behind)
        index = next(k for k, name in enumerate(frame.truth.ids) if name.startswith("BIG"))
        on_rock = frame.truth.object_index == index
        _print(f"rendered rock, {metres:.1f} m", frame.unit, on_rock & frame.truth.lit)
        if metres == 2.4:
            rows, columns = np.nonzero(on_rock)
            top = min(max(0, int(rows.mean()) - 200), 624)
            left = min(max(0, int(columns.mean()) - 200), 624)
            crops.append(stretch(frame.unit[top : top + 400, left : left + 400]).astype(np.uint8))
    if out is not None and len(crops) == 4:
        from PIL import Image

        (out / "img").mkdir(parents=True, exist_ok=True)
        Image.fromarray(np.hstack(crops)).resize((1280, 320), Image.Resampling.LANCZOS).save(
            out / "img/render_and_real.png", optimize=True
        )


def _print(name: str, image: npt.NDArray[np.float32], mask: npt.NDArray[np.bool_]) -> None:
    s = measure(image, mask)
    print(
        f"| {name} | {s.spectrum_slope:.1f} | {s.high_energy:.2f} | {s.rms_contrast:.2f} | "
        f"{s.half_width_px:.0f} | {s.second_peak:.2f} | {s.sift_per_mpx:,.0f} |"
    )


if __name__ == "__main__":
    main()
