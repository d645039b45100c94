"""Text to plan: the grammar of section 2, read so that one mistake does not hide the next.

Forms of nodes are gathered from the outside in and built from the inside out, both without recursion, so that
depth costs nothing and cannot overflow; what cannot be read is reported and replaced by its default.
"""

from __future__ import annotations

import difflib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from executive.crl import fields as f
from executive.crl.collector import paused_collector
from executive.crl.errors import CrlSyntaxError, Finding
from executive.crl.lexer import Atom, Form, Item, Kind, read_forms
from executive.crl.nodes import (
    Alternate,
    Block,
    Branch,
    ConcurrentBlock,
    FloatingContingency,
    IfNone,
    LineTable,
    Mode,
    Node,
    OnOptionFailure,
    OnResume,
    Option,
    Plan,
    Spread,
    Task,
)

MAX_DEPTH = 200
MAX_NODES = 100_000

FieldTable = Mapping[str, f.FieldReader]


def _structure(report: f.Report, item: Item) -> object:
    """Mark a field that holds nodes: the reader of its form fills it in."""
    return item


COMMON: FieldTable = {
    "id": f.read_symbol,
    "name": f.read_string,
    "start-conditions": f.read_conditions,
    "wait-for-conditions": f.read_conditions,
    "maintain-conditions": f.read_conditions,
    "end-conditions": f.read_conditions,
    "start-temporal-conditions": f.read_temporals,
    "end-temporal-conditions": f.read_temporals,
    "duration": f.read_interval,
    "continue-on-failure": f.read_truth,
    "uses": f.read_uses,
    "requires": f.read_requires,
    "priority": f.read_number,
    "reward": f.read_number,
    "probability": f.read_number,
    "expectations": f.read_expectations,
    "metadata": f.read_parameters,
}
"""Fields of every node, in the order of the canonical text."""

FIELDS: Mapping[str, FieldTable] = {
    "task": {
        **COMMON,
        "action": f.read_symbol,
        "parameters": f.read_parameters,
        "retries": f.read_retries,
        "retry-delay": f.read_delay,
        "interruptible": f.read_truth,
        "on-resume": f.choice(OnResume),
    },
    "block": {**COMMON, "node-list": _structure},
    "concurrent-block": {**COMMON, "node-list": _structure},
    "branch": {
        **COMMON,
        "options": _structure,
        "if-none": f.choice(IfNone),
        "on-option-failure": f.choice(OnOptionFailure),
    },
    "option": {
        "id": f.read_symbol,
        "name": f.read_string,
        "utility": f.read_utility,
        "probability": f.read_number,
        "eligible-conditions": f.read_conditions,
        "requires": f.read_requires,
        "node": _structure,
        "metadata": f.read_parameters,
    },
    "floating-contingency": {
        "id": f.read_symbol,
        "name": f.read_string,
        "trigger-conditions": f.read_conditions,
        "utility": f.read_utility,
        "mode": f.choice(Mode),
        "scope": f.read_symbol,
        "max-insertions": f.read_insertions,
        "continue-on-failure": f.read_truth,
        "node": _structure,
        "metadata": f.read_parameters,
    },
    "alternate": {
        "id": f.read_symbol,
        "name": f.read_string,
        "eligible-conditions": f.read_conditions,
        "utility": f.read_utility,
        "requires": f.read_requires,
        "node": _structure,
        "metadata": f.read_parameters,
    },
    "plan": {
        "id": f.read_symbol,
        "name": f.read_string,
        "version": f.read_integer,
        "epoch": f.read_epoch,
        "resources": f.read_resources,
        "floating": _structure,
        "library": _structure,
        "expectation-spread": f.choice(Spread),
        "overrun-penalty": f.read_number,
        "budgets": f.read_budgets,
        "node": _structure,
        "metadata": f.read_parameters,
    },
}

NODE_KINDS = ("task", "block", "concurrent-block", "branch")
_REQUIRED: Mapping[str, tuple[str, ...]] = {
    "task": ("id", "action"),
    "block": ("id", "node-list"),
    "concurrent-block": ("id", "node-list"),
    "branch": ("id", "options"),
    "option": ("id",),
    "floating-contingency": ("id", "node"),
    "alternate": ("id", "node"),
    "plan": ("node",),
}
_FLAGS = frozenset({"continue-on-failure", "interruptible"})
_KEYWORD_VALUED = frozenset({"on-resume", "if-none", "on-option-failure", "mode", "expectation-spread"})
_ATTRIBUTE = {name: name.replace("-", "_") for table in FIELDS.values() for name in table}
_ATTRIBUTE["retry-delay"] = "retry_delay_ms"


