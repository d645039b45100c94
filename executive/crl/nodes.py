"""The forms of a plan as frozen values. Each field is declared here once: its type, its default, its syntax.

Reader, printer, JSON form, checks of form and the word list for the page follow from these declarations
(`declaration.py` reads them off). Fields stand in the order of the canonical text. No value knows its parent;
what stands in a text carries its place as `source`, which takes no part in equality.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field

from executive.crl.declaration import Form, Syntax, forms_of, of
from executive.crl.field_help import FIELD_HELP
from executive.crl.values import (
    Amount,
    Conditions,
    Expectation,
    IfNone,
    Interval,
    Mode,
    OnOptionFailure,
    OnResume,
    Operator,
    Relative,
    Resource,
    Source,
    Spread,
    Temporal,
    Utility,
    Value,
)

DEFAULT_PRIORITY = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeBase:
    """The fields that all four kinds of node have."""

    id: str = field(metadata=of(Syntax.SYMBOL))
    name: str | None = field(default=None, metadata=of(Syntax.STRING))
    start_conditions: Conditions = field(default=(), metadata=of(Syntax.CONDITIONS))
    wait_for_conditions: Conditions = field(default=(), metadata=of(Syntax.CONDITIONS))
    maintain_conditions: Conditions = field(default=(), metadata=of(Syntax.CONDITIONS))
    end_conditions: Conditions = field(default=(), metadata=of(Syntax.CONDITIONS))
    start_temporal_conditions: tuple[Temporal, ...] = field(default=(), metadata=of(Syntax.TEMPORALS))
    end_temporal_conditions: tuple[Temporal, ...] = field(default=(), metadata=of(Syntax.TEMPORALS))
    duration: Interval | None = field(default=None, metadata=of(Syntax.INTERVAL))
    continue_on_failure: bool = field(default=False, metadata=of(Syntax.TRUTH, flag=True))
    uses: tuple[Amount, ...] = field(default=(), metadata=of(Syntax.USES))
    requires: tuple[Amount, ...] = field(default=(), metadata=of(Syntax.REQUIRES))
    priority: float = field(default=DEFAULT_PRIORITY, metadata=of(Syntax.NUMBER))
    reward: float = field(default=0, metadata=of(Syntax.NUMBER))
    probability: float | None = field(default=None, metadata=of(Syntax.NUMBER))
    expectations: tuple[Expectation, ...] = field(default=(), metadata=of(Syntax.EXPECTATIONS))
    metadata: Mapping[str, Value] = field(default_factory=dict, hash=False, metadata=of(Syntax.PARAMETERS))
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Task(NodeBase):
    """One action of the rover."""

    action: str = field(metadata=of(Syntax.SYMBOL))
    parameters: Mapping[str, Value] = field(default_factory=dict, hash=False, metadata=of(Syntax.PARAMETERS))
    retries: int = field(default=0, metadata=of(Syntax.RETRIES))
    retry_delay_ms: int = field(default=0, metadata=of(Syntax.DELAY))
    interruptible: bool = field(default=True, metadata=of(Syntax.TRUTH, flag=True))
    on_resume: OnResume = field(default=OnResume.REATTACH, metadata=of(OnResume))


@dataclass(frozen=True, slots=True, kw_only=True)
class Block(NodeBase):
    """Children one after the other."""

    node_list: tuple[Node, ...] = field(metadata=of(Syntax.NODE_LIST))


@dataclass(frozen=True, slots=True, kw_only=True)
class ConcurrentBlock(NodeBase):
    """Children at the same time."""

    node_list: tuple[Node, ...] = field(metadata=of(Syntax.NODE_LIST))


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """One way on, with the conditions under which it competes and what it is worth."""

    id: str = field(metadata=of(Syntax.SYMBOL))
    name: str | None = field(default=None, metadata=of(Syntax.STRING))
    utility: Utility = field(default=0, metadata=of(Syntax.UTILITY))
    probability: float | None = field(default=None, metadata=of(Syntax.NUMBER))
    eligible_conditions: Conditions = field(default=(), metadata=of(Syntax.CONDITIONS))
    requires: tuple[Amount, ...] = field(default=(), metadata=of(Syntax.REQUIRES))
    node: Node = field(metadata=of(Syntax.NODE))
    metadata: Mapping[str, Value] = field(default_factory=dict, hash=False, metadata=of(Syntax.PARAMETERS))
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Branch(NodeBase):
    """A choice among options, made when the branch is reached."""

    options: tuple[Option, ...] = field(metadata=of(Syntax.FORM_LIST, holds="option"))
    if_none: IfNone = field(default=IfNone.FAIL, metadata=of(IfNone))
    on_option_failure: OnOptionFailure = field(default=OnOptionFailure.FAIL, metadata=of(OnOptionFailure))


Node = Task | Block | ConcurrentBlock | Branch


@dataclass(frozen=True, slots=True, kw_only=True)
class FloatingContingency:
    """A node inserted into its scope when the trigger holds; without a scope, into the root."""

    id: str = field(metadata=of(Syntax.SYMBOL))
    name: str | None = field(default=None, metadata=of(Syntax.STRING))
    trigger_conditions: Conditions = field(default=(), metadata=of(Syntax.CONDITIONS))
    utility: Utility = field(default=0, metadata=of(Syntax.UTILITY))
    mode: Mode = field(default=Mode.BETWEEN, metadata=of(Mode))
    scope: str | None = field(default=None, metadata=of(Syntax.SYMBOL))
    max_insertions: int = field(default=1, metadata=of(Syntax.INSERTIONS))
    continue_on_failure: bool = field(default=True, metadata=of(Syntax.TRUTH, flag=True))
    node: Node = field(metadata=of(Syntax.NODE))
    metadata: Mapping[str, Value] = field(default_factory=dict, hash=False, metadata=of(Syntax.PARAMETERS))
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Alternate:
    """A plan of the library, tried when the root has failed."""

    id: str = field(metadata=of(Syntax.SYMBOL))
    name: str | None = field(default=None, metadata=of(Syntax.STRING))
    eligible_conditions: Conditions = field(default=(), metadata=of(Syntax.CONDITIONS))
    utility: Utility = field(default=0, metadata=of(Syntax.UTILITY))
    requires: tuple[Amount, ...] = field(default=(), metadata=of(Syntax.REQUIRES))
    node: Node = field(metadata=of(Syntax.NODE))
    metadata: Mapping[str, Value] = field(default_factory=dict, hash=False, metadata=of(Syntax.PARAMETERS))
    source: Source | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """A whole plan: the header and the root node."""

    id: str | None = field(default=None, metadata=of(Syntax.SYMBOL))
    name: str | None = field(default=None, metadata=of(Syntax.STRING))
    version: int | None = field(default=None, metadata=of(Syntax.INTEGER))
    epoch: str | None = field(default=None, metadata=of(Syntax.EPOCH))
    resources: tuple[Resource, ...] = field(default=(), metadata=of(Syntax.RESOURCES))
    floating: tuple[FloatingContingency, ...] = field(
        default=(), metadata=of(Syntax.FORM_LIST, holds="floating-contingency")
    )
    library: tuple[Alternate, ...] = field(default=(), metadata=of(Syntax.FORM_LIST, holds="alternate"))
    expectation_spread: Spread = field(default=Spread.STDDEV, metadata=of(Spread))
    overrun_penalty: float = field(default=0, metadata=of(Syntax.NUMBER))
    budgets: tuple[Amount, ...] = field(default=(), metadata=of(Syntax.BUDGETS))
    node: Node = field(metadata=of(Syntax.NODE))
    metadata: Mapping[str, Value] = field(default_factory=dict, hash=False, metadata=of(Syntax.PARAMETERS))
    source: Source | None = field(default=None, compare=False, repr=False)

    def trees(self) -> tuple[Node, ...]:
        """Return the roots in text order of execution: main tree, contingencies, alternates."""
        return (self.node, *(c.node for c in self.floating), *(a.node for a in self.library))


# --- walking ------------------------------------------------------------------------


FORMS: Mapping[str, Form] = forms_of(
    Task, Block, ConcurrentBlock, Branch, Option, FloatingContingency, Alternate, Plan
)
"""All forms by their heads."""

NODE_KINDS = tuple(kind for kind, form in FORMS.items() if issubclass(form.cls, NodeBase))
KIND_OF: Mapping[type, str] = {form.cls: kind for kind, form in FORMS.items()}


def children(node: Node) -> tuple[Node, ...]:
    """Return the nodes directly below `node`; those of a branch are the nodes of its options."""
    form = FORMS[KIND_OF[type(node)]]
    below: list[Node] = []
    for declared in form.structure:
        value = getattr(node, declared.attribute)
        below += [held.node for held in value] if declared.holds else value
    return tuple(below)


def walk(node: Node) -> Iterator[Node]:
    """Yield `node` and everything below it in text order (pre-order), to any depth."""
    stack = [node]
    while stack:
        top = stack.pop()
        yield top
        stack.extend(reversed(children(top)))


def walk_plan(plan: Plan) -> Iterator[Node]:
    """Yield every node of a plan: main tree, then contingencies, then alternates."""
    for tree in plan.trees():
        yield from walk(tree)


def end_temporals(node: Node) -> tuple[Temporal, ...]:
    """Return the temporal conditions of the end, `:duration` among them."""
    if node.duration is None:
        return node.end_temporal_conditions
    source = node.source
    if source is not None and "duration" in source.fields:
        source = Source(source.fields["duration"], source.lines)
    return (*node.end_temporal_conditions, Relative(node.duration, source))


def language_words() -> dict[str, object]:
    """Return the words of the language for programs that colour or complete a text.

    `heads` are the heads of forms and `nodes` those that are nodes; `fields` are, by head, the names of
    fields (without colon) and, where a field takes one of a few words, those words. `required` are the fields
    that a form must have. `about` is a line of help by head, `about_fields` by field.
    """
    return {
        "heads": list(FORMS),
        "nodes": list(NODE_KINDS),
        "fields": {
            kind: {
                word: [str(w) for w in declared.syntax] if isinstance(declared.syntax, type) else []
                for word, declared in form.fields.items()
            }
            for kind, form in FORMS.items()
        },
        "required": {
            kind: [word for word, declared in form.fields.items() if declared.required]
            for kind, form in FORMS.items()
        },
        "about": {kind: str(form.cls.__doc__) for kind, form in FORMS.items()},
        "about_fields": {word: FIELD_HELP[word] for form in FORMS.values() for word in form.fields},
        "conditions": ["database", "known", "and", "or", "not"],
        "operators": [str(operator) for operator in Operator],
        "words": ["start", "end", "t", "true", "nil", ":relative", ":plus-infinity", ":minus-infinity"],
    }
