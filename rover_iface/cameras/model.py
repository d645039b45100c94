"""CAHV, CAHVOR and CAHVORE cameras: project, back-project, derive, move, cut, scale."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from enum import StrEnum
from functools import lru_cache
from operator import mul

import numpy as np
import numpy.typing as npt

from rover_iface.errors import CameraError
from rover_iface.frames import Transform

Array = npt.NDArray[np.float64]


class ModelKind(StrEnum):
    """How the rays of a camera bend: not at all, radially, or with a moving entrance pupil."""

    CAHV = "CAHV"
    CAHVOR = "CAHVOR"
    CAHVORE = "CAHVORE"


LINEARITY_OF_TYPE = {1: 1.0, 2: 0.0}
"""CAHVORE type 1 is perspective, 2 fisheye; type 3 carries its own parameter."""


def _vector(name: str, value: npt.ArrayLike | None) -> Array:
    if value is None:
        return np.zeros(3)
    vector = np.array(value, dtype=np.float64)
    if vector.shape != (3,) or not all(map(math.isfinite, vector.tolist())):
        raise CameraError(f"camera vector {name} is {value!r}; it must be three finite numbers")
    vector.setflags(write=False)
    return vector


def _product(a: Array, b: Array) -> tuple[float, float, float]:
    """Return the vector product; numpy's takes a hundred times as long."""
    (ax, ay, az), (bx, by, bz) = a.tolist(), b.tolist()
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


def _product_length(a: Array, b: Array) -> float:
    return math.hypot(*_product(a, b))


@lru_cache(maxsize=64)
def _largest_squared_radius(radial: tuple[float, ...]) -> float:
    """Return where 1 + r0 + 3 r1 s + 5 r2 s^2 falls to zero: beyond it the lens polynomial folds back."""
    roots = np.roots([5.0 * radial[2], 3.0 * radial[1], 1.0 + radial[0]])
    real = [float(r.real) for r in roots if abs(r.imag) < 1e-12 and r.real > 0]
    return min(real, default=np.inf)


def _is_identity(rows: list[list[float]]) -> bool:
    """Return what `numpy.allclose` to 1e-6 says of three rows of three, in a hundredth of its time."""
    return all(
        abs(value - (i == j)) <= 1e-6 + 1e-5 * (i == j)
        for i, row in enumerate(rows)
        for j, value in enumerate(row)
    )


