"""Registration of two views of a surface, and what it is worth.

Two engines behind one call. `nelder-mead` is the published one (Deans, Kunz, Sargent and others 2005, section
2): a virtual range sensor renders the fixed mesh, a correlation search over the sensor's x and y with the
median depth difference comes first, the simplex over six parameters with two restarts after it. `gicp` is
generalised ICP (small-gicp) after the same search, which also tries turns.

A registration says whether it is to be believed: share of overlap, depth deviation left, and how far the
target moves when the engine starts beside its own result. A smooth face slides along itself with a small
residual; only the last tells.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.frames import Transform
from rover_iface.vision.shape_engines import Gicp, NelderMead
from rover_iface.vision.sift_motion import small_rotation
from rover_iface.vision.surface import Sensor, ShapeOptions, Surface


@dataclass(frozen=True, eq=False)
class Registration:
    """How one surface lies on another.

    Attributes
    ----------
    scene_from_model
        The motion that lays the model on the scene.
    overlap
        Share of the model's points that the scene's sensor knows within the cap.
    deviation_m
        Median absolute depth deviation of those.
    spread_m
        How far the target moves when the engine starts beside its result.
    ahead
        Share of either surface that would lie in front of what the other eye saw there.
    reasons
        Why it is not to be believed; empty if it is.
    """

    scene_from_model: Transform
    overlap: float
    deviation_m: float
    spread_m: float
    ahead: float
    reasons: tuple[str, ...]

    @property
    def accepted(self) -> bool:
        """Return whether the registration passed its tests."""
        return not self.reasons

    def covariance(self) -> Array:
        """Return (3, 3), m^2, of a point carried by it: round, from deviation and spread."""
        sigma = math.hypot(0.5 * self.deviation_m, self.spread_m) + 0.001
        return np.asarray(sigma**2 * np.eye(3))


def register(
    model: Surface,
    scene: Surface,
    guess: Transform,
    target: npt.ArrayLike,
    options: ShapeOptions | None = None,
) -> Registration:
    """Return how `model` lies on `scene`, from a first guess, tested round `target` (3,), m, of the model.

    Too few points is a registration that is not accepted, with the guess as its motion.
    """
    options = options or ShapeOptions()
    at = np.asarray(target, dtype=np.float64)
    part = model.near(at, options.radius_m).moved(guess)
    centre = np.asarray(guess.apply(at), dtype=np.float64)
    other = scene.near(centre, options.radius_m + options.search_m)
    if len(part.points) < 100 or len(other.points) < 100 or len(other.triangles) < 50:
        why = f"{len(part.points)} and {len(other.points)} points are too few; 100 are needed"
        return Registration(guess, 0.0, math.inf, math.inf, 1.0, (why,))
    sensor = Sensor.over(other, centre, options)
    rough = sensor.search(part.points, centre, options)
    if not rough:
        why = f"no shift within {options.search_m:.2f} m gives half an overlap"
        return Registration(guess, 0.0, math.inf, math.inf, 1.0, (why,))
    refine: Gicp | NelderMead
    if options.engine == "gicp":
        refine = Gicp(part, other, centre, options)
    else:
        refine = NelderMead(part, sensor, centre, options)
    found = refine.all_of(rough)
    back = Sensor.over(part, centre, options)
    pairs = [
        (sensor.gaps(part.points, m, options.cap_m), back.gaps(other.points, m.inverse(), options.cap_m))
        for m in found
    ]
    best = int(np.argmin([sum(_cost(g, options.cap_m) for g in pair) for pair in pairs]))
    beside = refine(_beside(found[best], centre))
    spread = float(np.linalg.norm(beside.apply(centre) - found[best].apply(centre)))
    gaps = pairs[best][0]
    close = np.abs(gaps) < options.cap_m
    overlap = float(close.mean())
    deviation = float(np.median(np.abs(gaps[close]))) if close.any() else math.inf
    ahead = max(_ahead(g, options.cap_m) for g in pairs[best])
    reasons = []
    if overlap < options.least_overlap:
        reasons.append(f"overlap {overlap:.2f} is below {options.least_overlap:.2f}")
    # what the stereo of both allows, as long as it tells rock from ground
    limit_m = min(options.most_deviation_m + math.hypot(model.noise_m, scene.noise_m), 0.5 * options.cap_m)
    if not deviation <= limit_m:
        reasons.append(f"deviation {1000 * deviation:.1f} mm is above {1000 * limit_m:.1f} mm")
    if ahead > options.most_ahead:
        reasons.append(f"{ahead:.2f} lies in front of what was seen; the limit is {options.most_ahead:.2f}")
    if spread > options.most_spread_m:
        reasons.append(
            f"a start beside it ends {1000 * spread:.1f} mm away; "
            f"the limit is {1000 * options.most_spread_m:.1f} mm"
        )
    return Registration(found[best] * guess, overlap, deviation, spread, ahead, tuple(reasons))


def _beside(motion: Transform, centre: Array) -> Transform:
    """Return a start 2 cm and 2 degrees beside a motion."""
    place = np.asarray(motion.apply(centre), dtype=np.float64)
    turn = small_rotation(0.035 * np.array([0.6, -0.5, 0.6]))
    return Transform(turn, place - turn @ place + 0.02 * np.array([0.6, 0.6, -0.5])) * motion


def _cost(gaps: Array, cap_m: float) -> float:
    """Return the mean deviation, capped: whole for points in front of what was seen, half for hidden ones."""
    deviation = np.where(np.abs(gaps) < cap_m, np.abs(gaps), np.where(gaps < 0.0, cap_m, 0.5 * cap_m))
    return float(deviation.mean())


def _ahead(gaps: Array, cap_m: float) -> float:
    """Return the share of points with known depth that lie in front of what was seen."""
    known = np.isfinite(gaps)
    return float((gaps[known] < -cap_m).mean()) if known.any() else 1.0
