"""Check a contingent plan against an instance, and value it over drawn futures.

Written from the definition of the problem alone (docs/reference/contest.md); nothing of a planner is in it.
Futures are drawn in blocks, and a block walks the tree together: a choice splits it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from planner.contest.instance import Instance
from planner.errors import PlanTreeError
from planner.plan_tree_document import TREES, TREES_1

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Rows = NDArray[np.intp]
BLOCK = 100_000
MOST_STEPS = 20_000
DEEPEST = 200


@dataclass(frozen=True, slots=True)
class Verdict:
    """What a plan is worth: mean utility with its standard error, over `futures`, and how its runs end.

    `overruns` is the share of futures that end over a budget, `failing` the steps that fail in every future
    that reaches them, by their place in the tree.
    """

    value: float
    standard_error: float
    futures: int
    branches: int
    overruns: float
    failing: tuple[str, ...]


def read_plan(
    document: Mapping[str, object], instance: Instance, max_branches: int | None = None
) -> list[Any]:
    """Return the steps of a plan, `plan-tree/1` or `plan-tree/2`, that names nothing unknown.

    Raises
    ------
    PlanTreeError
        If it is malformed, names what the instance does not have, or has too many branches; the place is
        told.
    """
    codec = TREES if document.get("format") == TREES.format else TREES_1
    told: Any = codec.from_document(document)
    if told.get("instance", instance.name) != instance.name:
        raise PlanTreeError(f"the plan is for {told['instance']!r}, not for {instance.name!r}")
    steps = list(told["plan"])
    for count, (where, step) in enumerate(_walk(steps, "plan", 0), 1):
        if count > MOST_STEPS:
            raise PlanTreeError(f"the plan has more than {MOST_STEPS} steps")
        _check_step(where, step, instance)
    found = count_branches(steps)
    if max_branches is not None and found > max_branches:
        raise PlanTreeError(f"the plan has {found} branches; at most {max_branches} are allowed")
    return steps


def count_branches(steps: Sequence[Any]) -> int:
    """Return the number of options in a whole tree."""
    return sum(len(step["options"]) for _, step in _walk(steps, "plan", 0) if step["op"] == "branch")


def _walk(steps: Sequence[Any], where: str, depth: int) -> Iterator[tuple[str, Any]]:
    if depth > DEEPEST:
        raise PlanTreeError(f"{where[:80]}: options lie more than {DEEPEST} deep")
    for number, step in enumerate(steps):
        here = f"{where}[{number}]"
        yield here, step
        for k, option in enumerate(step.get("options", ())):
            yield from _walk(option["plan"], f"{here}.options[{k}].plan", depth + 1)


def _check_step(where: str, step: Any, instance: Instance) -> None:
    target = step.get("to") if step["op"] == "navigate" else step.get("target")
    if step["op"] not in {"branch", "stop"} and target not in instance.goals:
        raise PlanTreeError(f"{where}.target is {target!r}, which the instance does not have")
    if step["op"] in {"observe", "visit"} and step.get("observation", target) not in {target, None}:
        raise PlanTreeError(
            f"{where}.observation is {step['observation']!r}; {target} has one, of its own name"
        )
    if not math.isfinite(step.get("wait_until_s", 0.0)):
        raise PlanTreeError(f"{where}.wait_until_s is {step['wait_until_s']}; a finite number is needed")
    for k, option in enumerate(step.get("options", ())):
        for condition in option["when"]:
            here = f"{where}.options[{k}].when"
            if condition["var"] in {"time_s", "energy_j"}:
                limits = [condition[name] for name in ("ge", "lt") if name in condition]
                if len(limits) != 1 or not math.isfinite(limits[0]):
                    raise PlanTreeError(f"{here}: {condition['var']} needs one of ge and lt, a finite number")
            elif condition.get("target", condition.get("observation")) not in instance.goals:
                raise PlanTreeError(f"{here}: {condition['var']} names no target of the instance")


@dataclass(slots=True)
class _Block:
    """Futures that are on their way: time s, energy of actions J, utility, place, tracks and observations."""

    time_s: Floats
    energy_j: Floats
    utility: Floats
    place: NDArray[np.int64]
    tracked: Flags
    done: Flags
    overran: Flags

    @classmethod
    def of(cls, futures: int, targets: int) -> _Block:
        zero = np.zeros(futures)
        marks = np.zeros((futures, targets + 1), dtype=bool)
        return cls(
            zero.copy(), zero.copy(), zero.copy(), np.zeros(futures, np.int64), marks.copy(), marks.copy(),
            np.zeros(futures, dtype=bool),
        )  # fmt: skip


@dataclass(slots=True)
class _Valuation:
    instance: Instance
    rng: np.random.Generator
    names: list[str] = field(init=False)
    reached: dict[str, int] = field(default_factory=dict)
    went_well: dict[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.names = ["start", *self.instance.goals]

    def run(self, steps: Sequence[Any], block: _Block, rows: Rows, where: str) -> None:
        """Carry out steps in the futures `rows`; those that end are left as they are."""
        for number, step in enumerate(steps):
            here = f"{where}[{number}]"
            if step["op"] == "stop" or not rows.size:
                return
            if step["op"] == "branch":
                for k, option in enumerate(step["options"]):
                    holds = self._holds(option["when"], block, rows)
                    self.run(option["plan"], block, rows[holds], f"{here}.options[{k}].plan")
                    rows = rows[~holds]
                continue
            well, alive = self._act(step, block, rows)
            self.reached[here] = self.reached.get(here, 0) + rows.size
            self.went_well[here] = self.went_well.get(here, 0) + int(well.sum())
            rows = rows[alive if step.get("on_fail", "stop") == "skip" else well & alive]

    def _holds(self, conditions: Sequence[Any], block: _Block, rows: Rows) -> Flags:
        holds = np.ones(rows.size, dtype=bool)
        for condition in conditions:
            if condition["var"] in {"time_s", "energy_j"}:
                used = block.time_s[rows]
                if condition["var"] == "energy_j":
                    used = block.energy_j[rows] + self.instance.hotel_w * used
                holds &= used >= condition["ge"] if "ge" in condition else used < condition["lt"]
            else:
                marks = block.tracked if condition["var"] == "tracked" else block.done
                target = self.names.index(condition.get("target") or condition["observation"])
                holds &= marks[rows, target] == condition["is"]
        return holds

    def _act(self, step: Any, block: _Block, rows: Rows) -> tuple[Flags, Flags]:
        """Return in which futures a step went well, and which go on after it."""
        name = step["to"] if step["op"] == "navigate" else step["target"]
        target = self.names.index(name)
        goal = self.instance.goals[name]
        well = np.ones(rows.size, dtype=bool)
        alive = np.ones(rows.size, dtype=bool)

        def needs_track() -> None:
            if goal.place:
                np.logical_and(well, block.tracked[rows, target], out=well)

        match step["op"]:
            case "track_start":
                well &= goal.place & (block.place[rows] == 0) & ~block.tracked[rows, target]
                taken = rows[well]
                block.time_s[taken] += self.instance.track_start[0]
                block.energy_j[taken] += self.instance.track_start[1]
                alive[well] = self._within(block, taken)
                block.tracked[rows[well & alive], target] = True
            case "track_stop":
                block.tracked[rows, target] = False
            case "navigate":
                if step.get("require_tracked"):
                    needs_track()
                self._drive(target, block, rows, well, alive)
            case "visit":
                needs_track()
                self._drive(target, block, rows, well, alive)
                self._observe(step, target, block, rows, well, alive)
            case _:
                self._observe(step, target, block, rows, well, alive)
        return well & alive, alive

    def _drive(self, target: int, block: _Block, rows: Rows, well: Flags, alive: Flags) -> None:
        for place in np.unique(block.place[rows[well & alive]]):
            if place == target:
                continue
            here = well & alive & (block.place[rows] == place)
            leg = self.instance.legs.get((self.names[place], self.names[target]))
            if leg is None:
                well[here] = False
                continue
            moving = rows[here]
            tracks = block.tracked[moving].sum(axis=1)
            block.time_s[moving] += (
                self._draw(leg.time_s, moving.size) + self.instance.track_overhead_s * tracks
            )
            block.energy_j[moving] += self._draw(leg.energy_j, moving.size)
            alive[here] = self._within(block, moving)
            arrived = rows[here & alive]
            for name, chance in leg.p_lose.items():
                track = self.names.index(name)
                block.tracked[arrived, track] &= self.rng.random(arrived.size) >= chance
            block.place[arrived] = target

    def _observe(self, step: Any, target: int, block: _Block, rows: Rows, well: Flags, alive: Flags) -> None:
        goal = self.instance.goals[self.names[target]]
        opens, closes = goal.window_s
        well &= alive & (block.place[rows] == target) & ~block.done[rows, target]
        well &= block.time_s[rows] <= closes
        if goal.place:
            well &= block.tracked[rows, target]
        opens = max(opens, step.get("wait_until_s", 0.0))
        if opens > closes:
            well[:] = False
        looking = rows[well]
        block.time_s[looking] = np.maximum(block.time_s[looking], opens)
        block.time_s[looking] += self._draw(goal.time_s, looking.size)
        block.energy_j[looking] += self._draw(goal.energy_j, looking.size)
        alive[well] = self._within(block, looking)
        over = rows[well & alive]
        block.utility[over] += goal.utility * (self.rng.random(over.size) < goal.p_success)
        block.done[over, target] = True
        block.tracked[over, target] = False

    def _draw(self, amount: tuple[float, float], count: int) -> Floats:
        """Return draws (count,) of a log-normal amount with this mean and standard deviation."""
        mean, sd = amount
        if sd == 0.0 or mean == 0.0:
            return np.full(count, mean)
        variance = math.log1p((sd / mean) ** 2)
        drawn: Floats = np.exp(
            math.log(mean) - variance / 2 + math.sqrt(variance) * self.rng.standard_normal(count)
        )
        return drawn

    def _within(self, block: _Block, rows: Rows) -> Flags:
        """Return which futures are within both budgets; the others end and pay."""
        used = block.energy_j[rows] + self.instance.hotel_w * block.time_s[rows]
        inside = (block.time_s[rows] <= self.instance.budget_s) & (used <= self.instance.budget_j)
        block.utility[rows[~inside]] -= self.instance.penalty
        block.overran[rows[~inside]] = True
        found: Flags = inside
        return found


def value_plan(instance: Instance, steps: Sequence[Any], futures: int = 1_000_000, seed: int = 1) -> Verdict:
    """Return what a plan that `read_plan` took is worth over futures drawn from a seed."""
    total = squares = overran = 0.0
    drawn = 0
    reached: dict[str, int] = {}
    well: dict[str, int] = {}
    for number in range(math.ceil(futures / BLOCK)):
        size = min(BLOCK, futures - drawn)
        valuation = _Valuation(
            instance, np.random.default_rng([seed, number]), reached=reached, went_well=well
        )
        block = _Block.of(size, len(instance.goals))
        valuation.run(steps, block, np.arange(size), "plan")
        total += float(block.utility.sum())
        squares += float((block.utility**2).sum())
        overran += float(block.overran.sum())
        drawn += size
    mean = total / drawn
    spread = math.sqrt(max(0.0, squares / drawn - mean * mean) / drawn)
    never = tuple(sorted(place for place, count in reached.items() if count and not well[place]))
    return Verdict(mean, spread, drawn, count_branches(steps), overran / drawn, never)