@dataclass(frozen=True, slots=True, eq=False)
class CameraModel:
    """One camera, in the frame that its vectors are written in.

    Attributes
    ----------
    kind
        Which of the three models.
    width, height
        Image size, pixels. Pixel (0, 0) is the centre of the upper left pixel.
    C, A, H, V
        Centre (m), axis (unit), and the two image vectors (pixels). H and V keep whatever skew they have.
    O, R
        Optical axis and radial coefficients; CAHVOR and CAHVORE. O is made unit in CAHVOR and used as
        written in CAHVORE (labels print six digits; this is what the missions' own products agree with).
    E, linearity
        Entrance pupil coefficients (m) and the parameter L of Gennery 2006: 1 perspective, 0 fisheye,
        in between general, below 0 stronger; CAHVORE. The ray of a pixel does not start at C but at
        C + s O, so that the camera is not central.
    """

    kind: ModelKind
    width: int
    height: int
    C: Array
    A: Array
    H: Array
    V: Array
    O: Array = field(default_factory=lambda: np.zeros(3))
    R: Array = field(default_factory=lambda: np.zeros(3))
    E: Array = field(default_factory=lambda: np.zeros(3))
    linearity: float = 1.0
    _packed: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        put = object.__setattr__
        for name in "CAHVORE":
            put(self, name, _vector(name, getattr(self, name)))
        if self.width < 1 or self.height < 1:
            raise CameraError(f"camera size is {self.width} x {self.height}; both must be at least 1 pixel")
        length = math.hypot(*self.A.tolist())
        if abs(length - 1.0) > 1e-3:
            raise CameraError(f"camera axis A has length {length:.6f}; it must be a unit vector")
        if self.kind is not ModelKind.CAHV:
            length = float(np.linalg.norm(self.O))
            if length < 1e-6:
                raise CameraError(f"{self.kind} camera has no optical axis O")
            if self.kind is ModelKind.CAHVOR:
                put(self, "O", _vector("O", self.O / length))
        if abs(sum(map(mul, self.A.tolist(), _product(self.H, self.V)))) < 1e-9:
            raise CameraError("camera vectors A, H and V lie in one plane: no image can be formed")
        p = np.zeros(26)
        for i, name in enumerate("CAHVORE"):
            p[3 * i : 3 * i + 3] = getattr(self, name)
        p[21] = list(ModelKind).index(self.kind)
        p[22] = self.linearity
        p[23] = _largest_squared_radius(tuple(self.R.tolist())) if self.kind is not ModelKind.CAHV else np.inf
        p[24] = float(self.kind is ModelKind.CAHVORE and abs(float(np.linalg.norm(self.O)) - 1.0) > 1e-12)
        p.setflags(write=False)
        put(self, "_packed", p)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, CameraModel):
            return NotImplemented
        return self.size == other.size and bool(np.array_equal(self._packed, other._packed))

    def __hash__(self) -> int:
        return hash((self.width, self.height, self._packed.tobytes()))

    @property
    def size(self) -> tuple[int, int]:
        """Return (width, height), px."""
        return self.width, self.height

    @property
    def packed(self) -> Array:
        """Return the flat parameter vector of `rover_iface.cameras.kernels`."""
        return self._packed

    @property
    def hs(self) -> float:
        """Return the horizontal focal length, pixels. Kim et al. 2009, eq. 7."""
        return _product_length(self.A, self.H)

    @property
    def vs(self) -> float:
        """Return the vertical focal length, pixels."""
        return _product_length(self.A, self.V)

    @property
    def hc(self) -> float:
        """Return the sample, px, where A meets the image. Kim et al. 2009, eq. 8."""
        return float(self.A @ self.H)

    @property
    def vc(self) -> float:
        """Return the line, px, where A meets the image. Kim et al. 2009, eq. 8."""
        return float(self.A @ self.V)

    @property
    def horizontal(self) -> Array:
        """Return the unit vector along the image rows. Kim et al. 2009, eq. 9."""
        return (self.H - self.hc * self.A) / self.hs

    def project(self, points: npt.ArrayLike) -> Array:
        """Return pixels (..., 2) as (sample, line) of points (..., 3), m, in the camera's frame; NaN for
        points not in front.
        """
        from rover_iface.cameras import kernels

        array = np.asarray(points, dtype=np.float64)
        if array.shape[-1:] != (3,):
            raise CameraError(f"points have shape {array.shape}; the last axis must be 3")
        flat = np.ascontiguousarray(array.reshape(-1, 3))
        pixels = np.empty((len(flat), 2))
        kernels.project_many(self._packed, flat, pixels)
        return pixels.reshape(*array.shape[:-1], 2)

    def back_project(self, pixels: npt.ArrayLike) -> tuple[Array, Array]:
        """Return ray origins, m, and unit directions, each (..., 3), of pixels (..., 2) as (sample, line)."""
        from rover_iface.cameras import kernels

        array = np.asarray(pixels, dtype=np.float64)
        if array.shape[-1:] != (2,):
            raise CameraError(f"pixels have shape {array.shape}; the last axis must be 2")
        flat = np.ascontiguousarray(array.reshape(-1, 2))
        origins = np.empty((len(flat), 3))
        directions = np.empty((len(flat), 3))
        kernels.back_project_many(self._packed, flat, origins, directions)
        shape = (*array.shape[:-1], 3)
        return origins.reshape(shape), directions.reshape(shape)

    def jacobian(self, points: npt.ArrayLike) -> Array:
        """Return d(sample, line)/d(point), (..., 2, 3), pixels per metre; NaN for points not in front."""
        from rover_iface.cameras import kernels

        array = np.asarray(points, dtype=np.float64)
        flat = np.ascontiguousarray(array.reshape(-1, 3))
        out = np.empty((len(flat), 2, 3))
        kernels.jacobian_many(self._packed, flat, out)
        return out.reshape(*array.shape[:-1], 2, 3)

    def sees(self, points: npt.ArrayLike, margin_px: float = 0.0) -> npt.NDArray[np.bool_]:
        """Return which points (..., 3), m, in the camera's frame, fall inside the frame, `margin_px` from its
        edge.
        """
        pixels = self.project(points)
        low, x_high, y_high = margin_px - 0.5, self.width - 0.5 - margin_px, self.height - 0.5 - margin_px
        with np.errstate(invalid="ignore"):
            inside = (pixels[..., 0] >= low) & (pixels[..., 0] < x_high)
            return np.asarray(inside & (pixels[..., 1] >= low) & (pixels[..., 1] < y_high))

    def moved(self, rotation: npt.ArrayLike, translation: npt.ArrayLike) -> CameraModel:
        """Return the camera in another frame: points there are rotation (3, 3) @ points here + translation
        (3,), m.
        """
        r = np.asarray(rotation, dtype=np.float64)
        if r.shape != (3, 3) or not _is_identity((r @ r.T).tolist()):
            raise CameraError("rotation of a camera must be an orthogonal 3 x 3 matrix")
        return replace(
            self,
            C=r @ self.C + np.asarray(translation, dtype=np.float64),
            A=r @ self.A,
            H=r @ self.H,
            V=r @ self.V,
            O=r @ self.O,
        )

    def transformed(self, to_from_here: Transform) -> CameraModel:
        """Return the camera in another frame, given the transform that leads there."""
        return self.moved(to_from_here.rotation, to_from_here.translation)

    def window(self, left: int, top: int, width: int, height: int) -> CameraModel:
        """Return the camera of a subframe whose pixel (0, 0) is (left, top) of this one."""
        return replace(self, H=self.H - left * self.A, V=self.V - top * self.A, width=width, height=height)

    def scaled(self, factor: float) -> CameraModel:
        """Return the camera of the image enlarged by `factor`; pixel areas, not pixel centres, are scaled."""
        if not factor > 0:
            raise CameraError(f"camera scale is {factor}; it must be positive")
        shift = 0.5 * factor - 0.5
        return replace(
            self,
            H=factor * self.H + shift * self.A,
            V=factor * self.V + shift * self.A,
            width=max(1, round(self.width * factor)),
            height=max(1, round(self.height * factor)),
        )


