"""Faults on demand, the format `fault/1`.

::

    {"format": "fault/1", "faults": [
      {"kind": "lose-target", "target": "T2", "at_s": 900},
      {"kind": "slow-drive", "amount": 2.0, "task": "drive-3"}]}

A fault strikes at a time of the plan clock (`at_s`) or when the command of a task arrives (`task`).
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from rover_iface.errors import WorldError

FORMAT = "fault/1"


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
_NEEDS_AMOUNT = {FaultKind.SLOW_DRIVE, FaultKind.SLIP_BURST, FaultKind.LOW_BATTERY, FaultKind.NOVELTY}


@dataclass(frozen=True, slots=True)
class Fault:
    """One fault: when (`at_s` or `task`, exactly one) and what."""

    kind: FaultKind
    at_s: float | None = None
    task: str = ""
    target: str = ""
    amount: float = 0.0

    def __post_init__(self) -> None:
        if (self.at_s is None) == (not self.task):
            raise WorldError(f'fault "{self.kind}": exactly one of "at_s" and "task" is needed')
        if self.at_s is not None and not (math.isfinite(self.at_s) and self.at_s >= 0):
            raise WorldError(f'fault "{self.kind}": "at_s" is {self.at_s}; it must be at least 0')
        if self.kind in _NEEDS_TARGET and not self.target:
            raise WorldError(f'fault "{self.kind}": "target" is missing')
        if self.kind in (FaultKind.SLOW_DRIVE, FaultKind.SLIP_BURST) and not self.amount >= 1:
            raise WorldError(
                f'fault "{self.kind}": "amount" is {self.amount}; a factor of at least 1 is needed'
            )
        if not (math.isfinite(self.amount) and self.amount >= 0):
            raise WorldError(f'fault "{self.kind}": "amount" is {self.amount}; it must be at least 0')

    @staticmethod
    def from_dict(document: object) -> Fault:
        """Return a fault from its JSON form.

        Raises
        ------
        WorldError
            If a member is missing, unknown or out of range.
        """
        if not isinstance(document, Mapping):
            raise WorldError(f"a fault must be an object, found {document!r:.60}")
        unknown = set(document) - {"kind", "at_s", "task", "target", "amount"}
        if unknown:
            raise WorldError(f'fault: unknown member "{sorted(unknown)[0]}"')
        try:
            kind = FaultKind(str(document.get("kind")))
        except ValueError:
            known = ", ".join(k.value for k in FaultKind)
            raise WorldError(f'fault: unknown kind "{document.get("kind")}"; known are {known}') from None
        if kind in _NEEDS_AMOUNT and "amount" not in document:
            raise WorldError(f'fault "{kind}": "amount" is missing')
        at_s = document.get("at_s")
        amount = document.get("amount", 0.0)
        for name, value in (("at_s", at_s), ("amount", amount)):
            if value is not None and (isinstance(value, bool) or not isinstance(value, int | float)):
                raise WorldError(f'fault "{kind}": "{name}" must be a number, found {value!r}')
        return Fault(
            kind,
            None if at_s is None else float(at_s),
            str(document.get("task", "")),
            str(document.get("target", "")),
            float(amount),
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        document: dict[str, Any] = {"kind": self.kind.value}
        if self.at_s is not None:
            document["at_s"] = self.at_s
        else:
            document["task"] = self.task
        if self.target:
            document["target"] = self.target
        if self.amount:
            document["amount"] = self.amount
        return document


def load_faults(source: Path | str | Mapping[str, Any] | Iterable[Any]) -> tuple[Fault, ...]:
    """Return faults from a `fault/1` file or document, or from a list of faults.

    Raises
    ------
    WorldError
        If the file cannot be read or a fault is malformed.
    """
    if isinstance(source, Path | str):
        try:
            source = json.loads(Path(source).read_text(encoding="utf-8"))
        except (OSError, ValueError) as err:
            raise WorldError(f"faults {source}: {err}") from err
    if isinstance(source, Mapping):
        if source.get("format") != FORMAT:
            raise WorldError(f'faults: "format" is {source.get("format")!r}; "{FORMAT}" is needed')
        source = source.get("faults", ())
    if not isinstance(source, Iterable):
        raise WorldError(f"faults must be a list, found {source!r:.60}")
    return tuple(item if isinstance(item, Fault) else Fault.from_dict(item) for item in source)
