"""Hardware that passes everything on to other hardware: what stands between them overrides a part."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from executive.ports import Command, Value
from mission.instrument import Instrument
from rover_iface.behaviour.action import Doing
from rover_iface.behaviour.hardware import (
    CloseUp,
    Cloud,
    Contact,
    Drive,
    Hardware,
    Look,
    Picture,
    ProductFile,
    TrackReport,
)
from rover_iface.cameras.model import Array
from rover_iface.frames import Pose
from rover_iface.navigation.navigator import Way
from rover_iface.placement.arm_motion import Motion
from rover_iface.profile import RoverProfile


class WrappedHardware:
    """See `Hardware`; every member is that of `inner`."""

    def __init__(self, inner: Hardware) -> None:
        self.inner = inner

    @property
    def profile(self) -> RoverProfile:
        return self.inner.profile

    @property
    def t_s(self) -> float:
        return self.inner.t_s

    @property
    def drawn_j(self) -> float:
        return self.inner.drawn_j

    @property
    def believed(self) -> Pose:
        return self.inner.believed

    @property
    def travelled_m(self) -> float:
        return self.inner.travelled_m

    @property
    def cameras_work(self) -> bool:
        return self.inner.cameras_work

    @property
    def keeps_products(self) -> bool:
        return self.inner.keeps_products

    def spend(self, activity: str, share: float = 1.0) -> Doing[float]:
        return self.inner.spend(activity, share)

    def operate(self, instrument: Instrument, dwell_s: float = 0.0) -> Doing[float]:
        return self.inner.operate(instrument, dwell_s)

    def get(self, key: str) -> Value | None:
        return self.inner.get(key)

    def set(self, key: str, value: Value) -> None:
        self.inner.set(key, value)

    def report(self) -> None:
        self.inner.report()

    def log_track(self, report: TrackReport) -> None:
        self.inner.log_track(report)

    def write_log(self, command: Command, kind: str) -> int:
        return self.inner.write_log(command, kind)

    def write_product(
        self,
        command: Command,
        kind: str,
        data: bytes,
        suffix: str,
        label: Mapping[str, object],
        *,
        picture: int | None = None,
    ) -> int:
        return self.inner.write_product(command, kind, data, suffix, label, picture=picture)

    def write_folder(self, command: Command, kind: str, files: Sequence[ProductFile]) -> int:
        return self.inner.write_folder(command, kind, files)

    def drive(self, way: Way) -> Doing[Drive]:
        return self.inner.drive(way)

    def look(self, look: Look) -> Sequence[Picture]:
        return self.inner.look(look)

    def scan(self, *, around: bool) -> list[Cloud]:
        return self.inner.scan(around=around)

    def reach(self, target: str, point: Array, instrument: str) -> Contact:
        return self.inner.reach(target, point, instrument)

    def move_arm(self, target: str, motion: Motion) -> Doing[Contact]:
        return self.inner.move_arm(target, motion)

    def take_close_up(self, camera: str) -> CloseUp:
        return self.inner.take_close_up(camera)

    def instrument_delivers(self, instrument: Instrument) -> bool:
        return self.inner.instrument_delivers(instrument)