def pinhole(
    *,
    focal_px: float,
    width: int,
    height: int,
    center: npt.ArrayLike = (0.0, 0.0, 0.0),
    forward: npt.ArrayLike = (1.0, 0.0, 0.0),
    up: npt.ArrayLike = (0.0, 0.0, 1.0),
    principal_px: tuple[float, float] | None = None,
) -> CameraModel:
    """Return a CAHV camera looking along `forward` with image rows level with `up`.

    Without `principal_px` the axis meets the middle of the frame, ((width-1)/2, (height-1)/2).

    `center` [3], m, and the directions `forward` and `up` [3], of any length, are in the frame of the
    camera's model.
    """
    axis = np.asarray(forward, dtype=np.float64)
    axis = axis / np.linalg.norm(axis)
    right = np.cross(axis, np.asarray(up, dtype=np.float64))
    norm = float(np.linalg.norm(right))
    if norm < 1e-9:
        raise CameraError("pinhole camera looks along its own up direction")
    right = right / norm
    down = np.cross(axis, right)
    cx, cy = principal_px if principal_px is not None else ((width - 1) / 2.0, (height - 1) / 2.0)
    return CameraModel(
        ModelKind.CAHV,
        width,
        height,
        C=np.asarray(center, dtype=np.float64),
        A=axis,
        H=focal_px * right + cx * axis,
        V=focal_px * down + cy * axis,
    )
