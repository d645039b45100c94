"""Hand-off methods by name, as `handoff` commands them; packages announce theirs under `outcrop.handoffs`."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, cast

from mission.errors import PluginError
from mission.plugins import Registry
from rover_iface.cameras.model import Array
from rover_iface.errors import TrackerError
from rover_iface.vision.handoff import Handoff, hand_off
from rover_iface.vision.handoff_cascade import cascade

DEFAULT = "cascade"

HANDOFFS = Registry(
    "hand-off",
    "outcrop.handoffs",
    {
        "cascade": "rover_iface.vision.handoffs:by_cascade",
        "kinematic": "rover_iface.vision.handoffs:PURE_KINEMATIC",
        "alternate": "rover_iface.vision.handoffs:ALTERNATE_KINEMATIC",
        "refined": "rover_iface.vision.handoffs:REFINED_KINEMATIC",
        "geometric": "rover_iface.vision.handoffs:PURE_GEOMETRIC",
        "draped": "rover_iface.vision.handoffs:REFINED_GEOMETRIC",
        "registration": "rover_iface.vision.handoffs:REGISTRATION",
    },
)


@dataclass(frozen=True, eq=False)
class Found:
    """Where a target is in the left hazcam, pixel (2,) and position (3,), frame of the pairs.

    `error_px` is None for a method that does not know its error; `about` is what the rover tells of it.
    """

    pixel: Array
    position: Array
    score: float
    error_px: float | None
    about: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Refused:
    """Why a hand-off is not to be trusted, in words that end the sentence "hand-off of target T1 ..."."""

    why: str
    about: Mapping[str, object] = field(default_factory=dict)


class HandoffMethod(Protocol):
    """Finds the target of near navcams in the hazcams. Pure: the same pairs give the same answer."""

    def __call__(self, given: Handoff) -> Found | Refused: ...


def find_handoff(name: str) -> HandoffMethod:
    """Return a registered method; an empty name means the cascade.

    Raises
    ------
    TrackerError
        If there is none of that name, or it cannot be loaded; the message names what is known.
    """
    try:
        method = HANDOFFS.load(name or DEFAULT)
    except PluginError as err:
        raise TrackerError(str(err)) from err
    if not callable(method):
        raise TrackerError(f'hand-off "{name}" is {method!r}; a function is needed')
    return cast("HandoffMethod", method)


def by_cascade(given: Handoff) -> Found | Refused:
    """Hand off by the method that tests itself."""
    answer = cascade(given, "near")
    about: dict[str, object] = {
        "method": "cascade",
        "accepted": answer.accepted,
        "agreeing": answer.agreeing,
        "score": answer.score,
        "error_px": answer.error_px if answer.accepted else None,
        "reasons": list(answer.reasons),
    }
    if not answer.accepted:
        return Refused(f"refused: {'; '.join(answer.reasons)}", about)
    return Found(answer.pixel, answer.position, answer.score, answer.error_px, about)


@dataclass(frozen=True, slots=True)
class Published:
    """One of the published methods; none of them knows its error."""

    method: str

    def __call__(self, given: Handoff) -> Found | Refused:
        """See `HandoffMethod`."""
        found = hand_off(self.method, "near", given)
        match = None if found is None else given.hazcam.point(found.pixel)
        about: dict[str, object] = {"method": self.method, "accepted": match is not None}
        if found is None or match is None:
            return Refused(f"by the {self.method} method found nothing", about)
        return Found(found.pixel, match.point, found.score, None, about)


PURE_KINEMATIC = Published("pure kinematic")
ALTERNATE_KINEMATIC = Published("alternate kinematic")
REFINED_KINEMATIC = Published("refined kinematic")
PURE_GEOMETRIC = Published("pure geometric")
REFINED_GEOMETRIC = Published("refined geometric")
REGISTRATION = Published("registration")