@dataclass(frozen=True, slots=True)
class Reading:
    """What a text says: the plan as far as it could be read, and what is wrong with its form.

    `plan` is None when the findings end the analysis. A plan with findings has holes filled with defaults and
    is good for further checks only; a hole where a node is missing is a task without id. `ids` are all words
    that stand after `:id`.
    """

    plan: Plan | None
    findings: tuple[Finding, ...]
    ids: frozenset[str] = frozenset()


def read(text: str, *, sources: bool = True) -> Reading:
    """Read a text as far as possible and report all that is wrong with its form.

    With `sources` False the plan carries no places, for a text that nobody will see.
    """
    text = text.removeprefix("\ufeff")
    lines = LineTable(text)
    try:
        forms = read_forms(text, lines)
        form = _single(forms, lines)
    except CrlSyntaxError as error:
        return Reading(None, (error.finding(),))
    reader = _Reader(text, lines, sources)
    plan = reader.plan(form)
    return Reading(plan, tuple(reader.report.findings), frozenset(reader.ids))


def parse(text: str) -> Plan:
    """Return the plan of a text whose form is right; what it means is the validator's business.

    Raises
    ------
    CrlSyntaxError
        With line, column and code of the first thing that is wrong with the form.
    """
    with paused_collector():
        reading = read(text)
    errors = [finding for finding in reading.findings if finding.is_error]
    if errors:
        first = min(errors, key=lambda e: (e.line, e.column))
        raise CrlSyntaxError(
            first.message,
            code=first.code,
            line=first.line,
            column=first.column,
            node=first.node,
            hint=first.hint,
        )
    assert reading.plan is not None
    return reading.plan


def _single(forms: list[Item], lines: LineTable) -> Form:
    if not forms:
        raise CrlSyntaxError("no plan: the text is empty", code="E004", line=1, column=1)
    first = forms[0]
    line, column = lines.position(first.offset)
    if not isinstance(first, Form) or not first:
        hint = "a plan is (plan ... :node ...) or a single node such as (task :id a :action image)"
        raise CrlSyntaxError(
            "no plan: the text does not begin with a form", code="E004", line=line, column=column, hint=hint
        )
    if len(forms) > 1:
        line, column = lines.position(forms[1].offset)
        hint = "one file holds one plan; put several nodes in a block"
        raise CrlSyntaxError(
            "text after the end of the plan", code="E003", line=line, column=column, hint=hint
        )
    return first


def nearest(name: str, names: Iterable[str]) -> str:
    """Return a hint with the most similar name, or an empty one."""
    match = difflib.get_close_matches(name, list(names)[:5000], n=1, cutoff=0.5)
    return f'did you mean "{match[0]}"?' if match else ""


