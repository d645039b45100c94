"""Linearisation: the CAHV camera that best replaces a distorted one, and the image warped to it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array, CameraModel, ModelKind
from rover_iface.errors import CameraError

FAR_M = 1.0e6
"""A range at which the entrance pupil's motion is nothing: rays are compared by direction."""


def linearised(camera: CameraModel) -> CameraModel:
    """Return the CAHV camera that replaces `camera`, of the same centre and size.

    Its axis is the ray of the frame's middle and its rows are level with those of `camera`. Each focal length
    is the shortest at which the frame's sides and corners bound the new image, so that nothing beyond the old
    frame is shown (the missions' choice).
    """
    if camera.kind is ModelKind.CAHV:
        return camera
    width, height = camera.width, camera.height
    x, y = camera.width - 1.0, camera.height - 1.0
    axis = camera.back_project((x / 2, y / 2))[1]
    right = camera.horizontal - (camera.horizontal @ axis) * axis
    right /= np.linalg.norm(right)
    down = np.cross(axis, right)
    if down @ (camera.V - camera.vc * camera.A) < 0:
        down = -down
    sides = np.array([(0, 0), (0, y / 2), (0, y), (x, 0), (x, y / 2), (x, y)])
    ends = np.array([(0, 0), (x / 2, 0), (x, 0), (0, y), (x / 2, y), (x, y)])
    tangents = []
    for points, across in ((sides, right), (ends, down)):
        rays = camera.back_project(points)[1]
        ahead = rays @ axis
        usable = ahead > np.cos(np.radians(85.0))
        values = np.abs(rays @ across)[usable] / ahead[usable]
        tangents.append(float(values.min()))
    hs, vs = width / 2.0 / tangents[0], height / 2.0 / tangents[1]
    hc, vc = (width - 1) / 2.0, (height - 1) / 2.0
    return CameraModel(
        ModelKind.CAHV, width, height, C=camera.C, A=axis, H=hs * right + hc * axis, V=vs * down + vc * axis
    )


def warp_coordinates(to: CameraModel, source: CameraModel, *, range_m: float = FAR_M) -> Array:
    """Return, for each pixel of `to`, the pixel of `source` that sees the same point, (height, width, 2).

    `range_m` is the distance at which both look at the same point; it matters only if their centres differ.
    """
    from rover_iface.cameras import kernels

    coordinates = np.empty((to.height, to.width, 2))
    kernels.warp_map(to.packed, source.packed, to.width, to.height, range_m, coordinates)
    return coordinates


def warp(
    image: npt.NDArray[np.generic],
    source: CameraModel,
    to: CameraModel,
    *,
    range_m: float = FAR_M,
    fill: float = 0.0,
) -> npt.NDArray[np.float32]:
    """Return `image` of camera `source` as camera `to` would have taken it, bilinear, float32 [rows,
    columns].

    `image` [rows, columns] has the size of `source`. Cameras that stand apart see a scene at `range_m`; what
    `source` does not show is `fill`.

    Raises
    ------
    CameraError
        If the image has another size than its camera.
    """
    from rover_iface.cameras import kernels

    if image.ndim != 2 or image.shape != (source.height, source.width):
        raise CameraError(f"image is {image.shape}, its camera {source.height} x {source.width}")
    if image.shape == (to.height, to.width) and _same(source, to):
        return np.ascontiguousarray(image, dtype=np.float32)
    out = np.empty((to.height, to.width), np.float32)
    if source.kind is ModelKind.CAHV and to.kind is ModelKind.CAHV:
        from rover_iface.cameras.linear_kernels import warp_linear

        given = np.ascontiguousarray(image, dtype=np.float32)
        warp_linear(given, to.packed, source.packed, range_m, np.float32(fill), out)
        return out
    coordinates = warp_coordinates(to, source, range_m=range_m)
    kernels.sample_bilinear(np.ascontiguousarray(image, dtype=np.float32), coordinates, np.float32(fill), out)
    return out


def _same(one: CameraModel, other: CameraModel) -> bool:
    """Return whether two linear cameras see every pixel alike, to a millionth of one."""
    return (
        one.kind is ModelKind.CAHV
        and other.kind is ModelKind.CAHV
        and all(
            np.allclose(getattr(one, letter), getattr(other, letter), rtol=0.0, atol=1e-6)
            for letter in "CAHV"
        )
    )


def aligned_pair(left: CameraModel, right: CameraModel) -> tuple[CameraModel, CameraModel]:
    """Return two CAHV cameras with common axis and rows: a point lies on the same line of both.

    The rows run along the baseline; both have the same focal length and image centre, so that the disparity
    of a point at depth Z is focal_px * baseline / Z.
    """
    one, two = linearised(left), linearised(right)
    baseline = two.C - one.C
    length = float(np.linalg.norm(baseline))
    if length < 1e-6:
        raise CameraError("a stereo pair needs two different camera centres")
    row = baseline / length
    axis = one.A + two.A
    axis -= (axis @ row) * row
    axis /= np.linalg.norm(axis)
    column = np.cross(axis, row)
    if column @ (one.V - one.vc * one.A) < 0:
        raise CameraError("the right camera lies to the left of the left one")
    focal = min(one.hs, one.vs, two.hs, two.vs)
    hc, vc = (one.width - 1) / 2.0, (one.height - 1) / 2.0
    made = [
        CameraModel(
            ModelKind.CAHV,
            one.width,
            one.height,
            C=c,
            A=axis,
            H=focal * row + hc * axis,
            V=focal * column + vc * axis,
        )
        for c in (one.C, two.C)
    ]
    return made[0], made[1]
