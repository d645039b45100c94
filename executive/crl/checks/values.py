"""Single values: E030, E032, E061 amounts, E070, E080, E084, W081, W083, W085."""

from __future__ import annotations

from executive.crl.checks.index import Index, Owner
from executive.crl.checks.names import named
from executive.crl.nodes import Alternate, Branch, FloatingContingency, Node, Option, Task, end_temporals
from executive.crl.printer import flat
from executive.crl.trees import interval_tree, number_text
from executive.crl.values import Absolute, IfNone, Interval, Source, Temporal, Utility, UtilityTable


def check_values(index: Index) -> None:
    """Check intervals, utilities, probabilities, expectations and counts."""
    for owner in named(index):
        if isinstance(owner, (Option, FloatingContingency, Alternate)):
            _utility(index, owner, owner.utility)
            if isinstance(owner, Option) and owner.probability is not None:
                _probability(index, owner, owner.probability)
        else:
            _node(index, owner)


def _node(index: Index, node: Node) -> None:
    if node.start_temporal_conditions:
        for temporal in node.start_temporal_conditions:
            _window(index, node, temporal, "start-temporal-conditions")
    if node.end_temporal_conditions:
        for temporal in node.end_temporal_conditions:
            _window(index, node, temporal, "end-temporal-conditions")
    if node.duration is not None:
        _interval(index, node, node.duration, "duration", "duration")
    if node.probability is not None:
        _probability(index, node, node.probability)
    for expectation in node.expectations:
        if expectation.spread < 0:
            message = f"the spread {number_text(expectation.spread)} of {expectation.name} is negative"
            hint = "its sign is ignored"
            index.add("W083", node, message, at=expectation.source or "expectations", hint=hint)
    if isinstance(node, Task):
        if node.retries < 0 or node.retries != int(node.retries):
            message = f'":retries" needs a non-negative integer, found "{node.retries}"'
            index.add("E084", node, message, at="retries")
    elif isinstance(node, Branch) and node.if_none is IfNone.WAIT and not _closes(end_temporals(node)):
        hint = 'give it a ":duration" or ":end-temporal-conditions" with an upper bound'
        index.add("W085", node, "may wait for an option for ever", at="if-none", hint=hint)
    if node.wait_for_conditions and not _closes(node.start_temporal_conditions):
        hint = 'give it ":start-temporal-conditions" with an upper bound'
        index.add("W085", node, "may wait to start for ever", at="wait-for-conditions", hint=hint)


def _closes(temporals: tuple[Temporal, ...]) -> bool:
    return any(t.interval.hi_ms is not None for t in temporals)


def _window(index: Index, node: Node, temporal: Temporal, field: str) -> None:
    if not _interval(index, node, temporal.interval, field, temporal.source or field):
        return
    if isinstance(temporal, Absolute):
        hi = temporal.interval.hi_ms
        if hi is not None and hi < 0:
            window = flat(interval_tree(temporal.interval))
            message = f'the window {window} of ":{field}" ends before the plan starts'
            index.add("E032", node, message, at=temporal.source or field)


def _interval(index: Index, node: Node, interval: Interval, field: str, at: Source | str) -> bool:
    lo, hi = interval.lo_ms, interval.hi_ms
    if lo is not None and hi is not None and lo > hi:
        message = f'":{field}" has an interval that ends before it begins: {flat(interval_tree(interval))}'
        index.add("E030", node, message, at=at)
        return False
    return True


def _probability(index: Index, owner: Owner, probability: float) -> None:
    if not 0 <= probability <= 1:
        message = f'":probability" must lie in 0 .. 1, found "{number_text(probability)}"'
        index.add("E080", owner, message, at="probability")
    elif probability == 0:
        hint = "0 is read as: not given"
        index.add("W081", owner, '":probability" is 0', at="probability", hint=hint)


def _utility(index: Index, owner: Owner, utility: Utility) -> None:
    if not isinstance(utility, UtilityTable):
        return
    at = utility.source or "utility"
    if not utility.points:
        index.add("E070", owner, 'the table of ":utility" is empty', at=at)
    for (before, _), (after, _) in zip(utility.points, utility.points[1:], strict=False):
        if after <= before:
            times = f"{number_text(before / 1000)} and {number_text(after / 1000)}"
            message = f'the times of ":utility" do not increase: {times}'
            index.add("E070", owner, message, at=at)
            break
