"""Random plans and random edits of them, each with a question that tells whether a plan still holds the edit.

The questions look at values alone and use nothing of `ground.versions`, so they are a second view.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isclose
from random import Random
from typing import Any

from executive.crl.nodes import Block, Branch, ConcurrentBlock, Node, Option, Plan, Task, children, walk
from executive.crl.values import Absolute, Comparison, Condition, Expectation, Interval, Operator, Spread

Holds = Callable[[Plan], bool]


@dataclass
class Edit:
    """A plan after an edit, what was done, and whether another plan holds it too."""

    plan: Plan
    what: str
    holds: Holds


WARM = Comparison("temp", (), Operator.GE, 3)


def _charge(least: float) -> Comparison:
    return Comparison("battery", (), Operator.GE, least)


def _asks_for_charge(condition: Condition) -> bool:
    return isinstance(condition, Comparison) and condition.key == "battery"


def random_plan(rng: Random) -> Plan:
    """Return a plan of blocks, concurrent blocks and branches, valid without a dictionary."""
    count = iter(range(10_000))

    def node(depth: int) -> Node:
        kind = rng.random() if depth else 0.0
        if kind < 0.5:
            parameters = {"x": rng.randrange(9), "target": rng.choice(("R1", "R2"))}
            return Task(
                id=f"t{next(count)}",
                action=rng.choice(("drive", "look")),
                parameters=parameters,
                start_conditions=rng.choice(((), (_charge(100),), (_charge(100), WARM))),
                expectations=rng.choice(((), (Expectation("time", 10, rng.randrange(1, 30)),))),
            )
        if kind < 0.75:
            return Block(id=f"b{next(count)}", node_list=several(depth))
        if kind < 0.87:
            return ConcurrentBlock(id=f"c{next(count)}", node_list=several(depth))
        options = tuple(
            Option(id=f"o{next(count)}", utility=rng.randrange(1, 30), node=node(depth - 1))
            for _ in range(rng.randrange(1, 4))
        )
        return Branch(id=f"r{next(count)}", options=options)

    def several(depth: int) -> tuple[Node, ...]:
        return tuple(node(depth - 1) for _ in range(rng.randrange(2, 5)))

    spread = rng.choice(tuple(Spread))
    return Plan(id="p", node=Block(id="root", node_list=several(3)), expectation_spread=spread)


def by_id(plan: Plan) -> dict[str, Any]:
    """Return the nodes and options of a plan by id."""
    found: dict[str, Any] = {}
    for one in walk(plan.node):
        found[one.id] = one
        if isinstance(one, Branch):
            found.update((o.id, o) for o in one.options)
    return found


def parent_of(plan: Plan, name: str) -> Any | None:
    """Return the block around a node."""
    return next((n for n in walk(plan.node) if any(c.id == name for c in children(n))), None)


def rebuilt(plan: Plan, change: Callable[[Any], Any]) -> Plan:
    """Return the plan with each node, deepest first, replaced by what `change` makes of it."""

    def again(node: Node) -> Node:
        if isinstance(node, Block | ConcurrentBlock):
            return change(replace(node, node_list=tuple(again(n) for n in node.node_list)))
        if isinstance(node, Branch):
            return change(
                replace(node, options=tuple(change(replace(o, node=again(o.node))) for o in node.options))
            )
        return change(node)

    return replace(plan, node=again(plan.node))


def _on(name: str, change: Callable[[Any], Any]) -> Callable[[Any], Any]:
    return lambda form: change(form) if form.id == name else form


def _lists(plan: Plan) -> list[Any]:
    return [n for n in walk(plan.node) if isinstance(n, Block | ConcurrentBlock)]


def _tasks(plan: Plan) -> list[Task]:
    return [n for n in walk(plan.node) if isinstance(n, Task)]


def set_parameter(plan: Plan, rng: Random, side: str) -> Edit:
    task, name = rng.choice(_tasks(plan)), rng.choice(("x", "target", f"new_{side}"))
    value = f"{side}{rng.randrange(3)}"
    after = rebuilt(plan, _on(task.id, lambda t: replace(t, parameters={**t.parameters, name: value})))
    return Edit(
        after,
        f"{task.id}.{name}={value}",
        lambda p: task.id in by_id(p) and by_id(p)[task.id].parameters.get(name) == value,
    )


def set_action(plan: Plan, rng: Random, side: str) -> Edit:
    task, action = rng.choice(_tasks(plan)), f"act-{side}"
    after = rebuilt(plan, _on(task.id, lambda t: replace(t, action=action)))
    return Edit(
        after,
        f"{task.id}.action={action}",
        lambda p: getattr(by_id(p).get(task.id), "action", None) == action,
    )


def add_condition(plan: Plan, rng: Random, side: str) -> Edit:
    node = rng.choice(list(walk(plan.node)))
    found = Comparison("soc", (), Operator.GE, rng.randrange(5) + (0.5 if side == "a" else 0.25))
    after = rebuilt(plan, _on(node.id, lambda n: replace(n, start_conditions=(*n.start_conditions, found))))
    return Edit(
        after,
        f"{node.id} asks {found}",
        lambda p: node.id in by_id(p) and found in by_id(p)[node.id].start_conditions,
    )


def set_charge(plan: Plan, rng: Random, side: str) -> Edit:
    """Ask another charge of a step that asks for one."""
    asking = [t for t in _tasks(plan) if any(map(_asks_for_charge, t.start_conditions))]
    if not asking:
        return add_condition(plan, rng, side)
    task, asked = rng.choice(asking), _charge(rng.randrange(200, 204))
    kept = tuple(c for c in task.start_conditions if not _asks_for_charge(c))
    after = rebuilt(plan, _on(task.id, lambda t: replace(t, start_conditions=(asked, *kept))))
    return Edit(
        after,
        f"{task.id} asks {asked}",
        lambda p: task.id in by_id(p) and asked in by_id(p)[task.id].start_conditions,
    )


def drop_charge(plan: Plan, rng: Random, side: str) -> Edit:
    """Let a step begin at any charge."""
    asking = [t for t in _tasks(plan) if any(map(_asks_for_charge, t.start_conditions))]
    if not asking:
        return add_condition(plan, rng, side)
    task = rng.choice(asking)
    kept = tuple(c for c in task.start_conditions if not _asks_for_charge(c))
    after = rebuilt(plan, _on(task.id, lambda t: replace(t, start_conditions=kept)))
    return Edit(
        after,
        f"{task.id} at any charge",
        lambda p: (
            task.id not in by_id(p) or not any(map(_asks_for_charge, by_id(p)[task.id].start_conditions))
        ),
    )


def deviation(plan: Plan, name: str) -> float | None:
    """Return the standard deviation of the time that a step is predicted to take."""
    found = by_id(plan).get(name)
    if found is None or not found.expectations:
        return None
    spread = found.expectations[0].spread
    return float(spread**0.5 if plan.expectation_spread is Spread.VARIANCE else spread)


def _predicts(name: str, wanted: float) -> Holds:
    def holds(p: Plan) -> bool:
        found = deviation(p, name)
        return found is not None and isclose(found, wanted)

    return holds


def set_prediction(plan: Plan, rng: Random, side: str) -> Edit:
    task, spread = rng.choice(_tasks(plan)), rng.randrange(40, 90)
    predicted = (Expectation("time", 10, spread),)
    after = rebuilt(plan, _on(task.id, lambda t: replace(t, expectations=predicted)))
    wanted = deviation(after, task.id)
    assert wanted is not None
    return Edit(after, f"{task.id} deviates by {wanted}", _predicts(task.id, wanted))


def state_spread_otherwise(plan: Plan, rng: Random, side: str) -> Edit:
    """State every spread the other way, and give one step another."""
    variance = plan.expectation_spread is Spread.VARIANCE

    def change(form: Any) -> Any:
        if isinstance(form, Option):
            return form
        power = 0.5 if variance else 2
        return replace(
            form, expectations=tuple(replace(e, spread=e.spread**power) for e in form.expectations)
        )

    other = replace(rebuilt(plan, change), expectation_spread=Spread.STDDEV if variance else Spread.VARIANCE)
    edit = set_prediction(other, rng, side)
    return replace(edit, what=f"{other.expectation_spread}, {edit.what}")


def set_window(plan: Plan, rng: Random, side: str) -> Edit:
    node = rng.choice(list(walk(plan.node)))
    window = Absolute(Interval(0, rng.randrange(10**6, 10**7)))
    after = rebuilt(plan, _on(node.id, lambda n: replace(n, end_temporal_conditions=(window,))))
    return Edit(
        after,
        f"{node.id} window {window.interval.hi_ms}",
        lambda p: node.id in by_id(p) and by_id(p)[node.id].end_temporal_conditions == (window,),
    )


def insert_step(plan: Plan, rng: Random, side: str) -> Edit:
    block = rng.choice(_lists(plan))
    predicted = rng.choice(((), (Expectation("time", 5, rng.randrange(1, 30)),)))
    new = Task(id=f"new-{side}-{rng.randrange(10**6)}", action="look", expectations=predicted)
    at = rng.randrange(len(block.node_list) + 1)
    inside = (*block.node_list[:at], new, *block.node_list[at:])
    after = rebuilt(plan, _on(block.id, lambda b: replace(b, node_list=inside)))

    def holds(p: Plan) -> bool:
        around = parent_of(p, new.id)
        if around is None or around.id != block.id:
            return False
        wanted = deviation(after, new.id)
        if wanted is not None and not _predicts(new.id, wanted)(p):
            return False
        ids = [n.id for n in children(around)]
        beside = [n.id for n in block.node_list]
        before = all(ids.index(i) < ids.index(new.id) for i in beside[:at][-1:] if i in ids)
        return before or isinstance(block, ConcurrentBlock)

    return Edit(after, f"{new.id} into {block.id} at {at}", holds)


def remove_step(plan: Plan, rng: Random, side: str) -> Edit:
    blocks = [b for b in _lists(plan) if len(b.node_list) > 1]
    if not blocks:
        return set_window(plan, rng, side)
    block = rng.choice(blocks)
    gone = rng.choice(block.node_list)
    after = rebuilt(
        plan,
        _on(block.id, lambda b: replace(b, node_list=tuple(n for n in b.node_list if n.id != gone.id))),
    )
    return Edit(after, f"without {gone.id}", lambda p: gone.id not in by_id(p))


def swap_steps(plan: Plan, rng: Random, side: str) -> Edit:
    blocks = [b for b in _lists(plan) if isinstance(b, Block) and len(b.node_list) > 1]
    if not blocks:
        return set_window(plan, rng, side)
    block = rng.choice(blocks)
    at = rng.randrange(len(block.node_list) - 1)
    first, second = block.node_list[at : at + 2]
    inside = (*block.node_list[:at], second, first, *block.node_list[at + 2 :])
    after = rebuilt(plan, _on(block.id, lambda b: replace(b, node_list=inside)))

    def holds(p: Plan) -> bool:
        around = parent_of(p, second.id)
        if around is None or around is not parent_of(p, first.id):
            return second.id.startswith("new-") or first.id.startswith("new-")  # its neighbour went elsewhere
        ids = [n.id for n in children(around)]
        return ids.index(second.id) < ids.index(first.id)

    return Edit(after, f"{second.id} before {first.id}", holds)


def move_step(plan: Plan, rng: Random, side: str) -> Edit:
    sources = [b for b in _lists(plan) if len(b.node_list) > 1]
    if not sources:
        return set_action(plan, rng, side)
    source = rng.choice(sources)
    moved = rng.choice(source.node_list)
    below = {n.id for n in walk(moved)}
    targets = [b for b in _lists(plan) if b.id not in below and b.id != source.id]
    if not targets:
        return set_action(plan, rng, side)
    target = rng.choice(targets)

    def change(form: Any) -> Any:
        if form.id == source.id:
            form = replace(form, node_list=tuple(n for n in form.node_list if n.id != moved.id))
        if form.id == target.id:
            form = replace(form, node_list=(*form.node_list, moved))
        return form

    return Edit(
        rebuilt(plan, change),
        f"{moved.id} to {target.id}",
        lambda p: getattr(parent_of(p, moved.id), "id", None) == target.id,
    )


def add_option(plan: Plan, rng: Random, side: str) -> Edit:
    branches = [n for n in walk(plan.node) if isinstance(n, Branch)]
    if not branches:
        return insert_step(plan, rng, side)
    branch = rng.choice(branches)
    mark = f"{side}-{rng.randrange(10**6)}"
    new = Option(id=f"opt-{mark}", utility=rng.randrange(40, 90), node=Task(id=f"do-{mark}", action="look"))
    after = rebuilt(plan, _on(branch.id, lambda b: replace(b, options=(*b.options, new))))
    return Edit(
        after,
        f"{new.id} into {branch.id}",
        lambda p: branch.id in by_id(p) and new in by_id(p)[branch.id].options,
    )


def set_utility(plan: Plan, rng: Random, side: str) -> Edit:
    options = [o for n in walk(plan.node) if isinstance(n, Branch) for o in n.options]
    if not options:
        return set_parameter(plan, rng, side)
    option, worth = rng.choice(options), rng.randrange(100, 200) + (0.5 if side == "a" else 0)
    after = rebuilt(plan, _on(option.id, lambda o: replace(o, utility=worth)))
    return Edit(
        after,
        f"{option.id} worth {worth}",
        lambda p: getattr(by_id(p).get(option.id), "utility", None) == worth,
    )


EDITS = (
    set_parameter,
    set_action,
    add_condition,
    set_charge,
    drop_charge,
    set_prediction,
    state_spread_otherwise,
    set_window,
    insert_step,
    remove_step,
    swap_steps,
    move_step,
    add_option,
    set_utility,
)


def random_edits(plan: Plan, rng: Random, side: str) -> tuple[Plan, list[Edit]]:
    """Return a plan after one to three edits, and those that its end holds and its beginning did not."""
    made, before = [], plan
    for _ in range(rng.randrange(1, 4)):
        edit = rng.choice(EDITS)(plan, rng, side)
        plan = edit.plan
        made.append(edit)
    return plan, [edit for edit in made if edit.holds(plan) and not edit.holds(before)]
