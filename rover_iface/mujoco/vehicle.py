"""The rover's body in MuJoCo: it takes a speed and a turn rate, and tells what came of it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation

from rover_iface.errors import WorldError
from rover_iface.frames import Pose, wrap_angle
from rover_iface.mujoco.engine import import_mujoco
from rover_iface.mujoco.model import HeightField, make_model, middle_of, torque_limit_nm, wheel_places
from rover_iface.mujoco.options import VehicleOptions
from rover_iface.profile import RoverProfile

STEERED = (0, 2, 3, 5)
"""Wheels that steer: front and rear ones."""

ALIGNED_RAD = 0.15
"""The wheels turn once all of them point so nearly where they should."""

DROP_M, SETTLE_S = 0.01, 1.5
"""The rover is let down from so far above the ground, and has come to rest after so long."""


@dataclass(frozen=True, slots=True)
class Moved:
    """What a while of driving came to: joules at the motors' axles, metres of the wheels' rims (mean of six),
    and metres that were commanded (0 while the wheels were steered).
    """

    work_j: float
    wheels_m: float
    commanded_m: float


class Vehicle:
    """A rover's body on a height field. Positions are of the site frame, `pose` that of the rover's origin.

    Raises
    ------
    WorldError
        If the ground at the start is unknown.
    """

    def __init__(
        self, profile: RoverProfile, field: HeightField, start: Pose, friction: float, options: VehicleOptions
    ) -> None:
        if not field.knows(start.x, start.y):
            raise WorldError(f"the ground at the start ({start.x:.2f}, {start.y:.2f}) is unknown")
        self.profile, self.field, self.options = profile, field, options
        self.friction = friction
        self.torque_limit_nm = torque_limit_nm(profile, options)
        self._mujoco = import_mujoco()
        self.model: Any = make_model(profile, field, friction, options)
        self.data: Any = self._mujoco.MjData(self.model)
        self._middle = middle_of(field)
        self._places = wheel_places(profile)
        joint = self.model.joint
        self._spin = np.array([joint(f"wheel_{k}").dofadr[0] for k in range(6)])
        self._angle = np.array([joint(f"wheel_{k}").qposadr[0] for k in range(6)])
        self._steer = np.array([joint(f"steer_{k}").qposadr[0] for k in STEERED])
        self._drives = np.array([self.model.actuator(f"wheel_{k}").id for k in range(6)])
        self._steers = np.array([self.model.actuator(f"steer_{k}").id for k in STEERED])
        self._rims = np.array([self.model.geom(f"wheel_{k}").id for k in range(6)])
        self._commanded_m_s = 0.0
        self._stand(start)
        self.advance(SETTLE_S)

    def _stand(self, start: Pose) -> None:
        """Put the rover on the plane through the ground under its wheels, lifted to its highest wheel."""
        turn = Rotation.from_euler("z", start.heading)
        under = turn.apply(np.column_stack([self._places, np.zeros(6)]))
        heights = np.array([self.field.height(start.x + x, start.y + y) for x, y, _ in under])
        basis = np.column_stack([under[:, :2], np.ones(6)])
        east, north, level = np.linalg.lstsq(basis, heights, rcond=None)[0]
        up = np.array([-east, -north, 1.0]) / math.hypot(east, north, 1.0)
        forward = turn.apply([1.0, 0.0, 0.0])
        forward -= (forward @ up) * up
        forward /= np.linalg.norm(forward)
        attitude = Rotation.from_matrix(np.column_stack([forward, np.cross(up, forward), up]))
        lift = float((heights - basis @ (east, north, level)).max())
        self.data.qpos[:3] = (start.x - self._middle[0], start.y - self._middle[1], level + lift + DROP_M)
        self.data.qpos[3:7] = attitude.as_quat(scalar_first=True)

    # ---- where it is

    @property
    def pose(self) -> Pose:
        """Return the pose of the rover's origin."""
        w, x, y, z = (float(v) for v in self.data.qpos[3:7])
        heading = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
        pitch = math.asin(max(-1.0, min(1.0, 2 * (w * y - z * x))))
        roll = math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y))
        east, north, up = (float(v) for v in self.data.qpos[:3])
        return Pose(east + self._middle[0], north + self._middle[1], up, wrap_angle(heading), pitch, roll)

    @property
    def tilt_rad(self) -> float:
        """Return the angle between the rover's up and the vertical."""
        _, x, y, _ = (float(v) for v in self.data.qpos[3:7])
        return math.acos(max(-1.0, min(1.0, 1 - 2 * (x * x + y * y))))

    def unknown_ground(self) -> tuple[float, float] | None:
        """Return where a wheel stands on ground that is unknown, m, or None."""
        pose = self.pose
        c, s = math.cos(pose.heading), math.sin(pose.heading)
        for x, y in self._places:
            place = (pose.x + c * float(x) - s * float(y), pose.y + s * float(x) + c * float(y))
            if not self.field.knows(*place):
                return place
        return None

    # ---- driving

    def set_friction(self, friction: float) -> None:
        """Let the wheels have another grip on the ground from now on."""
        self.friction = friction
        self.model.geom_friction[self._rims, 0] = friction

    def command(self, speed_m_s: float, turn_rad_s: float) -> None:
        """Steer front and rear wheels along the circles of a motion, and let all wheels roll along them.

        While a wheel still points elsewhere all of them stand.
        """
        vx = speed_m_s - turn_rad_s * self._places[:, 1]
        vy = turn_rad_s * self._places[:, 0]
        angle = np.arctan2(vy, vx)
        back = np.abs(angle) > math.pi / 2
        angle = np.where(back, angle - np.copysign(math.pi, angle), angle)
        rim = np.where(back, -1.0, 1.0) * np.hypot(vx, vy)
        steered = np.array(STEERED)
        middle = np.setdiff1d(np.arange(6), steered)
        rim[middle] = vx[middle]
        if speed_m_s or turn_rad_s:
            self.data.ctrl[self._steers] = angle[steered]
            off = np.abs(self.data.qpos[self._steer] - angle[steered])
            if float(off.max()) > ALIGNED_RAD:
                rim = np.zeros(6)
        self.data.ctrl[self._drives] = rim / self.profile.wheels.radius_m
        self._commanded_m_s = float(np.abs(rim).mean())

    def advance(self, seconds: float) -> Moved:
        """Let time pass under the present command."""
        before = self.data.qpos[self._angle].copy()
        self._mujoco.mj_step(self.model, self.data, round(seconds / self.options.step_s))
        turned = self.data.qpos[self._angle] - before
        # The torque hardly changes within a tick; braking gives nothing back.
        work = float(np.maximum(self.data.actuator_force[self._drives] * turned, 0.0).sum())
        rims = float(np.abs(turned).mean()) * self.profile.wheels.radius_m
        return Moved(work, rims, self._commanded_m_s * seconds)

    # ---- going back

    def state(self) -> npt.NDArray[np.float64]:
        """Return all that the dynamics go on from."""
        kind = self._mujoco.mjtState.mjSTATE_INTEGRATION
        found = np.empty(self._mujoco.mj_stateSize(self.model, kind))
        self._mujoco.mj_getState(self.model, self.data, found, kind)
        return found

    def replay(
        self,
        state: npt.NDArray[np.float64],
        controls: Sequence[npt.NDArray[np.float64]],
        seconds: float,
        tick_s: float,
    ) -> None:
        """Go back to a state, and on from there for some seconds under controls of `tick_s` each.

        `state` [n] is what `state()` has returned; each control [actuators] is in the units of the model's
        actuators.
        """
        self._mujoco.mj_setState(self.model, self.data, state, self._mujoco.mjtState.mjSTATE_INTEGRATION)
        for control in controls:
            part = min(tick_s, seconds)
            if part < self.options.step_s:
                break
            self.data.ctrl[:] = control
            self._mujoco.mj_step(self.model, self.data, round(part / self.options.step_s))
            seconds -= part
        self._mujoco.mj_forward(self.model, self.data)
