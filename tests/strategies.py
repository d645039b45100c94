"""Hypothesis strategies that make whole valid values; here: CRL plans.

`plans()` uses every kind of node and every field. What it makes is accepted by the validator: ids are unique,
references exist and lead backward in the text, resources are declared and not asked twice on a way down, and
temporal conditions are satisfied by letting every node take no time at all or all the time in the world.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from hypothesis import strategies as st

from executive.crl.nodes import (
    Alternate,
    Block,
    Branch,
    ConcurrentBlock,
    FloatingContingency,
    Node,
    Option,
    Plan,
    Task,
)
from executive.crl.values import (
    Absolute,
    Amount,
    And,
    CapacityResource,
    Comparison,
    Condition,
    ConsumableResource,
    Expectation,
    IfNone,
    Interval,
    Known,
    Mode,
    Not,
    OnOptionFailure,
    OnResume,
    Operator,
    Or,
    Point,
    Reference,
    Relative,
    Spread,
    Temporal,
    UnitResource,
    UtilityTable,
    Value,
)

KEYS = ("battery-energy", "tilt", "trackerstate", "novelty", "soc")
WORDS = st.sampled_from(
    ["tracked", "lost", "navcam", "W1", "a b", "5", "", "nil", "t", 'say "no"', "é\\", ":x"]
)
NAMES = st.sampled_from(["camera", "x", "wrt_frame", "dwell", "target", "n.1", "*all*"])
ACTIONS = ("image", "navigate", "heat", "wait", "place")

numbers = st.one_of(
    st.integers(-1000, 100_000),
    st.floats(-1e6, 1e6, allow_nan=False, allow_infinity=False),
    st.sampled_from([0.1, 1e-7, 1.5e-5, 1e21, -2.5, 123456789.125]),
)
amounts = st.one_of(st.integers(0, 5000), st.floats(0, 5000, allow_nan=False))
requirements = st.lists(st.builds(Amount, st.just("energy"), amounts), max_size=1).map(tuple)
values: st.SearchStrategy[Value] = st.one_of(numbers, WORDS, st.booleans())
parameters = st.dictionaries(NAMES, values, max_size=3)
probabilities = st.one_of(st.none(), st.floats(0, 1, allow_nan=False), st.sampled_from([0, 1]))
names = st.one_of(st.none(), WORDS)


@dataclass
class Book:
    """What has been used while a plan is being made."""

    ids: int = 0
    finished: list[str] = field(default_factory=list)
    """Nodes of the tree in hand that stand before the present one and outside its options."""

    def new_id(self, prefix: str) -> str:
        self.ids += 1
        return f"{prefix}{self.ids}"


def leaf_conditions(nodes: tuple[str, ...] = ()) -> st.SearchStrategy[Condition]:
    arguments = st.lists(
        st.one_of(st.sampled_from(["Rock1", "t", "x y"]), st.integers(0, 9)), max_size=2
    ).map(tuple)
    options: list[st.SearchStrategy[Condition]] = [
        st.builds(
            Comparison,
            st.sampled_from(KEYS),
            arguments,
            st.sampled_from([Operator.EQ, Operator.NE]),
            values,
        ),
        st.builds(Comparison, st.sampled_from(KEYS), arguments, st.sampled_from(list(Operator)), numbers),
        st.builds(Comparison, st.just("time"), st.just(()), st.just(Operator.GE), st.integers(0, 600)),
        st.builds(Known, st.sampled_from(KEYS), arguments),
    ]
    if nodes:
        node = st.sampled_from(nodes)
        outcome = st.sampled_from(["succeeded", "failed", "aborted", "skipped"])
        options.append(
            st.builds(Comparison, st.just("outcome"), st.tuples(node), st.just(Operator.EQ), outcome)
        )
        options.append(
            st.builds(
                Comparison, st.just("attempts"), st.tuples(node), st.just(Operator.LE), st.integers(0, 3)
            )
        )
    return st.one_of(options)


def conditions(nodes: tuple[str, ...] = ()) -> st.SearchStrategy[Condition]:
    """Make conditions of a few levels."""

    def deeper(inner: st.SearchStrategy[Condition]) -> st.SearchStrategy[Condition]:
        parts = st.lists(inner, max_size=3).map(tuple)
        return st.one_of(st.builds(And, parts), st.builds(Or, parts), st.builds(Not, inner))

    return st.recursive(leaf_conditions(nodes), deeper, max_leaves=4)


def condition_lists(nodes: tuple[str, ...] = ()) -> st.SearchStrategy[tuple[Condition, ...]]:
    return st.one_of(st.just(()), st.lists(conditions(nodes), max_size=2).map(tuple))


def _late_interval(draw: st.DrawFn) -> Interval:
    """Make an interval with a lower bound of at most 0 and an upper bound that is far away."""
    lo = draw(st.sampled_from([None, 0, -1500, -60_000]))
    hi = draw(st.sampled_from([None, 10_000_000, 86_400_250]))
    return Interval(lo, hi)


def _temporals(draw: st.DrawFn, book: Book) -> tuple[Temporal, ...]:
    found: list[Temporal] = []
    for kind in draw(st.lists(st.sampled_from(["absolute", "relative", "reference"]), max_size=2)):
        interval = _late_interval(draw)
        if kind == "absolute":
            found.append(Absolute(interval))
        elif kind == "relative":
            found.append(Relative(interval))
        elif book.finished:
            node = draw(st.sampled_from(book.finished))
            found.append(Reference(node, draw(st.sampled_from(list(Point))), interval))
    return tuple(found)


def _tables(draw: st.DrawFn) -> Any:
    if draw(st.booleans()):
        return draw(numbers)
    times = draw(st.lists(st.integers(0, 10_000_000), min_size=1, max_size=4, unique=True))
    return UtilityTable(tuple((t, draw(numbers)) for t in sorted(times)))


def _common(draw: st.DrawFn, book: Book, held: frozenset[str], kind: str) -> dict[str, Any]:
    fields: dict[str, Any] = {"id": book.new_id(kind[0])}
    known = tuple(book.finished)
    if draw(st.booleans()):
        return fields
    chance = st.sampled_from([False, False, True])
    if draw(chance):
        fields["name"] = draw(names)
    for name in ("start_conditions", "wait_for_conditions", "maintain_conditions", "end_conditions"):
        if draw(chance):
            fields[name] = draw(condition_lists(known))
    if draw(chance):
        fields["start_temporal_conditions"] = _temporals(draw, book)
    if draw(chance):
        fields["end_temporal_conditions"] = _temporals(draw, book)
    if draw(chance):
        fields["duration"] = Interval(
            draw(st.sampled_from([None, 0])), draw(st.sampled_from([None, 50_000_001]))
        )
    if draw(chance):
        fields["continue_on_failure"] = True
    if draw(chance):
        free = sorted({"arm", "mast", "power"} - held)
        picked = draw(st.lists(st.sampled_from(free), unique=True, max_size=2)) if free else []
        fields["uses"] = tuple(
            Amount(name, draw(st.sampled_from([1, 2.5, 10])) if name == "power" else 1) for name in picked
        )
    if draw(chance):
        fields["requires"] = draw(
            st.lists(st.builds(Amount, st.just("energy"), amounts), max_size=1).map(tuple)
        )
    fields |= _worth(draw, chance)
    return fields


def _worth(draw: st.DrawFn, chance: st.SearchStrategy[bool]) -> dict[str, Any]:
    fields: dict[str, Any] = {}
    if draw(chance):
        fields["priority"] = draw(st.one_of(st.integers(0, 100), st.floats(0, 100, allow_nan=False)))
    if draw(chance):
        fields["reward"] = draw(numbers)
    if draw(chance):
        fields["probability"] = draw(probabilities)
    if draw(chance):
        spread = st.one_of(st.integers(-9, 99), st.floats(0, 1e3, allow_nan=False))
        expectation = st.builds(Expectation, st.sampled_from(["time", "energy", "data"]), numbers, spread)
        fields["expectations"] = draw(st.lists(expectation, max_size=2).map(tuple))
    if draw(chance):
        fields["metadata"] = draw(parameters)
    return fields


def _node(draw: st.DrawFn, book: Book, depth: int, held: frozenset[str]) -> Node:
    kinds = ["task"] if depth <= 0 else ["task", "block", "concurrent", "branch"]
    kind = draw(st.sampled_from(kinds))
    fields = _common(draw, book, held, kind)
    below = held | {a.resource for a in fields.get("uses", ())}
    node: Node
    if kind == "task":
        if draw(st.booleans()):
            fields["parameters"] = draw(parameters)
        if draw(st.sampled_from([False, False, True])):
            fields["retries"] = draw(st.integers(0, 3))
            fields["retry_delay_ms"] = draw(st.sampled_from([0, 1, 1500, 60_000]))
            fields["interruptible"] = draw(st.booleans())
            fields["on_resume"] = draw(st.sampled_from(list(OnResume)))
        node = Task(action=draw(st.sampled_from(ACTIONS)), **fields)
    elif kind == "branch":
        options = []
        outside = list(book.finished)
        for _ in range(draw(st.integers(1, 3))):
            book.finished = list(outside)
            options.append(_option(draw, book, depth - 1, below))
        book.finished = outside
        node = Branch(
            options=tuple(options),
            if_none=draw(st.sampled_from(list(IfNone))),
            on_option_failure=draw(st.sampled_from(list(OnOptionFailure))),
            **fields,
        )
    else:
        count = draw(st.integers(1, 3))
        inside = tuple(_node(draw, book, depth - 1, below) for _ in range(count))
        node = (
            Block(node_list=inside, **fields)
            if kind == "block"
            else ConcurrentBlock(node_list=inside, **fields)
        )
    book.finished.append(node.id)
    return node


def _option(draw: st.DrawFn, book: Book, depth: int, held: frozenset[str]) -> Option:
    identifier = book.new_id("o")
    return Option(
        id=identifier,
        name=draw(names),
        utility=_tables(draw),
        probability=draw(probabilities),
        eligible_conditions=draw(condition_lists(tuple(book.finished))),
        requires=draw(requirements),
        node=_node(draw, book, depth, held),
        metadata=draw(parameters),
    )


@st.composite
def nodes(draw: st.DrawFn, depth: int = 2) -> Node:
    """Make one valid node with all below it."""
    return _node(draw, Book(), depth, frozenset())


@st.composite
def plans(draw: st.DrawFn, depth: int = 3, floating: bool = True, library: bool = True) -> Plan:
    """Make a valid plan of limited depth; `floating` and `library` allow those parts of the header."""
    book = Book()
    root = _node(draw, book, depth, frozenset())
    contingencies = []
    for _ in range(draw(st.integers(0, 2)) if floating else 0):
        book.finished = []
        contingencies.append(
            FloatingContingency(
                id=book.new_id("f"),
                name=draw(names),
                trigger_conditions=draw(st.lists(conditions(), min_size=1, max_size=2).map(tuple)),
                utility=_tables(draw),
                mode=draw(st.sampled_from(list(Mode))),
                scope=draw(st.sampled_from([None, root.id])),
                max_insertions=draw(st.integers(1, 3)),
                continue_on_failure=draw(st.booleans()),
                node=_node(draw, book, 1, frozenset({"arm", "mast", "power"})),
                metadata=draw(parameters),
            )
        )
    alternates = []
    for _ in range(draw(st.integers(0, 2)) if library else 0):
        book.finished = []
        alternates.append(
            Alternate(
                id=book.new_id("x"),
                name=draw(names),
                eligible_conditions=draw(condition_lists()),
                utility=_tables(draw),
                requires=draw(requirements),
                node=_node(draw, book, 1, frozenset()),
                metadata=draw(parameters),
            )
        )
    return Plan(
        id=draw(st.sampled_from([None, "sol5", "p-1", "*plan*"])),
        name=draw(names),
        version=draw(st.sampled_from([None, 0, 3])),
        epoch=draw(st.sampled_from([None, "2031-05-04T06:30:00Z", "2031-05-04T06:30:00.250+00:00"])),
        resources=(
            UnitResource("arm"),
            UnitResource("mast"),
            CapacityResource("power", draw(st.sampled_from([10, 120.5]))),
            ConsumableResource("energy", "battery-energy", draw(st.sampled_from([0, 20_000, 0.5]))),
        ),
        floating=tuple(contingencies),
        library=tuple(alternates),
        expectation_spread=draw(st.sampled_from(list(Spread))),
        overrun_penalty=draw(st.sampled_from([0, 12.5])),
        budgets=draw(
            st.sampled_from([(), (Amount("time", 14_400),), (Amount("energy", 1e6), Amount("time", 1))])
        ),
        node=root,
        metadata=draw(parameters),
    )
