"""Faults on demand, the format `fault/1`.

::

    {"format": "fault/1", "faults": [
      {"kind": "lose-target", "target": "T2", "at_s": 900},
      {"kind": "slow-drive", "amount": 2.0, "task": "drive-3"}]}

A fault strikes at a time of the plan clock (`at_s`) or when the command of a task arrives (`task`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from enum import StrEnum
from pathlib import Path

from mission.codec import Codec
from mission.errors import MissionError
from mission.values import NotNegative, value
from rover_iface.errors import WorldError


class FaultKind(StrEnum):
    """What goes wrong; `amount` and `target` mean what is said here.

    `LOSE_TARGET`: the tracker of `target` loses it. `SHADOW`: light on `target` changes suddenly.
    `SLOW_DRIVE`: drives take `amount` times as long from now on. `SLIP_BURST`: as that, by wheel slip.
    `STUCK_WHEEL`: drives fail from now on. `LOW_BATTERY`: only `amount` joules are left.
    `CAMERA_FAILURE`: no image succeeds from now on. `SILENT`: commands never answer until aborted.
    `NOVELTY`: the cameras see something of interest `amount`. `LENS_DUST`: grains on the right hazard
    camera's lens lie before `target` (the `full` rover's stereo; others have no pictures of it).
    """

    LOSE_TARGET = "lose-target"
    SHADOW = "shadow"
    SLOW_DRIVE = "slow-drive"
    SLIP_BURST = "slip-burst"
    STUCK_WHEEL = "stuck-wheel"
    LOW_BATTERY = "low-battery"
    CAMERA_FAILURE = "camera-failure"
    SILENT = "silent"
    NOVELTY = "novelty"
    LENS_DUST = "lens-dust"


_NEEDS_TARGET = {FaultKind.LOSE_TARGET, FaultKind.SHADOW, FaultKind.LENS_DUST}
_FACTORS = {FaultKind.SLOW_DRIVE, FaultKind.SLIP_BURST}
_NEEDS_AMOUNT = _FACTORS | {FaultKind.LOW_BATTERY, FaultKind.NOVELTY}


@value
class Fault:
    """One fault: when (`at_s` or `task`, exactly one) and what; `amount` is None where its kind has none."""

    kind: FaultKind
    at_s: NotNegative | None = None
    task: str = ""
    target: str = ""
    amount: NotNegative | None = None

    def __post_init__(self) -> None:
        if (self.at_s is None) == (not self.task):
            raise MissionError(f'fault "{self.kind}": exactly one of "at_s" and "task" is needed')
        if self.kind in _NEEDS_TARGET and not self.target:
            raise MissionError(f'fault "{self.kind}": "target" is missing')
        if self.kind in _NEEDS_AMOUNT and self.amount is None:
            raise MissionError(f'fault "{self.kind}": "amount" is missing')
        if self.kind in _FACTORS and self.strength < 1:
            raise MissionError(
                f'fault "{self.kind}": "amount" is {self.amount}; a factor of at least 1 is needed'
            )

    @property
    def strength(self) -> float:
        """Return the amount; 0 where there is none."""
        return self.amount or 0.0


@value
class Faults:
    """What a `fault/1` document holds."""

    faults: tuple[Fault, ...] = ()


FAULTS = Codec(Faults, "fault/1", "faults", error=WorldError)


def load_faults(
    source: Path | str | Mapping[str, object] | Sequence[Mapping[str, object]],
) -> tuple[Fault, ...]:
    """Return faults from a `fault/1` file or document, or from a list of what it holds.

    Raises
    ------
    WorldError
        If the file cannot be read or a fault is malformed; `members` is the way to what is wrong.
    """
    if isinstance(source, Path | str):
        return FAULTS.read_file(Path(source)).faults
    document = source if isinstance(source, Mapping) else {"format": FAULTS.format, "faults": list(source)}
    return FAULTS.from_document(document).faults
