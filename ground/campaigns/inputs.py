"""Plan, world and prediction of a campaign, read from files and checked against each other."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, cast

from ground.campaigns.case import Case, World, observations_of, world_text
from ground.campaigns.variant import canonical, read_plan
from ground.errors import InvalidInputError
from mission.codec import read_object

if TYPE_CHECKING:
    from executive.crl import Plan
    from planner.problem_document import ProblemDocument

WORLD = "world/1"
TREE = "plan_tree.json"
SUMMARY = "summary.json"


def read_case(plan_file: Path, world_file: Path, rover: str, *, any_world: bool = False) -> Case:
    """Return the case of a plan's CRL file, a world's file or folder, and a rover's name.

    Parameters
    ----------
    any_world
        Take a world even if the plan tree beside the plan was made for another problem.

    Raises
    ------
    InvalidInputError
        If a file cannot be used, or the plan is of another world.
    RoverError
        If there is no such rover.
    """
    from rover_iface.errors import RoverError
    from rover_iface.registry import find_rover
    from rover_iface.simulator.world import load_world

    find_rover(rover)
    plan = read_plan(plan_file)
    document = world_document(world_file)
    try:
        problem = cast("ProblemDocument", load_world(document).problem_document())
    except RoverError as err:
        raise InvalidInputError(f"{world_file}: {err}") from err
    document["problem"] = problem
    check_targets(plan, problem, str(plan_file), str(world_file))
    if not any_world:
        _check_tree(plan_file, problem, world_file)
    return Case(canonical(plan), world_text(document), rover)


def world_document(path: Path) -> World:
    """Return the `world/1` document in a file or folder, with everything inside and absolute paths."""
    from rover_iface.simulator.model import PROBLEM_FORMATS

    if path.is_dir():
        path = path / "world.json"
    document = dict(read_object(path, InvalidInputError, "world"))
    if document.get("format") in PROBLEM_FORMATS:
        problem = cast("ProblemDocument", document)
        return {"format": WORLD, "name": str(document.get("name", "")), "problem": problem}
    folder = path.parent.resolve()
    for member in ("problem", "faults"):
        if isinstance(document.get(member), str):
            beside = read_object(folder / document[member], InvalidInputError, member)
            document[member] = beside if member == "problem" else beside.get("faults", [])
    document.pop("future", None)
    for member in ("terrain", "profile"):
        held = document.get(member)
        if isinstance(held, str) and (member == "terrain" or held.endswith(".toml")):
            document[member] = str(folder / held)
    return cast("World", document)


def check_targets(plan: Plan, problem: ProblemDocument, plan_name: str, world_name: str) -> None:
    """Refuse a plan that goes to targets, or makes observations, that the world does not have.

    Raises
    ------
    InvalidInputError
        With the first of them and what the world has.
    """
    targets = [str(t["id"]) for t in problem.get("targets", ())]
    made = {str(o["id"]) for t in problem.get("targets", ()) for o in observations_of(t)}
    for task, target, observation in _named(plan):
        if target is not None and target not in targets:
            known = ", ".join(targets[:12]) + (", ..." if len(targets) > 12 else "")
            raise InvalidInputError(
                f"{world_name} is the world of another plan: task {task} of {plan_name} needs target "
                f"{target}; the world has {known or 'none'}"
            )
        if observation is not None and observation not in made:
            raise InvalidInputError(
                f"{world_name} is the world of another plan: task {task} of {plan_name} makes observation "
                f"{observation}, which the world does not have"
            )


def _named(plan: Plan) -> Iterator[tuple[str, str | None, str | None]]:
    """Yield each task with the target and the observation that it names."""
    from executive.crl.nodes import Task, walk_plan

    for node in walk_plan(plan):
        if isinstance(node, Task):
            target, observation = node.parameters.get("target"), node.metadata.get("observation")
            yield (
                node.id,
                None if target is None else str(target),
                None if observation is None else str(observation),
            )


def _check_tree(plan_file: Path, problem: Mapping[str, object], world_file: Path) -> None:
    """Refuse a world whose problem is not the one for which the plan tree beside the plan was made."""
    tree = read_tree(plan_file)
    wanted = None if tree is None else tree.get("problem_sha256")
    if not wanted:
        return
    from planner.errors import PlannerError
    from planner.problem import problem_from_dict

    try:
        found = problem_from_dict(problem).digest()
    except PlannerError as err:
        raise InvalidInputError(f"{world_file}: {err}") from err
    if found != wanted:
        raise InvalidInputError(
            f"{world_file} is the world of another plan: its problem is {found[:12]}, {plan_file} was made "
            f"for {str(wanted)[:12]} (--any-world flies it all the same)"
        )


def read_tree(plan_file: Path) -> Mapping[str, object] | None:
    """Return the plan tree that lies beside a plan, or None."""
    path = plan_file.with_name(TREE)
    return read_object(path, InvalidInputError, "plan tree") if path.is_file() else None


def expected_utility(plan_file: Path) -> float | None:
    """Return what the planner expected of a plan, from the summary beside it, or None."""
    path = plan_file.with_name(SUMMARY)
    if not path.is_file():
        return None
    found = read_object(path, InvalidInputError, "summary").get("expected_utility")
    return float(found) if isinstance(found, int | float) else None


def option_odds(plan: Plan) -> dict[str, float]:
    """Return the chance that the planner gave to each option of a plan, by its id."""
    from executive.crl.nodes import Branch, walk_plan

    branches = (node for node in walk_plan(plan) if isinstance(node, Branch))
    return {o.id: o.probability for b in branches for o in b.options if o.probability is not None}
