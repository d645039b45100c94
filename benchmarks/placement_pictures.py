"""Pictures of `docs/placement.md`: segments over a hazcam image, safe and unsafe places of a rock, Spirit's
cloud.

`python -m benchmarks.placement_pictures --out docs/img --spirit ../shared/data/terrain/mer_spirit`
"""

from __future__ import annotations

import argparse
from pathlib import Path

import cv2
import numpy as np
import numpy.typing as npt

from benchmarks.placement import designated
from benchmarks.placement_rocks import RockScene, rock_scene
from benchmarks.placement_worlds import views
from benchmarks.segmentation import cloud_of_view
from rover_iface.cameras.model import CameraModel
from rover_iface.placement import PlacementVerdict, SurfaceCloud, cloud_of_points, plan_placement, segment
from rover_iface.placement.safety import safety_map
from rover_iface.placement.segmentation import Segmentation
from rover_iface.profile import load_profile
from rover_iface.simulator.render.renderer import Renderer

Picture = npt.NDArray[np.uint8]
GREEN, RED, BLUE, WHITE = (90, 200, 60), (60, 60, 230), (255, 160, 40), (255, 255, 255)


def segments_over_image(folder: Path, seed: int, number: int) -> Picture:
    """Return a hazcam image beside itself with the segments drawn over it."""
    view = views(seed, folder)[number]
    cloud = cloud_of_view(view)
    found = segment(cloud)
    plain = cv2.cvtColor(_bright(view.left), cv2.COLOR_GRAY2BGR)
    return np.hstack((plain, _overlay(plain, view.left_camera, cloud, found)))


def _bright(image: npt.NDArray[np.uint8]) -> Picture:
    return np.round(255.0 * np.sqrt(image / 255.0)).astype(np.uint8)


def _overlay(image: Picture, camera: CameraModel, cloud: SurfaceCloud, found: Segmentation) -> Picture:
    label = np.full(image.shape[:2], -2)
    pixels = np.round(camera.project(cloud.points)).astype(np.int64)
    inside = ((pixels >= 0) & (pixels < (image.shape[1], image.shape[0]))).all(axis=1)
    label[pixels[inside, 1], pixels[inside, 0]] = found.labels[inside]
    # an image pixel between two points has none of its own
    filled = cv2.dilate((label + 2).astype(np.float32), np.ones((3, 3), np.uint8)).astype(np.int64) - 2
    label = np.where(label == -2, filled, label)
    colours = np.random.default_rng(4).integers(70, 255, (len(found.rocks) + 1, 3))
    rock = label >= 0
    out = image.astype(np.float64)
    out[rock] = 0.45 * out[rock] + 0.55 * colours[label[rock]]
    out[label == -2] *= 0.55
    return out.astype(np.uint8)


def safety_over_rock(seed: int) -> tuple[Picture, PlacementVerdict]:
    """Return a rock with its safe (green) and unsafe (red) places, and the verdict drawn in."""
    rock = rock_scene(seed)
    image, camera = _image_of(rock)
    _, at = designated(rock)
    cloud = rock.rendered_cloud(seed)
    found = segment(cloud)
    profile = load_profile("k9")
    verdict = plan_placement(cloud, at, profile, segmentation=found)
    big = 3
    canvas = cv2.resize(image, None, fx=big, fy=big, interpolation=cv2.INTER_CUBIC)
    wide = camera.scaled(float(big))
    label = verdict.rock.label if verdict.rock is not None else -1
    if label >= 0:
        for judged in safety_map(cloud, found, label, profile):
            x, y = np.round(wide.project(judged.point)).astype(int)
            cv2.circle(canvas, (int(x), int(y)), 4, GREEN if not judged.findings else RED, -1, cv2.LINE_AA)
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
    for thickness, ink in ((4, (0, 0, 0)), (1, colour)):
        cv2.putText(
            canvas,
            text,
            (x + 16, y - 8 + lower_px),
            cv2.FONT_HERSHEY_SIMPLEX,
            0.6,
            ink,
            thickness,
            cv2.LINE_AA,
        )


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


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--out", type=Path, default=Path("docs/img"))
    parser.add_argument("--folder", type=Path, default=Path("/tmp/outcrop-placement"), help="of kept views")
    parser.add_argument("--spirit", type=Path)
    parser.add_argument("--view", type=int, nargs=2, default=(900, 0), help="world and number of the view")
    parser.add_argument("--safe", type=int, default=5120)
    parser.add_argument("--refused", type=int, default=5114)
    options = parser.parse_args()
    picture = segments_over_image(options.folder, *options.view)
    cv2.imwrite(str(options.out / "placement_segments.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 88])
    for name, seed in (("safe", options.safe), ("refused", options.refused)):
        picture, verdict = safety_over_rock(seed)
        print(name, seed, verdict.text)
        cv2.imwrite(str(options.out / f"placement_{name}.jpg"), picture, [cv2.IMWRITE_JPEG_QUALITY, 90])
    if options.spirit is not None:
        cv2.imwrite(str(options.out / "placement_spirit.png"), spirit(options.spirit))


if __name__ == "__main__":
    main()
