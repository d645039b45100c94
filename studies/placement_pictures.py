"""Pictures of `docs/reference/placement.md`: masks of rocks over an image, safe and unsafe places of a rock,
Spirit's cloud, what a run of placements came to.

`python -m studies.placement_pictures --out docs/img --spirit ../shared/data/terrain/mer_spirit`
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import CameraModel
from rover_iface.placement import PlacementVerdict, cloud_of_points, plan_placement, segment
from rover_iface.placement.safety import safety_map
from rover_iface.profile import load_profile
from rover_iface.simulator.render.renderer import Renderer
from studies.common.placement_rocks import RockScene, rock_scene
from studies.common.placement_worlds import views
from studies.placement import designated, rendered_clouds
from studies.segmentation import FARTHEST_M, segmented

Picture = npt.NDArray[np.uint8]
GREEN, RED, BLUE, WHITE = (90, 200, 60), (60, 60, 230), (255, 160, 40), (255, 255, 255)


def segments_over_image(folder: Path, seed: int, number: int, sensor: str) -> Picture:
    """Return an image beside itself with the masks of rocks over it; their true outlines in red."""
    view = views(seed, folder, sensor=sensor)[number]
    masks, _, found = segmented(view)
    plain = cv2.cvtColor(_bright(view.left), cv2.COLOR_GRAY2BGR).astype(np.uint8)
    colours = np.random.default_rng(4).integers(70, 255, (len(found.rocks) + 1, 3))
    rock = masks >= 0
    out = plain.astype(np.float64)
    out[rock] = 0.55 * out[rock] + 0.45 * colours[masks[rock]]
    edge = cv2.morphologyEx((view.body + 2).astype(np.float32), cv2.MORPH_GRADIENT, np.ones((2, 2), np.uint8))
    out[(edge > 0) & (view.range_m < FARTHEST_M + 1.0)] = RED
    both = np.hstack((plain, out.astype(np.uint8)))
    wide = 1400
    height = round(both.shape[0] * wide / both.shape[1])
    return np.asarray(cv2.resize(both, (wide, height), interpolation=cv2.INTER_AREA), dtype=np.uint8)


def _bright(image: npt.NDArray[np.uint8]) -> Picture:
    return np.round(255.0 * np.sqrt(image / 255.0)).astype(np.uint8)


def safety_over_rock(seed: int) -> tuple[Picture, PlacementVerdict]:
    """Return a rock with its safe (green) and unsafe (red) places, and the verdict drawn in."""
    rock = rock_scene(seed)
    image, camera = _image_of(rock)
    _, at = designated(rock)
    cloud, second = rendered_clouds(rock, at)
    found = segment(cloud)
    profile = load_profile("k9")
    verdict = plan_placement(cloud, at, profile, segmentation=found, second=second)
    big = 3
    canvas = cv2.resize(image, None, fx=big, fy=big, interpolation=cv2.INTER_CUBIC)
    wide = camera.scaled(float(big))
    label = verdict.rock.label if verdict.rock is not None else -1
    if label >= 0:
        for judged in safety_map(cloud, found, label, profile, near=at, second=second):
            x, y = np.round(wide.project(judged.point)).astype(int)
            good = not judged.findings or judged.close_strain <= 1.0
            cv2.circle(
                canvas,
                (int(x), int(y)),
                4,
                GREEN if good else RED,
                -1,
                cv2.LINE_AA,
            )
    _mark(canvas, wide, at, WHITE, "designated", 34)
    if verdict.point is not None and verdict.accepted:
        assert verdict.normal is not None
        _mark(canvas, wide, verdict.point, BLUE, "placed")
        tip = verdict.point + 0.06 * verdict.normal
        ends = [tuple(int(v) for v in np.round(wide.project(p))) for p in (verdict.point, tip)]
        cv2.line(canvas, ends[0], ends[1], BLUE, 3, cv2.LINE_AA)
    return canvas.astype(np.uint8), verdict


def _mark(
    canvas: npt.NDArray[np.generic],
    camera: CameraModel,
    point: npt.NDArray[np.float64],
    colour: tuple[int, int, int],
    text: str,
    lower_px: int = 0,
) -> None:
    x, y = (int(v) for v in np.round(camera.project(point)))
    cv2.circle(canvas, (x, y), 11, (0, 0, 0), 4, cv2.LINE_AA)
    cv2.circle(canvas, (x, y), 11, colour, 2, cv2.LINE_AA)
    halo = [(dx, dy) for dx in (-2, 0, 2) for dy in (-2, 0, 2)]
    for (dx, dy), ink in [*((shift, (0, 0, 0)) for shift in halo), ((0, 0), colour)]:
        place = (x + 16 + dx, y - 8 + lower_px + dy)
        cv2.putText(canvas, text, place, cv2.FONT_HERSHEY_SIMPLEX, 0.6, ink, 1, cv2.LINE_AA)


def _image_of(rock: RockScene) -> tuple[Picture, CameraModel]:
    frame = Renderer(rock.scene).render(rock.left, None, rock.sun, window=rock.window, seed=rock.seed)
    return cv2.cvtColor(frame.image8, cv2.COLOR_GRAY2BGR).astype(np.uint8), rock.left.window(*rock.window)


def spirit(folder: Path) -> Picture:
    """Return Spirit's front Hazcam points of sol 1352 from above: by height, and by segment."""
    raw = (folder / "front_hazcam_sol1352_site131.ply").read_bytes()
    body = raw[raw.index(b"end_header\n") + len(b"end_header\n") :]
    ned = np.frombuffer(body, "<f4").reshape(-1, 3).astype(np.float64)
    cloud = cloud_of_points(np.column_stack((ned[:, 1], ned[:, 0], -ned[:, 2])), sigma_m=0.006)
    found = segment(cloud)
    assert found.plane is not None
    local = found.plane.local(cloud.points)[:, :2]
    low, high = local.min(axis=0), local.max(axis=0)
    scale = 620.0 / float((high - low).max())
    size = np.ceil((high - low) * scale).astype(int) + 20
    height = np.clip((found.height_m + 0.05) / 0.30 * 255.0, 0, 255).astype(np.uint8)
    by_height = cv2.applyColorMap(height.reshape(-1, 1), cv2.COLORMAP_VIRIDIS)[:, 0]
    colours = np.random.default_rng(4).integers(70, 255, (len(found.rocks) + 1, 3))
    colours[-1] = (120, 120, 120)
    tiles = []
    for ink in (by_height, colours[found.labels]):
        tile = np.full((int(size[1]), int(size[0]), 3), 30, np.uint8)
        for (x, y), colour in zip((local - low) * scale + 10, ink.tolist(), strict=True):
            cv2.circle(tile, (int(x), int(size[1] - 1 - y)), 2, colour, -1)
        tiles.append(tile)
    return np.hstack(tiles)