class _Reader:
    def __init__(self, text: str, lines: LineTable, sources: bool) -> None:
        self.report = f.Report(text, lines, sources)
        self.ids: set[str] = set()
        self.built: dict[int, Node] = {}
        self.holder = ""
        self.count = 0
        self.too_deep = False
        self.too_many = False

    # -- from the outside in -----------------------------------------------------

    def plan(self, form: Form) -> Plan:
        head = self._head(form)
        if head == "plan":
            values, places = self._fields(form, "plan")
        elif head in NODE_KINDS or head not in FIELDS:
            values, places = {"node": form}, {}
        else:
            self.report.add(
                "E010",
                f'"{head}" cannot stand alone',
                form[0],
                hint="a file holds a plan or a node",
            )
            values, places = {"node": form}, {}
        self._label("plan", values.get("id"))
        label = self.report.label
        if "node" not in values:
            if head == "plan" and "node" not in places:
                self.report.add("E013", 'field ":node" is missing', form)
            node = self._hole(form)
        else:
            node = self._tree(values.pop("node"), "node")
        held: dict[str, list[FloatingContingency | Alternate | Option]] = {}
        for name, kind in (("floating", "floating-contingency"), ("library", "alternate")):
            held[name] = []
            if name not in values:
                continue
            self._restore(label, name)
            for item in f.items_of(self.report, values.pop(name), f"a list of {kind} forms"):
                holder = self._holder(item, kind)
                if holder is not None:
                    held[name].append(holder)
                self._restore(label, name)
        return Plan(
            node=node,
            floating=tuple(c for c in held["floating"] if isinstance(c, FloatingContingency)),
            library=tuple(a for a in held["library"] if isinstance(a, Alternate)),
            source=self.report.source(form, places),
            **values,
        )

    def _restore(self, label: str, field: str) -> None:
        self.report.label, self.report.node, self.report.field = label, "", field

    def _holder(self, item: Item, kind: str) -> FloatingContingency | Alternate | Option | None:
        """Read a contingency, an alternate, or an option (whose node is built already)."""
        if self._head(item) != kind or not isinstance(item, Form):
            found = self._head(item)
            what = f'"{found}"' if found is not None else self.report.show(item)
            self.report.add("E010", f'":{self.report.field}" holds {kind} forms only, found {what}', item)
            if found not in FIELDS or not isinstance(item, Form):
                return None
        values, places = self._fields(item, kind)
        source = self.report.source(item, places)
        label, node_id = self.report.label, self.report.node
        if "node" in values:
            self.report.field = "node"
            if kind != "option":
                self.holder = kind
            node = (
                self._tree(values.pop("node"), "node")
                if kind != "option"
                else self._built(values.pop("node"))
            )
        else:
            if kind == "option" and "node" not in places:
                self.report.add("E018", "option without a node", item)
            node = self._hole(item)
        self.report.label, self.report.node = label, node_id
        identifier = values.pop("id", "")
        if kind == "option":
            return Option(id=identifier, node=node, source=source, **values)
        if kind == "alternate":
            return Alternate(id=identifier, node=node, source=source, **values)
        return FloatingContingency(id=identifier, node=node, source=source, **values)

    def _tree(self, item: Any, field: str) -> Node:
        """Build the node of a form, and all below it, children first."""
        order: list[Form] = []
        stack: list[tuple[Item, int]] = [(item, 1)]
        while stack:
            top, depth = stack.pop()
            if not isinstance(top, Form) or not top:
                continue
            if depth > MAX_DEPTH:
                if not self.too_deep:
                    self.too_deep = True
                    self.report.add("E090", f"nodes are nested deeper than {MAX_DEPTH}", top)
                continue
            self.count += 1
            if self.count > MAX_NODES:
                if not self.too_many:
                    self.too_many = True
                    self.report.add("E090", f"more than {MAX_NODES} nodes", top)
                break
            order.append(top)
            below = [(child, depth + 1) for child in self._child_items(top)]
            below.reverse()
            stack.extend(below)
        for form in reversed(order):
            self.built[id(form)] = self._node(form)
        self.report.field = field
        return self._built(item)

    def _built(self, item: Item) -> Node:
        node = self.built.get(id(item))
        if node is not None:
            return node
        if not (isinstance(item, Form) and item and (self.too_deep or self.too_many)):
            self.report.bad(item, "a node", hint="a node is a task, block, concurrent-block or branch")
        return self._hole(item)

    def _hole(self, item: Item) -> Node:
        return Task(id="", action="", source=self.report.source(item))

    def _child_items(self, form: Form) -> list[Item]:
        shape = self._shape(form)
        if shape == "branch":
            options = self._raw(form, "options")
            nodes = []
            for option in options if isinstance(options, Form) else ():
                if isinstance(option, Form) and (node := self._raw(option, "node")) is not None:
                    nodes.append(node)
            return nodes
        if shape in ("block", "concurrent-block"):
            listed = self._raw(form, "node-list")
            return list(listed) if isinstance(listed, Form) else []
        return []

    def _shape(self, form: Form) -> str:
        """Return the kind of a node form; a form with an unknown head is read by the fields it has."""
        head = self._head(form)
        if head in NODE_KINDS:
            return str(head)
        if self._raw(form, "options") is not None:
            return "branch"
        return "task" if self._raw(form, "node-list") is None else "block"

    @staticmethod
    def _raw(form: Form, name: str) -> Item | None:
        for at, item in enumerate(form):
            if isinstance(item, Atom) and item.kind is Kind.KEYWORD and item.value == name:
                return form[at + 1] if at + 1 < len(form) else None
        return None

    @staticmethod
    def _head(item: Item) -> str | None:
        return f.symbol_of(item[0]) if isinstance(item, Form) and item else None

    # -- from the inside out -----------------------------------------------------

    def _node(self, form: Form) -> Node:
        kind = self._shape(form)
        head = self._head(form)
        known = head in NODE_KINDS
        if not known:
            self._label("node", self._raw(form, "id"))
            found = self.report.show(form[0])
            if head == "floating-contingency" and self.holder == head:
                self.report.add("E102", "a contingency stands inside a contingency", form[0])
            elif head in FIELDS:
                self.report.add("E010", f'"{head}" is not a node', form[0])
            else:
                hint = nearest(head or "", NODE_KINDS)
                self.report.add("E010", f"unknown kind {found}", form[0], hint=hint)
        values, places = self._fields(form, kind, strict=known)
        source = self.report.source(form, places)
        label, node_id = self.report.label, self.report.node
        identifier = values.pop("id", "")
        if kind == "task":
            return Task(id=identifier, action=values.pop("action", ""), source=source, **values)
        self.report.field = "node-list"
        if kind == "branch":
            self.report.field = "options"
            options = []
            for item in f.items_of(
                self.report, values.pop("options", Form(form.offset)), "a list of options"
            ):
                options.append(self._holder(item, "option"))
                self.report.label, self.report.node, self.report.field = label, node_id, "options"
            found_options = tuple(o for o in options if isinstance(o, Option))
            return Branch(id=identifier, options=found_options, source=source, **values)
        items = f.items_of(self.report, values.pop("node_list", Form(form.offset)), "a list of nodes")
        nodes = tuple(self._built(item) for item in items)
        if kind == "block":
            return Block(id=identifier, node_list=nodes, source=source, **values)
        return ConcurrentBlock(id=identifier, node_list=nodes, source=source, **values)

    def _label(self, kind: str, identifier: object) -> None:
        if isinstance(identifier, (Atom, Form)):
            identifier = f.symbol_of(identifier)
        name = identifier if isinstance(identifier, str) else ""
        self.report.label = f"{kind} {name}" if name else kind
        self.report.node = "" if kind == "plan" else name

    def _fields(self, form: Form, kind: str, *, strict: bool = True) -> tuple[dict[str, Any], dict[str, int]]:
        """Read the fields of a form; structural ones stay items. Also return where each value stands."""
        report = self.report
        raw_id = self._raw(form, "id")
        if raw_id is not None and (name := f.symbol_of(raw_id)) is not None and kind != "plan":
            self.ids.add(name)
        self._label(kind, raw_id)
        table = FIELDS[kind]
        values: dict[str, Any] = {}
        places: dict[str, int] = {}
        at = 1
        size = len(form)
        while at < size:
            item = form[at]
            at += 1
            if not (isinstance(item, Atom) and item.kind is Kind.KEYWORD):
                report.add(
                    "E014", f"unexpected {report.show(item)}", item, hint="a field begins with a colon"
                )
                continue
            name = str(item.value)
            following = form[at] if at < size else None
            if name not in table:
                if strict:
                    report.add(
                        "E011",
                        f'field ":{name}" is not allowed here',
                        item,
                        hint=self._field_hint(name, kind),
                    )
                if following is not None and not self._is_field(following, table):
                    at += 1
                continue
            given = following
            if following is not None and name not in _KEYWORD_VALUED and self._is_field(following, table):
                given = None
            if given is None and name not in _FLAGS:
                report.add("E014", f'":{name}" needs a value, found none', item)
                places.setdefault(name, item.offset)
                continue
            if given is not None:
                at += 1
                report.field = name
            if name in places:
                report.add("E012", f'field ":{name}" is given twice', item)
                continue
            places[name] = item.offset if given is None else given.offset
            value = True if given is None else table[name](report, given)
            if value is not f.BAD:
                values[_ATTRIBUTE[name]] = value
        for name in _REQUIRED[kind]:
            if name not in places and strict and kind != "plan":
                report.add("E013", f'field ":{name}" is missing', form[0])
        return values, places

    @staticmethod
    def _is_field(item: Item, table: FieldTable) -> bool:
        return isinstance(item, Atom) and item.kind is Kind.KEYWORD and item.value in table

    @staticmethod
    def _field_hint(name: str, kind: str) -> str:
        if owners := [other for other, table in FIELDS.items() if name in table]:
            return f'":{name}" is a field of {", ".join(owners)}'
        return nearest(name, FIELDS[kind])
