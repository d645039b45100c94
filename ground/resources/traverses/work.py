"""Adjust the stops of a traverse: rocks extracted and matched, legs judged, poses solved, pictures kept."""

from __future__ import annotations

import math
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, TypedDict

from ground.day.prepare import Report
from ground.errors import GroundError, JobFailedError, StoreAwayError
from ground.gdr.archives import extract_zip, is_zip
from ground.gdr.files import files_at
from ground.gdr.places import fetched
from ground.jobs.queue import WorkStoppedError
from ground.resources.traverses.order import SeenStop, TraverseWork

if TYPE_CHECKING:
    from rover_iface.localization.ground_points import GroundPoints
    from rover_iface.localization.stop_picture import StopPicture

NEAR_M = 5.0
"""A panorama is of a frame only if taken within this distance of it: a mast's height, and no other stop."""


class AdjustedPose(TypedDict):
    """The pose of a stop: where it was believed, where it is with its covariance (6x6)."""

    believed_m: list[float]
    rotation: list[list[float]]
    translation: list[float]
    covariance: list[list[float]]


def work(order: TraverseWork, report: Report, should_stop: Callable[[], bool]) -> Mapping[str, object]:
    """Return `document` (`localization/1`, each stop with its picture) and `poses` of the stops.

    Raises
    ------
    JobFailedError
        If a stop cannot be read, lies not at its frame, or the traverse cannot be solved.
    """
    import cv2

    from rover_iface.errors import RoverError
    from rover_iface.localization.leg import FaultLimits
    from rover_iface.localization.traverse import TraverseOptions, localise_traverse

    store = files_at(order.files_dir)
    stops, pictures = [], []
    for index, stop in enumerate(order.stops):
        if should_stop():
            raise WorkStoppedError
        report(0.5 * index / len(order.stops), f"points of {stop.name}")
        try:
            seen, picture = _seen(stop)
        except StoreAwayError:
            raise
        except (RoverError, GroundError, OSError) as err:
            raise JobFailedError(f"stop {stop.name}: {err}") from err
        away = math.hypot(seen.eye[0] - stop.east_m, seen.eye[1] - stop.north_m)
        if away > NEAR_M:
            raise JobFailedError(
                f"stop {stop.name}: its panorama was taken at ({seen.eye[0]:.1f}, {seen.eye[1]:.1f}) m, "
                f"{away:.1f} m from its frame; the limit is {NEAR_M:g} m"
            )
        encoded = cv2.imencode(".png", picture.image)[1].tobytes()
        pictures.append({"sha256": store.put_bytes(encoded).sha256, **picture.document()})
        stops.append((stop.name, seen))
    options = order.options
    done = [0]

    def say(line: str) -> None:
        if should_stop():
            raise WorkStoppedError
        done[0] += 1
        report(0.5 + 0.5 * done[0] / (2 * len(stops)), line)

    try:
        found = localise_traverse(
            stops,
            TraverseOptions(
                share=options.odometry,
                heading_sigma_rad=options.heading_rad,
                sun_sigma_rad=options.sun_rad,
            ),
            limits=FaultLimits(longest_m=options.longest_m),
            report=say,
        )
    except RoverError as err:
        raise JobFailedError(str(err)) from err
    poses: list[AdjustedPose] = []
    for name, eye in zip(found.names, found.before, strict=True):
        pose = found.adjustment.poses[name]
        poses.append(
            {
                "believed_m": eye.tolist(),
                "rotation": pose.site_from_rover.rotation.tolist(),
                "translation": pose.site_from_rover.translation.tolist(),
                "covariance": (0.5 * (pose.covariance + pose.covariance.T)).tolist(),
            }
        )
    return {"document": found.document(pictures), "poses": poses}


def _seen(stop: SeenStop) -> tuple[GroundPoints, StopPicture]:
    """Return the points and the picture of a stop."""
    from rover_iface.cameras.panorama import load_panorama
    from rover_iface.localization.ground_points import points_of_panorama, read_points
    from rover_iface.localization.stop_picture import picture_of_panorama, picture_of_points

    source = fetched(stop.path)
    with tempfile.TemporaryDirectory(prefix="outcrop-stop-") as scratch:
        folder = source
        if source.is_file() and is_zip(source) and not stop.file_name.lower().endswith(".npz"):
            folder = Path(scratch) / "panorama"
            extract_zip(source, folder, max_bytes=stop.max_bytes)
            inside = sorted(folder.rglob("panorama.json"))
            if len(inside) != 1:
                raise JobFailedError(f"the zip holds {len(inside)} panorama.json; one is needed")
            folder = inside[0].parent
        if folder.is_dir():
            panorama = load_panorama(folder)
            return points_of_panorama(panorama), picture_of_panorama(panorama)
        named = Path(scratch) / f"points{Path(stop.file_name).suffix}"
        named.symlink_to(source)
        seen = read_points(named)
        return seen, picture_of_points(seen)
