"""The body that drives: where it truly is, where it believes to be, what it uses, what it hits."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from rover_iface.frames import Pose, wrap_angle
from rover_iface.mobility import Ground, settle
from rover_iface.navigation.navigator import Way
from rover_iface.profile import RoverProfile
from rover_iface.simulator.world import Soil

Array = NDArray[np.floating]

INCREMENT_M = 0.08


@dataclass(frozen=True, slots=True)
class Driven:
    """What one way came to: times and energy, how far truly, and what the body touched.

    `collision` is empty, or `belly` (the ground touches the body), `wheel` (a wheel meets what it cannot
    climb), `tilt` (about to tip) or `edge` (off the known ground).
    """

    duration_s: float
    energy_j: float
    true_m: float
    collision: str
    stuck: bool
    worst_gap_m: float
    track: tuple[tuple[float, float], ...]


class Chassis:
    """A rover on true ground.

    `pose` is the truth, `believed` the dead reckoning: the believed way is the commanded one less the slip
    expected on flat ground; the true way has the slip of its slope, a scale error per way of
    `mobility.odometry_error` (one
    standard deviation) and a drift of heading. Attitude comes from the inertial sensor with 0.2 degrees of
    error.
    """

    def __init__(
        self,
        ground: Ground,
        profile: RoverProfile,
        pose: Pose,
        *,
        soil: Soil | None = None,
        softer: float = 1.0,
        rng: np.random.Generator,
    ) -> None:
        self.ground = ground
        self.profile = profile
        self.soil = soil or Soil()
        self.softer = softer
        self.rng = rng
        self.extra_slip = 0.0
        self.pose = self._settled(pose.x, pose.y, pose.heading)
        self.believed = Pose(pose.x, pose.y, self.pose.z, pose.heading, self.pose.pitch, self.pose.roll)
        self.travelled_m = 0.0

    def _settled(self, x: float, y: float, heading: float) -> Pose:
        standing = settle(self.ground, self.profile, np.array([x]), np.array([y]), np.array([heading]))
        return Pose(
            x, y, float(standing.z[0]), wrap_angle(heading), float(standing.pitch[0]), float(standing.roll[0])
        )

    def slip(self, climb_rad: float) -> float:
        """Return the share of the wheels' path that is lost uphill (negative downhill: it slides ahead)."""
        slip = (
            self.softer * (self.soil.slip_flat + self.soil.slip_per_slope * math.sin(climb_rad))
            + self.extra_slip
        )
        return min(0.95, max(-0.3, slip))

    def follow(self, way: Way) -> Driven:
        """Drive a way to its end or to a collision, and return what it came to."""
        mobility, power = self.profile.mobility, self.profile.power
        duration = abs(way.turn_rad) / mobility.turn_rate_rad_s
        energy = power.turn_w * duration
        scale = 1.0 + mobility.odometry_error * float(self.rng.standard_normal())
        turned = way.turn_rad * (1.0 + 0.02 * float(self.rng.standard_normal()))
        x, y, heading = self.pose.x, self.pose.y, self.pose.heading + turned
        bx, by, bz = self.believed.x, self.believed.y, self.believed.z
        # The gyroscope measures the turn far better than the wheels make it.
        bheading = self.believed.heading + turned + 0.002 * float(self.rng.standard_normal())
        count = max(1, math.ceil(abs(way.length_m) / INCREMENT_M))
        ds = way.length_m / count
        track = [(x, y)]
        worst_gap = math.inf
        collision = ""
        true_length = 0.0
        pitch, roll, z = self.pose.pitch, self.pose.roll, self.pose.z
        if way.turn_rad:
            sweep = self.pose.heading + turned * np.linspace(0.0, 1.0, max(2, math.ceil(abs(turned) / 0.15)))
            standing = settle(
                self.ground, self.profile, np.full_like(sweep, x), np.full_like(sweep, y), sweep
            )
            collision = self._hits(standing.belly_gap, standing.step, standing.tilt)
            worst_gap = float(np.min(standing.belly_gap))
        for _ in range(count):
            if collision:
                break
            before = (x, y, heading, bx, by, bheading, pitch, roll, z)
            climb = -pitch if ds > 0 else pitch
            advance = ds * (1.0 - self.slip(climb)) * scale
            sideways = -self.softer * 0.25 * self.soil.slip_per_slope * math.sin(roll) * abs(ds)
            drift = mobility.heading_drift_rad_m * math.sqrt(abs(ds)) * float(self.rng.standard_normal())
            bend = way.curvature_1_m * ds
            heading += bend / 2 + drift
            x += advance * math.cos(heading) - sideways * math.sin(heading)
            y += advance * math.sin(heading) + sideways * math.cos(heading)
            heading += bend / 2
            bheading += bend / 2
            expected = ds * (1.0 - self.soil.slip_flat)
            bx += expected * math.cos(bheading)
            by += expected * math.sin(bheading)
            bheading += bend / 2 + 0.3 * drift
            standing = settle(self.ground, self.profile, np.array([x]), np.array([y]), np.array([heading]))
            pitch, roll, z = float(standing.pitch[0]), float(standing.roll[0]), float(standing.z[0])
            if math.isnan(z):
                # nothing is known of the ground there: it stands where it still was
                x, y, heading, bx, by, bheading, pitch, roll, z = before
                collision = "edge"
                break
            # The height is reckoned from the attitude on the way, which the inertial sensor gives.
            bz -= expected * math.sin((pitch + before[6]) / 2)
            worst_gap = min(worst_gap, float(standing.belly_gap[0]))
            collision = self._hits(standing.belly_gap, standing.step, standing.tilt)
            true_length += abs(advance)
            track.append((x, y))
            moving = abs(ds) / mobility.speed_m_s
            duration += moving
            energy += power.drive_w * moving * (1.0 + 2.0 * max(0.0, math.sin(climb)))
        self.pose = Pose(x, y, z, wrap_angle(heading), pitch, roll)
        noise = 0.0035 * self.rng.standard_normal(2)
        self.believed = Pose(
            bx,
            by,
            bz,
            wrap_angle(bheading),
            pitch + float(noise[0]),
            roll + float(noise[1]),
        )
        self.travelled_m += true_length
        stuck = abs(way.length_m) > 0.05 and true_length < 0.2 * abs(way.length_m) and not collision
        return Driven(
            duration,
            energy,
            true_length,
            collision,
            stuck,
            worst_gap,
            tuple(track),
        )

    def _hits(self, gap: Array, step: Array, tilt: Array) -> str:
        """Return what the rover hits in any of the poses, if anything."""
        if bool((gap < 0.0).any()):
            return "belly"
        if bool((step > 2.0 * self.profile.wheels.radius_m).any()):
            return "wheel"
        return "tilt" if bool((tilt > 1.2 * self.profile.mobility.max_tilt_rad).any()) else ""
