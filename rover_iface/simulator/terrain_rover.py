"""A rover on terrain: a body, its power and telemetry, and the parts that carry out its commands.

What rovers on terrain differ in is passed in as `Parts`: what the navigator sees the ground with (`Sight`),
what the tracker sees with (`Eyes`, by default the mast cameras) and which `Tracker` it is, how a target is
handed to the hazard cameras (`Handoff`) and where the tool may touch (`Placement`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from executive.ports import Command
from rover_iface.simulator.body import Body
from rover_iface.simulator.driving import Driving, Sight
from rover_iface.simulator.engine import Action, Outcome, Step, milliseconds, number
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.following import Eyes, TargetFollower
from rover_iface.simulator.imaging import Imaging
from rover_iface.simulator.mast_cameras import MastCameras
from rover_iface.simulator.placing import Handoff, Placement, Placing
from rover_iface.simulator.routine import RoutineRover
from rover_iface.vision.tracker import Tracker


@dataclass(frozen=True, eq=False)
class Parts:
    """What a rover on terrain is put together from; all of them look at the same body.

    `cadence` is that of `TargetFollower`.
    """

    cameras: MastCameras
    sight: Sight
    tracker: Tracker
    handoff: Handoff
    placement: Placement
    eyes: Eyes | None = None
    cadence: float = 0.0


class TerrainRover(RoutineRover):
    """A simulated rover with a body on true ground.

    `follower.history` holds every answer of the tracker, `body.odometry` true and believed poses.
    """

    def __init__(
        self,
        body: Body,
        parts: Parts,
        *,
        out: Path | None = None,
        faults: Sequence[Fault] = (),
        progress_s: float = 0.0,
        battery_j: float | None = None,
    ) -> None:
        profile = body.profile
        super().__init__(
            hotel_w=profile.power.hotel_w,
            battery_j=profile.power.initial_j if battery_j is None else battery_j,
            pose=body.world.start,
            out=out,
            progress_s=progress_s,
            faults=faults,
            profile=profile,
            seed=body.seed,
        )
        self.body = body
        self.parts = parts
        self._solar_to_s = 0.0
        self.set("novelty", 0.0)
        self.set("heartbeat", 0.0)
        self.follower = TargetFollower(
            self, body, parts.eyes or parts.cameras, parts.tracker, cadence=parts.cadence
        )
        self.driving = Driving(self, body, parts.sight, self.follower)
        self.imaging = Imaging(self, body, parts.cameras, self.follower)
        self.placing = Placing(self, body, parts.cameras, self.follower, parts.handoff, parts.placement)
        self.driving.tell_pose()
        self.report()

    def act(self, command: Command) -> Action:
        """Return the generator of an action."""
        match command.action:
            case "navigate":
                return self.driving.navigate(command)
            case "turn":
                return self.driving.turn(command)
            case "trackstart":
                return self.follower.start(command)
            case "trackstop":
                return self.follower.stop(command)
            case "ipplaceinstrument":
                return self.placing.place(command)
            case "handoff":
                return self.placing.hand_off(command)
            case "image":
                return self.imaging.image(command)
            case "imagepanorama":
                return self.imaging.panorama(command)
            case "pointmast":
                return self.imaging.point_mast(command)
            case "recharge":
                return self._rest(command)
            case _:
                return self.routine(command)

    # ---- power

    def refresh(self) -> None:
        """Bring battery, sun and heartbeat up to date; the panels charge as the sun stands."""
        now = self.t_s
        elevation_rad = self.body.sun_clock.elevation_rad
        if now > self._solar_to_s:
            power = self.body.profile.power
            light = max(0.0, math.sin(elevation_rad((now + self._solar_to_s) / 2)))
            gained = power.solar_peak_w * light * (now - self._solar_to_s)
            self.charged_j += max(0.0, min(gained, power.battery_j - self.battery_j))
            self._solar_to_s = now
        self.set("sun-elevation", elevation_rad(now))
        self.set("heartbeat", now)
        super().refresh()

    def _rest(self, command: Command) -> Action:
        """Sit in the sun; the panels charge all the time, so there is nothing to add but waiting."""
        duration, _ = self.spread("recharge")
        left = number(command, "duration_s", duration / 1000.0)
        until = number(command, "until_j", math.inf)
        before = self.charged_j
        while left > 0 and self.battery_j < until:
            part = min(60.0, left)
            yield Step(milliseconds(part))
            self.refresh()
            left -= part
        return Outcome(True, values={"charged_j": self.charged_j - before})

    # ---- faults

    def lose_target(self, target: str, confidence: float = 0.1) -> None:
        """Hide a target from the tracker, by a fault."""
        self.follower.lose(target, confidence)

    def apply_fault(self, fault: Fault) -> None:
        """Bring a fault into effect now; a burst of slip is the soil's here."""
        if fault.kind is FaultKind.SLIP_BURST:
            self.body.chassis.extra_slip = 1.0 - 1.0 / fault.amount
        else:
            super().apply_fault(fault)
