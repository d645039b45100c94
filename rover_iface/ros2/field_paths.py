"""Ways to a field of a ROS message: `pose.pose.position.x`, `ranges[0]`, `status[name=base motors].level`."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any

from rover_iface.errors import MappingError

_STEP = re.compile(r"\.?([A-Za-z][A-Za-z0-9_]*)|\[(\d{1,9})\]|\[([A-Za-z][A-Za-z0-9_]*)=([^\]]+)\]")


class AbsentError(Exception):
    """A message has no such field or entry; the message says which."""


@dataclass(frozen=True, slots=True)
class Step:
    """One step: into a member, to an entry by its number, or to the entry whose member has a text."""

    member: str = ""
    index: int = -1
    where: str = ""
    text: str = ""


def steps_of(path: str) -> tuple[Step, ...]:
    """Return the steps of a way.

    Raises
    ------
    MappingError
        If it has another form.
    """
    steps, at = [], 0
    while at < len(path):
        found = _STEP.match(path, at)
        if found is None or (not found[0].startswith("[") and (at > 0) != found[0].startswith(".")):
            raise MappingError(f"{path!r} is not a path to a field; write a.b, a[0] or a[name=text].b")
        member, index, where, text = found.groups()
        steps.append(Step(member or "", int(index) if index else -1, where or "", text or ""))
        at = found.end()
    if not steps or not steps[0].member:
        raise MappingError(f"{path!r} is not a path to a field; write a.b, a[0] or a[name=text].b")
    return tuple(steps)


def read_field(message: object, path: str) -> object:
    """Return the field of a message.

    Raises
    ------
    AbsentError
        If it has none, or a list has no such entry.
    """
    found = message
    for step in steps_of(path):
        found = _into(found, step, path)
    return found


def _into(found: Any, step: Step, path: str) -> object:
    if step.member:
        if not hasattr(found, step.member):
            raise AbsentError(f"there is no {step.member} on the way {path}")
        return getattr(found, step.member)
    if not hasattr(found, "__getitem__") or not hasattr(found, "__len__"):
        raise AbsentError(f"there is no list before {step.where or step.index} on the way {path}")
    if step.where:
        for entry in found:
            if str(getattr(entry, step.where, None)) == step.text:
                return entry
        raise AbsentError(f"no entry has {step.where} {step.text!r} on the way {path}")
    if step.index >= len(found):
        raise AbsentError(f"there are {len(found)} entries, none has number {step.index} on the way {path}")
    return found[step.index]
