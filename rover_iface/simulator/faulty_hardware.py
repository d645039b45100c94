"""Faults on demand between behaviour and hardware: pictures, wheels and telemetry go wrong, nothing else."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from executive.ports import Value
from mission.instrument import Instrument
from rover_iface.behaviour.action import Doing, Step
from rover_iface.behaviour.hardware import Drive, Look, Picture, TrackReport
from rover_iface.navigation.navigator import Way
from rover_iface.simulator.body import Body
from rover_iface.simulator.engine import milliseconds
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.hardware import SimulatedHardware
from rover_iface.simulator.routine import RoutineRover
from rover_iface.simulator.truth import Truth
from rover_iface.telemetry import TrackState

GRAINS, DUST_M, GRAIN_PX, GRAIN_GREY = 60, (0.012, 0.065), (4, 6), (0.4, 1.6)
"""Grains of a dusty lens, what they hide (distance from the target, at its range), radius, and brightness.

Each is as bright as that share of the picture's mean: grains of one grey are matched as if they were rock.
"""

GONE = 0.1
"""Most confidence in a target that is lost for good."""

STUCK_S = 20.0
"""How long a rover with a stuck wheel tries to drive."""


class FaultyHardware(SimulatedHardware):
    """See `Hardware`. A fault strikes what passes between behaviour and a simulated rover from then on."""

    def __init__(self, host: RoutineRover, body: Body, truth: Truth) -> None:
        super().__init__(host, body, truth)
        self._gone: set[str] = set()
        self._shaded: set[str] = set()
        self._dusty: set[str] = set()
        self._stuck = False
        self._slow_factor = 1.0
        self._blind = False

    def strike(self, fault: Fault) -> bool:
        """Bring a fault into effect; False if it is not one of hardware."""
        match fault.kind:
            case FaultKind.LOSE_TARGET:
                self._hide(fault.target)
            case FaultKind.SHADOW:
                if self._followed(fault.target):
                    self._shaded.add(fault.target)
                self.report()
            case FaultKind.LENS_DUST:
                if fault.target in self.body.targets:
                    self._dusty.add(fault.target)
            case FaultKind.STUCK_WHEEL:
                self._stuck = True
            case FaultKind.SLOW_DRIVE:
                self._slow_factor = fault.strength
            case FaultKind.CAMERA_FAILURE:
                self._blind = True
            case _:
                return False
        return True

    def _followed(self, target: str) -> bool:
        return self.get(f"trackerstate {target}") not in (None, TrackState.IDLE.value)

    def _hide(self, target: str) -> None:
        """Let a tracker lose its target: what it gets to see of it is noise until it is stopped."""
        if self._followed(target):
            self._gone.add(target)
            self.set(f"trackerstate {target}", TrackState.LOST.value)
            self.set(f"trackerconfidence {target}", GONE)
        self.report()

    @property
    def cameras_work(self) -> bool:
        return not self._blind and super().cameras_work

    def set(self, key: str, value: Value) -> None:
        target = key.removeprefix("trackerstate ")
        if target != key:
            if value == TrackState.IDLE.value:
                self._gone.discard(target)
                self._shaded.discard(target)
            elif value == TrackState.TRACKED.value and target in self._gone:
                value = TrackState.LOST.value  # what is lost for good does not coast either
        elif key.removeprefix("trackerconfidence ") in self._gone:
            value = min(GONE, float(value))
        super().set(key, value)

    def log_track(self, report: TrackReport) -> None:
        if report.target in self._gone and report.state == TrackState.TRACKED.value:
            report = replace(report, state=TrackState.LOST.value, confidence=min(GONE, report.confidence))
        super().log_track(report)

    def drive(self, way: Way) -> Doing[Drive]:
        if self._stuck:
            yield Step(milliseconds(STUCK_S), self.profile.power.drive_w * STUCK_S)
            return Drive(stuck=True)
        driving = super().drive(way)
        while True:
            try:
                step = next(driving)
            except StopIteration as stop:
                ended: Drive = stop.value
                return ended
            if self._slow_factor == 1.0:
                yield step
            else:
                slow = self._slow_factor
                yield Step(round(slow * step.duration_ms), slow * step.energy_j, step.route)

    def look(self, look: Look) -> Sequence[Picture]:
        first, *others = super().look(look)
        if look.track in self._gone or (self._blind and look.track):
            noise = self.body.rng.random(first.unit.shape).astype(np.float32)
            first = replace(first, read=lambda: noise)
        elif look.track in self._shaded:
            shade = np.linspace(0.15, 1.6, first.unit.shape[1], dtype=np.float32)[None, :] ** 2
            shaded = np.clip(first.unit * shade, 0, 1)
            first = replace(first, read=lambda: shaded)
        if self._dusty and others and self.rig.mounted(look.cameras[1]).mount == "body":
            dusted = self._dusted(others[0])
            others[0] = replace(others[0], read=lambda: dusted)
        return [first, *others]

    def _dusted(self, picture: Picture) -> npt.NDArray[np.float32]:
        """Return a picture with grains scattered before the dusty targets."""
        import cv2

        body, camera = self.body, self.truth.camera(picture.number)
        image = picture.unit.copy()
        for name in sorted(self._dusty):
            point = np.array(body.targets[name].point)
            pixel = camera.project(point)
            if not np.isfinite(pixel).all():
                continue
            scale = camera.hs / float(np.linalg.norm(point - camera.C))
            rng = np.random.default_rng([body.seed, *name.encode()])
            for _ in range(GRAINS):
                away, turn = scale * rng.uniform(*DUST_M), rng.uniform(0.0, math.tau)
                place = pixel + away * np.array((math.cos(turn), math.sin(turn)))
                middle = (round(float(place[0])), round(float(place[1])))
                grey = min(1.0, float(rng.uniform(*GRAIN_GREY) * picture.unit.mean()))
                cv2.circle(image, middle, int(rng.integers(*GRAIN_PX)), grey, -1)
        return image

    def instrument_delivers(self, instrument: Instrument) -> bool:
        return super().instrument_delivers(instrument) and self.cameras_work
