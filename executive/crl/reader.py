"""Text to plan: the grammar of section 2, read so that one mistake does not hide the next.

Forms of nodes are gathered from the outside in and built from the inside out, both without recursion, so that
depth costs nothing and cannot overflow; what cannot be read is reported and replaced by its default. Which
fields a form has, and what they hold, stands in `nodes.py` alone.
"""

from __future__ import annotations

import difflib
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from executive.crl import fields as f
from executive.crl.collector import paused_collector
from executive.crl.declaration import STRUCTURE, Declared, Syntax
from executive.crl.errors import CrlSyntaxError, Finding
from executive.crl.lexer import Atom, Form, Item, Kind, read_forms
from executive.crl.nodes import (
    FORMS,
    NODE_KINDS,
    Alternate,
    FloatingContingency,
    Node,
    Option,
    Plan,
    Task,
)
from executive.crl.syntax import codec
from executive.crl.values import LineTable

MAX_DEPTH = f.MAX_DEPTH
MAX_NODES = 100_000


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


Front = Callable[[list[Item], LineTable], list[Item]]
"""What makes plain CRL of the lists of a source."""


def read(text: str, *, sources: bool = True, front: Front | None = None) -> Reading:
    """Read a text as far as possible and report all that is wrong with its form.

    With `sources` False the plan carries no places, for a text that nobody will see. A `front` end expands
    the text first (`expand.expand_items`).
    """
    text = text.removeprefix("\ufeff")
    lines = LineTable(text)
    try:
        forms = read_forms(text, lines)
        form = _single(forms if front is None else front(forms, lines), lines)
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
        raise CrlSyntaxError("not a plan: the text is empty", code="E004", line=1, column=1)
    first = forms[0]
    line, column = lines.position(first.offset)
    if not isinstance(first, Form) or not first:
        hint = "a plan is (plan ... :node ...) or a single node such as (task :id a :action image)"
        raise CrlSyntaxError(
            "not a plan: the text does not begin with a form",
            code="E004",
            line=line,
            column=column,
            hint=hint,
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
        self.full: set[str] = set()
        """Limits that were reported as passed."""

    # -- from the outside in -----------------------------------------------------

    def plan(self, form: Form) -> Plan:
        head = _head(form)
        if head == "plan":
            values, places = self._fields(form, "plan")
        else:
            if head in FORMS and head not in NODE_KINDS:
                hint = "a file holds a plan or a node"
                self.report.add("E010", f'"{head}" cannot stand alone', form[0], hint=hint)
            values, places = {"node": form}, {}
        self._label("plan", values.get("id"))
        label = self.report.label
        if "node" in values:
            values["node"] = self._tree(values["node"])
        else:
            if head == "plan" and "node" not in places:
                self.report.add("E013", 'field ":node" is missing', form)
            values["node"] = self._hole(form)
        for declared in FORMS["plan"].structure:
            if declared.holds and declared.word in values:
                values[declared.word] = self._held(values[declared.word], declared, (label, ""))
        return Plan(source=self.report.source(form, places), **values)

    def _held(self, item: Item, declared: Declared, owner: tuple[str, str]) -> tuple[Any, ...]:
        """Read the forms that a field holds; `owner` is label and id of the form that it belongs to."""
        report = self.report
        report.label, report.node, report.field = *owner, declared.word
        needed = f"a list of {declared.word}" if owner[1] else f"a list of {declared.holds} forms"
        found: list[Option | FloatingContingency | Alternate] = []
        for entry in f.items_of(report, item, needed):
            form = self._holder(entry, declared.holds)
            if form is not None:
                found.append(form)
            report.label, report.node, report.field = *owner, declared.word
        return tuple(found)

    def _holder(self, item: Item, kind: str) -> Option | FloatingContingency | Alternate | None:
        """Read a contingency, an alternate, or an option (whose node is built already)."""
        head = _head(item)
        if head != kind or not isinstance(item, Form):
            what = f'"{head}"' if head is not None else self.report.show(item)
            self.report.add("E010", f'":{self.report.field}" holds {kind} forms only, found {what}', item)
            if head not in FORMS or not isinstance(item, Form):
                return None
        values, places = self._fields(item, kind)
        source = self.report.source(item, places)
        label, node_id = self.report.label, self.report.node
        inside = kind == "option"
        if "node" in values:
            self.report.field = "node"
            if inside:
                values["node"] = self._built(values["node"])
            else:
                self.holder = kind
                values["node"] = self._tree(values["node"])
        else:
            if inside and "node" not in places:
                self.report.add("E018", "option without a node", item)
            values["node"] = self._hole(item)
        self.report.label, self.report.node = label, node_id
        made: Option | FloatingContingency | Alternate = FORMS[kind].cls(
            **{"id": "", "source": source} | values
        )
        return made

    def _tree(self, item: Any) -> Node:
        """Build the node of a form, and all below it, children first."""
        order: list[Form] = []
        stack: list[tuple[Item, int]] = [(item, 1)]
        while stack:
            top, depth = stack.pop()
            if not isinstance(top, Form) or not top:
                continue
            if depth > MAX_DEPTH:
                self._passed("deep", f"nodes are nested deeper than {MAX_DEPTH}", top)
                continue
            self.count += 1
            if self.count > MAX_NODES:
                self._passed("many", f"more than {MAX_NODES} nodes", top)
                break
            order.append(top)
            stack.extend((child, depth + 1) for child in reversed(_child_items(top)))
        for form in reversed(order):
            self.built[id(form)] = self._node(form)
        self.report.field = "node"
        return self._built(item)

    def _passed(self, limit: str, message: str, form: Form) -> None:
        if limit not in self.full:
            self.full.add(limit)
            self.report.add("E090", message, form)

    def _built(self, item: Item) -> Node:
        node = self.built.get(id(item))
        if node is not None:
            return node
        if not (isinstance(item, Form) and item and self.full):
            self.report.bad(
                item, "a node", hint=f"a node is a {', '.join(NODE_KINDS[:-1])} or {NODE_KINDS[-1]}"
            )
        return self._hole(item)

    def _hole(self, item: Item) -> Node:
        return Task(id="", action="", source=self.report.source(item))

    # -- from the inside out -----------------------------------------------------

    def _node(self, form: Form) -> Node:
        kind = _shape(form)
        head = _head(form)
        known = head in NODE_KINDS
        if not known:
            self._unknown(form, head)
        values, places = self._fields(form, kind, strict=known)
        owner = self.report.label, self.report.node
        made: dict[str, Any] = {"source": self.report.source(form, places)}
        for declared in FORMS[kind].fields.values():
            name = declared.attribute
            if declared.syntax not in STRUCTURE:
                if declared.required:
                    made[name] = ""
                continue
            held = values.pop(name, Form(form.offset))
            self.report.field = declared.word
            if declared.holds:
                made[name] = self._held(held, declared, owner)
            else:
                items = f.items_of(self.report, held, "a list of nodes")
                made[name] = tuple(self._built(item) for item in items)
        node: Node = FORMS[kind].cls(**made | values)
        return node

    def _unknown(self, form: Form, head: str | None) -> None:
        """Report a node form whose head is not a kind of node."""
        self._label("node", _raw(form, "id"))
        if head == "floating-contingency" and self.holder == head:
            self.report.add("E102", "a contingency stands inside a contingency", form[0])
        elif head in FORMS:
            self.report.add("E010", f'"{head}" is not a node', form[0])
        else:
            hint = nearest(head or "", NODE_KINDS)
            self.report.add("E010", f"unknown kind {self.report.show(form[0])}", form[0], hint=hint)

    def _label(self, kind: str, identifier: object) -> None:
        if isinstance(identifier, (Atom, Form)):
            identifier = f.symbol_of(identifier)
        name = identifier if isinstance(identifier, str) else ""
        self.report.label = f"{kind} {name}" if name else kind
        self.report.node = "" if kind == "plan" else name

    def _fields(self, form: Form, kind: str, *, strict: bool = True) -> tuple[dict[str, Any], dict[str, int]]:
        """Read the fields of a form; structural ones stay items. Also return where each value stands."""
        report = self.report
        raw_id = _raw(form, "id")
        if raw_id is not None and (name := f.symbol_of(raw_id)) is not None and kind != "plan":
            self.ids.add(name)
        self._label(kind, raw_id)
        table = FORMS[kind].fields
        values: dict[str, Any] = {}
        places: dict[str, int] = {}
        at = 1
        while at < len(form):
            item = form[at]
            following = form[at + 1] if at + 1 < len(form) else None
            at += 1
            if not (isinstance(item, Atom) and item.kind is Kind.KEYWORD):
                hint = "a field begins with a colon"
                report.add("E014", f"unexpected {report.show(item)}", item, hint=hint)
                continue
            declared = table.get(str(item.value))
            if declared is None:
                if strict:
                    hint = _field_hint(str(item.value), kind)
                    report.add("E011", f'field ":{item.value}" is not allowed here', item, hint=hint)
                at += following is not None and not _is_field(following, table)
                continue
            if _is_field(following, table) and isinstance(declared.syntax, Syntax):
                following = None
            at += following is not None
            self._field(item, following, declared, values, places)
        for declared in table.values():
            missing = declared.required and declared.word not in places and strict
            if missing and kind != "plan" and (kind, declared.word) != ("option", "node"):
                report.add("E013", f'field ":{declared.word}" is missing', form[0])
        return values, places

    def _field(
        self,
        item: Atom,
        given: Item | None,
        declared: Declared,
        values: dict[str, Any],
        places: dict[str, int],
    ) -> None:
        """Read the value of one field."""
        report = self.report
        if given is None and not declared.flag:
            report.add("E014", f'":{declared.word}" needs a value, found none', item)
            places.setdefault(declared.word, item.offset)
            return
        if given is not None:
            report.field = declared.word
        if declared.word in places:
            report.add("E012", f'field ":{declared.word}" is given twice', item)
            return
        places[declared.word] = item.offset if given is None else given.offset
        if given is None:
            value: object = True
        elif declared.syntax in STRUCTURE:
            value = given
        else:
            value = codec(declared.syntax).read(report, given)
        if value is not f.BAD:
            values[declared.attribute] = value


# -- forms as they stand -----------------------------------------------------------


def _head(item: Item) -> str | None:
    return f.symbol_of(item[0]) if isinstance(item, Form) and item else None


def _raw(form: Form, name: str) -> Item | None:
    """Return the item behind a field's name."""
    for at, item in enumerate(form):
        if isinstance(item, Atom) and item.kind is Kind.KEYWORD and item.value == name:
            return form[at + 1] if at + 1 < len(form) else None
    return None


def _shape(form: Form) -> str:
    """Return the kind of a node form; a form with an unknown head is read by the fields it has."""
    head = _head(form)
    if head in NODE_KINDS:
        return str(head)
    likely = (
        kind
        for kind in NODE_KINDS
        for declared in FORMS[kind].structure
        if _raw(form, declared.word) is not None
    )
    return next(likely, NODE_KINDS[0])


def _child_items(form: Form) -> list[Item]:
    """Return the forms of the nodes directly below one, those of held forms included."""
    found: list[Item] = []
    for declared in FORMS[_shape(form)].structure:
        listed = _raw(form, declared.word)
        if not isinstance(listed, Form):
            continue
        if declared.holds:
            inner = [_raw(entry, "node") for entry in listed if isinstance(entry, Form)]
            found += [node for node in inner if node is not None]
        else:
            found += listed
    return found


def _is_field(item: Item | None, table: Mapping[str, Declared]) -> bool:
    return isinstance(item, Atom) and item.kind is Kind.KEYWORD and item.value in table


def _field_hint(name: str, kind: str) -> str:
    if owners := [other for other, form in FORMS.items() if name in form.fields]:
        return f'":{name}" is a field of {", ".join(owners)}'
    return nearest(name, FORMS[kind].fields)