def run_plot(rows: list[dict[str, Any]], path: Path) -> None:
    """Draw what came of each rock of a run by its size, where the tool went, and what stood under it."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    rows = [r for r in rows if r["decision"] != "unseen"]
    accepted = [r for r in rows if "wrong" in r]
    figure, (left, middle, right) = plt.subplots(1, 3, figsize=(13.0, 3.9), layout="constrained")
    bins = np.linspace(0.18, 0.70, 14)
    kinds = {
        "designated point": [r for r in accepted if r["decision"] == "place"],
        "point near it": [r for r in accepted if r["decision"] == "place-near"],
        "rightly refused": [r for r in rows if "wrong" not in r and not r["safe_place"]],
        "falsely refused": [r for r in rows if "wrong" not in r and r["safe_place"]],
    }
    left.hist(
        [[r["diameter_m"] for r in part] for part in kinds.values()],
        bins=bins.tolist(),
        stacked=True,
        label=[f"{name}: {len(part)}" for name, part in kinds.items()],
        color=["#2a9d4a", "#8fcf9f", "#9aa0a6", "#d1493f"],
    )
    left.set(xlabel="rock, m across", ylabel="rocks", title="What was decided")
    left.legend(fontsize=8)
    ordered = np.sort([100.0 * r["error_m"] for r in accepted])
    middle.plot(ordered, np.linspace(0.0, 1.0, len(ordered)))
    middle.set(xlabel="contact from the picked point, cm", ylabel="share of accepts", title="Where it went")
    middle.grid(alpha=0.3)
    right.scatter(
        [1000.0 * r["true_protrusion_m"] for r in accepted],
        [1000.0 * r["true_depth_m"] for r in accepted],
        s=7,
        c=["#d1493f" if r["wrong"] else "#2a9d4a" for r in accepted],
    )
    right.axvline(20.0, color="k", lw=0.8)
    right.axhline(30.0, color="k", lw=0.8)
    right.set(
        xlabel="true protrusion under the tool, mm", ylabel="true depth, mm", title="What was under the tool"
    )
    figure.savefig(path, dpi=110)
    plt.close(figure)


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("docs/img"))
    parser.add_argument("--folder", type=Path, default=Path("/tmp/outcrop-placement"), help="of kept views")
    parser.add_argument("--spirit", type=Path)
    parser.add_argument("--view", type=int, nargs=2, default=(900, 1), help="world and number of the view")
    parser.add_argument("--safe", type=int, default=5114)
    parser.add_argument("--refused", type=int, default=24328)
    parser.add_argument("--run", type=Path, help="rows of a run of `studies.placement`, to be drawn alone")
    options = parser.parse_args()
    if options.run is not None:
        rows = [json.loads(line) for line in options.run.read_text(encoding="utf-8").splitlines()]
        run_plot(rows, options.out / "placement_run.png")
        return
    for sensor in ("navcam", "hazcam"):
        world, number = options.view
        picture = segments_over_image(options.folder, world, number, sensor)
        name = str(options.out / f"placement_segments_{sensor}.jpg")
        cv2.imwrite(name, picture, [cv2.IMWRITE_JPEG_QUALITY, 86])
    for name, seed in (("safe", options.safe), ("refused", options.refused)):
        picture, verdict = safety_over_rock(seed)
        print(name, seed, verdict.text)
        cv2.imwrite(str(options.out / f"placement_{name}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 90])
    if options.spirit is not None:
        cv2.imwrite(str(options.out / "placement_spirit.png"), spirit(options.spirit))


if __name__ == "__main__":
    main()
