"""The JSON form of a plan, and back.

A form is an object: its head is `kind`, each field has its name without colon, lists are arrays. Reading goes
by way of the text, so that both forms obey one grammar and give the same messages.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from executive.crl.declaration import STRUCTURE, Declared, Syntax
from executive.crl.errors import CrlFormError, CrlSyntaxError
from executive.crl.json_values import array, generic_tree, shown
from executive.crl.lexer import is_keyword_name, is_symbol
from executive.crl.nodes import FORMS, KIND_OF, Plan, walk_plan
from executive.crl.printer import flat
from executive.crl.reader import read
from executive.crl.syntax import codec
from executive.crl.trees import Tree

Json = dict[str, Any]

FIELDS: Mapping[str, Declared] = {
    word: field for form in FORMS.values() for word, field in form.fields.items()
}
"""Fields by their words; a word has the same syntax in all forms."""


# --- plan to JSON ---------------------------------------------------------------


def to_json(plan: Plan) -> Json:
    """Return the JSON form; fields at their default are left out. `from_json` gives an equal plan back."""
    done: dict[int, Json] = {}
    for node in reversed(list(walk_plan(plan))):
        done[id(node)] = _form(node, done)
    return _form(plan, done)


def _form(value: Any, done: Mapping[int, Json]) -> Json:
    kind = KIND_OF[type(value)]
    out: Json = {"kind": kind}
    last: Json = {}
    for word, declared in FORMS[kind].fields.items():
        held = getattr(value, declared.attribute)
        if not declared.required and held == declared.default:
            continue
        match declared.syntax:
            case Syntax.NODE:
                last[word] = done[id(held)]
            case Syntax.NODE_LIST:
                last[word] = [done[id(child)] for child in held]
            case Syntax.FORM_LIST:
                last[word] = [_form(form, done) for form in held]
            case syntax:
                out[word] = codec(syntax).encode(held)
    return out | last


# --- JSON to plan ---------------------------------------------------------------


def from_json(document: object) -> Plan:
    """Return the plan of a JSON form (parsed JSON: dictionaries and lists).

    Raises
    ------
    CrlFormError
        If the document is not the JSON form of a plan; the message names the member.
    """
    reading = read(json_to_text(document), sources=False)
    errors = [finding for finding in reading.findings if finding.is_error]
    if errors or reading.plan is None:
        first = errors[0]
        raise CrlFormError(f"{first.code}: {first.message}") from CrlSyntaxError(
            first.message, code=first.code, line=first.line, column=first.column, node=first.node
        )
    return reading.plan


def json_to_text(document: object) -> str:
    """Return CRL text that says what a JSON form says; its form is checked by whoever reads it."""
    return flat(_tree(document))


def _tree(document: object) -> list[Tree]:
    order: list[Json] = []
    stack: list[object] = [document]
    while stack:
        item = stack.pop()
        if not isinstance(item, dict):
            raise CrlFormError(f"a form is an object with a member kind, found {shown(item)}")
        order.append(item)
        for name, value in item.items():
            if _structural(name):
                stack.extend([value] if name == "node" else array(name, value))
    done: dict[int, list[Tree]] = {}
    for form in reversed(order):
        done[id(form)] = _form_tree(form, done)
    return done[id(order[0])]


def _structural(word: str) -> bool:
    return word in FIELDS and FIELDS[word].syntax in STRUCTURE


def _form_tree(form: Json, done: Mapping[int, list[Tree]]) -> list[Tree]:
    kind = form.get("kind")
    if not isinstance(kind, str) or not is_symbol(kind):
        raise CrlFormError(f'"kind" needs the head of a form, found {shown(kind)}')
    out: list[Tree] = [kind]
    for name, value in form.items():
        if name == "kind":
            continue
        if not is_keyword_name(name):
            raise CrlFormError(f"{shown(name)} is not a field of {kind}")
        out.append(f":{name}")
        if name == "node":
            out.append(done[id(value)])
        elif _structural(name):
            out.append([done[id(child)] for child in value])
        else:
            out.append(
                codec(FIELDS[name].syntax).decode(name, value)
                if name in FIELDS
                else generic_tree(name, value)
            )
    return out
