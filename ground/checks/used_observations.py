"""Which observations the tasks of a plan make, told as the rover tells it when a command arrives.

A command makes the observation that its metadata names, if that one is of its target and of its use (arm or
not). Else it makes one of those that fit, by its instrument where it names one. Which of several depends on
what was made before, so it is left open here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from mission.codec import Document
from mission.instrument import USUAL_ACTIONS, Use

if TYPE_CHECKING:
    from executive.crl import Plan
    from executive.crl.nodes import Task
    from rover_iface.profile import RoverProfile

ARM_ACTION = USUAL_ACTIONS[Use.CONTACT]
USES = frozenset(USUAL_ACTIONS.values())


@dataclass(frozen=True, slots=True)
class OpenUse:
    """A task that uses an instrument on what cannot be told: why, and whether that may be the arm."""

    said: str
    arm: bool


@dataclass(frozen=True, slots=True)
class UsedObservations:
    """Ids of the observations that a plan makes on some path, and the tasks of which it cannot be told."""

    ids: frozenset[str]
    open: tuple[OpenUse, ...]


def used_observations(plan: Plan, problem: Mapping[str, object], profile: RoverProfile) -> UsedObservations:
    """Return what the tasks of a plan observe, in its tree, its contingencies and its library."""
    from executive.crl.nodes import Task, walk_plan

    ids: set[str] = set()
    unknown: list[OpenUse] = []
    for node in walk_plan(plan):
        if not isinstance(node, Task):
            continue
        if "observation" in node.metadata:
            ids.add(str(node.metadata["observation"]))
        for found in _uses(node, problem, profile):
            if isinstance(found, OpenUse):
                unknown.append(found)
            else:
                ids.add(found)
    return UsedObservations(frozenset(ids), tuple(unknown))


def _uses(task: Task, problem: Document, profile: RoverProfile) -> Iterator[str | OpenUse]:
    action = profile.usual_action(task.action, task.parameters)
    if action not in USES:
        spec = profile.language.commands.actions.get(task.action)
        if spec is not None and spec.instrument:
            held = task.parameters.get(spec.instrument, "none")
            yield OpenUse(f"task {task.id} uses instrument {held}, which the rover does not have", arm=True)
        return
    arm = action == ARM_ACTION
    target = task.parameters.get("target")
    if target is None:
        if arm:
            yield OpenUse(f"task {task.id} uses the arm without a target", arm)
        return
    made = _candidates(task, _fitting(problem, str(target), arm))
    if len(made) > 1:
        which = " or ".join(made)
        yield OpenUse(f"task {task.id} does not say which observation it makes: {which}", arm)
    elif made:
        yield made[0]
    elif arm:
        yield OpenUse(
            f"task {task.id} uses the arm, and the world has no such observation of {target}", arm
        )  # a picture of such a target is one of the science camera, wherever the rover stands


def _fitting(problem: Document, target: str, arm: bool) -> list[Document]:
    """Return the observations of a target that the arm, or no arm, makes."""
    return [
        observation
        for held in problem.get("targets", ())
        if str(held["id"]) == target
        for observation in held.get("observations", (held,))
        if (observation.get("kind") == "place") is arm
    ]


def _candidates(task: Task, fitting: Sequence[Document]) -> list[str]:
    """Return the ids of those of the fitting observations that a task may make."""
    ids = [str(observation["id"]) for observation in fitting]
    wanted = task.metadata.get("observation")
    if wanted in ids:
        return [str(wanted)]
    instrument = task.parameters.get("instrument")
    if instrument is None:
        return ids
    return [str(o["id"]) for o in fitting if o.get("instrument", "") in ("", instrument)] or ids
