"""A rover on terrain: a body, its power, and the behaviour that carries out its commands through hardware."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path

from executive.ports import Command
from rover_iface.behaviour.action import Action, Outcome, Step, number
from rover_iface.behaviour.repertoire import MakeRepertoire
from rover_iface.simulator.body import Body
from rover_iface.simulator.engine import milliseconds
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.faulty_hardware import FaultyHardware
from rover_iface.simulator.routine import RoutineRover
from rover_iface.simulator.truth import Truth


class TerrainRover(RoutineRover):
    """A simulated rover with a body on true ground.

    `repertoire` is its behaviour, over `hardware`, which faults may strike; `truth` scores what it does.
    """

    def __init__(
        self,
        body: Body,
        make: MakeRepertoire,
        *,
        out: Path | None = None,
        faults: Sequence[Fault] = (),
        progress_s: float = 0.0,
        battery_j: float | None = None,
        tracker: str = "",
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
        self._solar_to_s = 0.0
        self.set("novelty", 0.0)
        self.set("heartbeat", 0.0)
        self.truth = Truth(body)
        self.hardware = FaultyHardware(self, body, self.truth)
        self.repertoire = make(self.hardware, body.targets, tracker)
        self.hardware.tell_pose()
        self.report()

    def act(self, command: Command) -> Action:
        """Return the generator of an action."""
        if command.action == "recharge":
            return self._rest(command)
        action = self.repertoire.act(command)
        if action is None:
            return self.routine(command)
        placed = self.profile.usual_action(command.action, command.parameters) == "ipplaceinstrument"
        return self._scored(command, action) if placed else action

    def _scored(self, command: Command, action: Action) -> Action:
        """Carry out a placement; its result tells how far off it was, which only a simulation can."""
        target = str(command.parameters["target"])
        self.truth.touched.pop(target, None)
        outcome = yield from action
        return Outcome(outcome.success, outcome.reason, self.truth.scored(target, outcome.values))

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

    def apply_fault(self, fault: Fault) -> None:
        """Bring a fault into effect now; a burst of slip is the soil's here."""
        if fault.kind is FaultKind.SLIP_BURST:
            self.body.chassis.extra_slip = 1.0 - 1.0 / fault.strength
        elif not self.hardware.strike(fault):
            super().apply_fault(fault)
