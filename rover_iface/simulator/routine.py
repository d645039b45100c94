"""What every simulated rover does alike: waiting, warming, charging, sending, by the times of its profile."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from executive.crl.dictionary import CommandDictionary
from executive.ports import Command
from mission.instrument import Instrument
from rover_iface.behaviour.action import Action, Outcome, Step, number
from rover_iface.profile import Activity, RoverProfile, load_profile
from rover_iface.simulator.engine import SimulatedRover, milliseconds


class RoutineRover(SimulatedRover):
    """A simulated rover with a profile (K9 unless told otherwise) and one seed for all it draws."""

    def __init__(self, *, profile: RoverProfile | None = None, seed: int = 0, **options: Any) -> None:
        super().__init__(**options)
        self._profile = profile
        self._seed = seed

    def routine(self, command: Command) -> Action:
        """Return the generator of an action that needs nothing but time and energy."""
        match command.action:
            case "wait":
                return self._plain(milliseconds(number(command, "duration_s", 0.0)), 0.0)
            case "recharge":
                return self._recharge(command)
            case "heat":
                return self._timed(command, "heat", self.profile.power.heater_w)
            case "downlink":
                return self._timed(command, "downlink", self.profile.power.downlink_w)
            case _:
                return self._plain(*self.spread(command.action))

    @property
    def commands(self) -> CommandDictionary:
        """Return the actions of the rover's own dictionary."""
        return self.profile.language.commands

    @property
    def profile(self) -> RoverProfile:
        """Return the rover profile; K9 unless told otherwise."""
        if self._profile is None:
            self._profile = load_profile("k9")
        return self._profile

    def spread(self, name: str, scale: float = 1.0) -> tuple[int, float]:
        """Return time in ms and energy of an activity outside the problem, drawn by its name and the
        clock.
        """
        activity: Activity = self.profile.activity(name)
        time, energy = activity.time_s(), activity.energy_j()
        factor = [1.0, 1.0]
        if activity.cv or activity.energy_cv:
            rng = np.random.default_rng([self._seed, self._now, *name.encode()])
            for k, cv in enumerate((activity.cv, activity.energy_cv)):
                spread = math.sqrt(math.log1p(cv * cv))
                factor[k] = math.exp(spread * float(rng.standard_normal()) - spread**2 / 2)
        return milliseconds(time.mean * factor[0] * scale), energy.mean * factor[1] * scale

    def drawn(self, instrument: Instrument, rng: np.random.Generator) -> tuple[int, float]:
        """Return a time in ms, log-normal by the instrument's mean and spread, and energy in proportion."""
        mean_s, sd_s = instrument.time_s.mean, instrument.time_s.sd
        spread = math.sqrt(math.log1p((sd_s / mean_s) ** 2)) if mean_s > 0 else 0.0
        factor = math.exp(spread * float(rng.standard_normal()) - spread**2 / 2)
        return milliseconds(mean_s * factor), instrument.energy_j.mean * factor

    def _plain(self, duration_ms: int, energy_j: float) -> Action:
        if duration_ms or energy_j:
            yield Step(duration_ms, energy_j)
        return Outcome(True)

    def _timed(self, command: Command, name: str, power_w: float) -> Action:
        duration, energy = self.spread(name)
        if "duration_s" in command.parameters:
            seconds = number(command, "duration_s", 0.0)
            duration, energy = milliseconds(seconds), power_w * seconds
        yield Step(duration, energy)
        return Outcome(True, values={"energy_j": energy})

    def _recharge(self, command: Command) -> Action:
        duration, _ = self.spread("recharge")
        seconds = number(command, "duration_s", duration / 1000.0)
        power = max(self.profile.power.solar_peak_w - self.hotel_w, 1e-9)
        room = max(0.0, number(command, "until_j", self.initial_j) - self.battery_j)
        seconds = min(seconds, room / power)
        yield Step(milliseconds(seconds))
        gained = power * seconds + self.hotel_w * seconds
        self.charged_j += gained
        return Outcome(True, values={"charged_j": gained})
