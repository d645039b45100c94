"""Plans made out of a plan as an operator would: nodes removed, added, changed, moved, the root renamed."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from dataclasses import replace

from executive.crl import Plan
from executive.crl.nodes import Alternate, Block, Branch, ConcurrentBlock, Node, Option, Task, walk, walk_plan
from executive.crl.values import Relative, bounds

EDITS = ("add", "add", "add", "drop", "alter", "move", "rename", "library", "hold", "hurry")
"""Methods of an `Editor`, some more likely than others."""

OPTION_EDITS = ("add", "drop", "hold", "move", "relabel", "relabel", "enter", "enter")
"""The same, with nodes that come under other options."""

Change = Callable[[Node], Node | None]


def mapped(node: Node, change: Change) -> Node | None:
    """Return a tree with each node changed, children first; None takes a node away."""
    if isinstance(node, Block | ConcurrentBlock):
        kids = tuple(k for child in node.node_list if (k := mapped(child, change)) is not None)
        if not kids:
            return None
        node = replace(node, node_list=kids)
    elif isinstance(node, Branch):
        options = tuple(replace(o, node=k) for o in node.options if (k := mapped(o.node, change)) is not None)
        if not options:
            return None
        node = replace(node, options=options)
    return change(node)


class Editor:
    """Draws changed versions of a plan; ids that it makes are new."""

    def __init__(self, rng: random.Random, edits: Sequence[str] = EDITS) -> None:
        self.rng = rng
        self.edits = edits
        self.serial = 0

    def task(self) -> Task:
        self.serial += 1
        return Task(id=f"n{self.serial}", action="act", continue_on_failure=self.rng.random() < 0.7)

    def edit(self, plan: Plan) -> Plan:
        """Return the plan with up to three changes."""
        for _ in range(self.rng.randint(0, 3)):
            kind = self.rng.choice(self.edits)
            plan = getattr(self, kind)(plan)
        return plan

    def at(self, plan: Plan, target: Node, change: Change) -> Plan:
        made = mapped(plan.node, lambda n: change(n) if n.id == target.id else n)
        return plan if made is None else replace(plan, node=made)

    def pick(self, plan: Plan, *kinds: type) -> Node | None:
        found = [n for n in walk(plan.node) if isinstance(n, kinds or (Task, Block, ConcurrentBlock, Branch))]
        return self.rng.choice(found) if found else None

    def add(self, plan: Plan) -> Plan:
        """Put a new task into a composite, at the end more often than elsewhere."""
        target = self.pick(plan, Block, ConcurrentBlock, Branch)
        fresh = self.task()
        if target is None:
            return plan
        if isinstance(target, Branch):
            option = Option(id=f"x{fresh.id}", utility=self.rng.randint(0, 9), node=fresh)
            return self.at(plan, target, lambda n: replace(n, options=(*n.options, option)))
        kids = target.node_list
        at = len(kids) if self.rng.random() < 0.7 else self.rng.randint(0, len(kids))
        return self.at(plan, target, lambda n: replace(n, node_list=(*kids[:at], fresh, *kids[at:])))

    def drop(self, plan: Plan) -> Plan:
        target = self.pick(plan)
        return plan if target is None else self.at(plan, target, lambda n: None)

    def alter(self, plan: Plan) -> Plan:
        """Change a task, or what kind of block a block is."""
        target = self.pick(plan)
        if isinstance(target, Task):
            return self.at(plan, target, lambda n: replace(n, reward=n.reward + 1))
        return self.hold(plan)

    def hold(self, plan: Plan) -> Plan:
        """Give a composite a duration: it may be held when its children are over."""
        target = self.pick(plan, Block, ConcurrentBlock, Branch)
        lo = self.rng.randint(0, 12)
        if target is None:
            return plan
        return self.at(plan, target, lambda n: replace(n, duration=bounds(lo, lo + 40)))

    def hurry(self, plan: Plan) -> Plan:
        """Let the start window of a node, often the root, be short and count from its activation."""
        target = plan.node if self.rng.random() < 0.5 else self.pick(plan)
        window = (Relative(bounds(0, self.rng.randint(0, 2))),)
        if target is None:
            return plan
        return self.at(plan, target, lambda n: replace(n, start_temporal_conditions=window))

    def move(self, plan: Plan) -> Plan:
        """Take a node out and put it into another composite."""
        target = self.pick(plan)
        if target is None or target.id == plan.node.id:
            return plan
        without = self.at(plan, target, lambda n: None)
        home = self.pick(without, Block, ConcurrentBlock)
        if home is None or any(n.id == target.id for n in walk_plan(without)):
            return plan
        return self.at(without, home, lambda n: replace(n, node_list=(*n.node_list, target)))

    def relabel(self, plan: Plan) -> Plan:
        """Give an option a new id and another utility; a choice of it is lost."""
        target = self.pick(plan, Branch)
        if not isinstance(target, Branch):
            return plan
        self.serial += 1
        place = self.rng.randrange(len(target.options))
        fresh = replace(target.options[place], id=f"x{self.serial}", utility=self.rng.randint(0, 9))
        options = (*target.options[:place], fresh, *target.options[place + 1 :])
        return self.at(plan, target, lambda n: replace(n, options=options))

    def enter(self, plan: Plan) -> Plan:
        """Take a node out and put it under a new option of a branch."""
        target = self.pick(plan)
        if target is None or target.id == plan.node.id:
            return plan
        without = self.at(plan, target, lambda n: None)
        home = self.pick(without, Branch)
        if home is None or any(n.id == target.id for n in walk_plan(without)):
            return plan
        self.serial += 1
        option = Option(id=f"x{self.serial}", utility=self.rng.randint(0, 9), node=target)
        return self.at(without, home, lambda n: replace(n, options=(*n.options, option)))

    def rename(self, plan: Plan) -> Plan:
        """Give the root, or some other composite, a new id."""
        target = plan.node if self.rng.random() < 0.5 else self.pick(plan, Block, ConcurrentBlock, Branch)
        self.serial += 1
        return plan if target is None else self.at(plan, target, lambda n: replace(n, id=f"r{self.serial}"))

    def library(self, plan: Plan) -> Plan:
        """Add an alternate, or take one away."""
        if plan.library and self.rng.random() < 0.4:
            return replace(plan, library=plan.library[1:])
        fresh = self.task()
        return replace(plan, library=(*plan.library, Alternate(id=f"l{fresh.id}", node=fresh)))
