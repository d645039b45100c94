"""What can never happen: W071 (options), W072 (a branch with a gap), W073 (nodes)."""

from __future__ import annotations

from executive.crl.checks.index import Entry, Index
from executive.crl.checks.names import leaves
from executive.crl.checks.satisfiability import OUTCOMES, Domains, describe, gap, implies, satisfiable
from executive.crl.nodes import Block, Branch, Option
from executive.crl.printer import conditions_text
from executive.crl.values import Conditions, IfNone, OnOptionFailure, UtilityTable, Value, utility_at


def check_reach(index: Index) -> None:
    """Look for options, nodes and contingencies that can never get their turn."""
    for entry in index.entries:
        node = entry.node
        if isinstance(node, Branch):
            _branch(index, entry, node)
        if node.start_conditions or node.wait_for_conditions or node.maintain_conditions:
            _start(index, entry)
    for contingency in index.plan.floating:
        conditions = contingency.trigger_conditions
        if conditions and satisfiable(conditions) is False:
            message = f"can never trigger: {conditions_text(conditions)} cannot hold"
            index.add("W073", contingency, message, at="trigger-conditions")
    for alternate in index.plan.library:
        conditions = alternate.eligible_conditions
        if conditions and satisfiable(conditions) is False:
            message = f"can never be chosen: {conditions_text(conditions)} cannot hold"
            index.add("W073", alternate, message, at="eligible-conditions")


def _outcomes(index: Index, entry: Entry, conditions: Conditions) -> Domains:
    """Return what keys about other nodes can say when this node starts or, as a branch, chooses.

    Unknown are those of nodes that cannot be finished before: the node itself, those around and below it, and
    those that follow it, or something around it, in a block. A node that precedes it in a block is finished,
    and has neither failed nor been aborted if nothing up to that block would have tolerated it.
    """
    known: dict[str, tuple[Value | None, ...]] = {}
    for leaf in (leaf for condition in conditions for leaf in leaves(condition)):
        if leaf.key not in ("outcome", "reason") or len(leaf.arguments) != 1:
            continue
        other = index.by_id.get(str(leaf.arguments[0]))
        if other is None or index.entries[other].tree != entry.tree:
            continue
        key = f"{leaf.key} {leaf.arguments[0]}"
        if index.entries[other].covers(entry.number) or entry.covers(other):
            known[key] = (None,)
            continue
        top = index.meeting(entry.number, other)
        if not isinstance(index.entries[top].node, Block):
            continue
        if other > entry.number:
            known[key] = (None,)
        elif leaf.key == "outcome":
            harmless = "succeeded", "skipped"
            known[key] = tuple(OUTCOMES[1:]) if _tolerated(index, other, top) else harmless
    return known


def _tolerated(index: Index, number: int, top: int) -> bool:
    """Tell whether a failure of a node may come to an end before it reaches the block `top`."""
    while number != top:
        node = index.entries[number].node
        if node.continue_on_failure:
            return True
        if isinstance(node, Branch) and node.on_option_failure is OnOptionFailure.NEXT:
            return True
        number = index.entries[number].parent
    return False


def _start(index: Index, entry: Entry) -> None:
    node = entry.node
    kept = node.maintain_conditions
    wanted = (*node.wait_for_conditions, *node.start_conditions)
    field = "start-conditions" if node.start_conditions else "wait-for-conditions"
    known = _outcomes(index, entry, (*wanted, *kept))
    # Wait-for, start and maintain conditions are asked at the same instant, so they must hold together.
    if satisfiable(wanted, known) is False:
        index.add("W073", node, f"can never start: {conditions_text(wanted)} cannot hold", at=field)
    elif satisfiable((), known, kept) is False:
        message = f"can never start: {conditions_text(kept)} is false at once"
        index.add("W073", node, message, at="maintain-conditions")
    elif satisfiable(wanted, known, kept) is False:
        message = (
            f"can never start: {conditions_text(kept)} is false whenever {conditions_text(wanted)} holds"
        )
        index.add("W073", node, message, at="maintain-conditions")


def _branch(index: Index, entry: Entry, branch: Branch) -> None:
    live: list[Option] = []
    known: dict[str, tuple[Value | None, ...]] = {}
    for option in branch.options:
        conditions = option.eligible_conditions
        domains = _outcomes(index, entry, conditions)
        if branch.on_option_failure is OnOptionFailure.NEXT:
            inside = {index.entries[n].node.id for n in range(entry.number + 1, entry.end)}
            domains = {key: d for key, d in domains.items() if key.split(" ", 1)[1] not in inside}
        known.update(domains)
        if conditions and satisfiable(conditions, domains) is False:
            message = f"can never be chosen: {conditions_text(conditions)} cannot hold"
            index.add("W071", option, message, at="eligible-conditions")
        else:
            live.append(option)
    if branch.on_option_failure is OnOptionFailure.FAIL:
        for option in live:
            better = _dominator(option, branch.options, live)
            if better is not None:
                message = f"can never be chosen: {better.id} is eligible whenever it is, and worth more"
                index.add("W071", option, message, hint="equal utility: the first in the text is chosen")
    if branch.if_none is not IfNone.FAIL or not branch.options:
        return
    alternatives = [o.eligible_conditions for o in branch.options if not o.requires]
    if not alternatives:
        names = ", ".join(o.id for o in branch.options)
        message = f"no option may be eligible: all ({names}) require resources"
    else:
        found = gap(alternatives, known)
        if found is None or isinstance(found, bool):
            return
        message = f"no option is eligible if {describe(found)}"
        if len(alternatives) < len(branch.options):
            message += " and resources are short"
    index.add("W072", branch, message, hint='add an option without conditions, or ":if-none :skip"')


def _dominator(option: Option, order: tuple[Option, ...], live: list[Option]) -> Option | None:
    """Return an option that is always preferred to this one whenever this one is eligible."""
    place = {id(o): at for at, o in enumerate(order)}
    for other in live:
        if other is option:
            continue
        needs = {a.resource: a.amount for a in option.requires}
        if any(needs.get(a.resource, float("-inf")) < a.amount for a in other.requires):
            continue
        first = place[id(other)] < place[id(option)]
        if _never_less(other, option, strictly=not first) and (
            implies(option.eligible_conditions, other.eligible_conditions) is True
        ):
            return other
    return None


def _never_less(better: Option, worse: Option, *, strictly: bool) -> bool:
    """Tell whether one utility is at least (or strictly above) the other at all times from 0 on."""
    times = {0}
    for utility in (better.utility, worse.utility):
        if isinstance(utility, UtilityTable):
            if not utility.points:
                return False
            times.update(t for t, _ in utility.points if t > 0)
    gaps = [utility_at(better.utility, t) - utility_at(worse.utility, t) for t in times]
    return all(g > 0 for g in gaps) if strictly else all(g >= 0 for g in gaps)
