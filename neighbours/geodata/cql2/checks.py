"""Whether a filter asks for what is there, and compares like with like."""

from __future__ import annotations

from collections.abc import Mapping

from neighbours.geodata.cql2.errors import Cql2Error
from neighbours.geodata.cql2.expression import (
    Call,
    Constant,
    Expression,
    Form,
    Instant,
    Interval,
    Name,
    Shape,
)
from neighbours.geodata.cql2.reader import COMPARISONS, FOLDS, SPATIAL, TEMPORAL

TOLD: Mapping[Form, str] = {
    "text": "a text",
    "number": "a number",
    "flag": "true or false",
    "time": "a time",
    "geometry": "a geometry",
}


def checked(expression: Expression, known: Mapping[str, Form]) -> Expression:
    """Return the filter if it can be asked of features with these properties.

    Raises
    ------
    Cql2Error
        If there is no such property, or two things are compared that cannot be.
    """
    _check(expression, known)
    return expression


def _check(expression: Expression, known: Mapping[str, Form]) -> None:
    if not isinstance(expression, Call):
        return
    parts = expression.arguments
    if expression.name in {"and", "or", "not"}:
        for part in parts:
            _check(part, known)
        return
    forms = [form_of(part, known) for part in parts]
    if expression.name in SPATIAL:
        _require(expression.name, forms, "geometry")
    elif expression.name in TEMPORAL:
        _require(expression.name, forms, "time")
    elif expression.name == "like":
        _require("like", forms, "text")
    elif expression.name in COMPARISONS | {"between", "in"}:
        _require_alike(expression.name, forms)


def _require(name: str, forms: list[Form], wanted: Form) -> None:
    for form in forms:
        if form != wanted:
            raise Cql2Error(f"{name} takes {TOLD[wanted]}, not {TOLD[form]}")


def _require_alike(name: str, forms: list[Form]) -> None:
    if "geometry" in forms:
        raise Cql2Error(f"a geometry cannot be compared by {name!r}; there are s_equals and others")
    for form in forms[1:]:
        if form != forms[0]:
            raise Cql2Error(f"{TOLD[forms[0]]} and {TOLD[form]} cannot be compared by {name!r}")


def form_of(expression: Expression, known: Mapping[str, Form]) -> Form:
    """Return what an operand is."""
    match expression:
        case Name(name):
            if name not in known:
                there = ", ".join(sorted(known))
                raise Cql2Error(f"there is no property {name[:60]!r}; there are {there}")
            return known[name]
        case Constant(bool()):
            return "flag"
        case Constant(str()):
            return "text"
        case Constant():
            return "number"
        case Interval(start, end):
            for bound in (start, end):
                if isinstance(bound, Name) and form_of(bound, known) != "time":
                    raise Cql2Error(f"{bound.name!r} is not a time")
            return "time"
        case Instant():
            return "time"
        case Shape():
            return "geometry"
        case Call(name, (inner,)) if name in FOLDS:
            if form_of(inner, known) != "text":
                raise Cql2Error(f"{name} takes a text")
            return "text"
        case Call(name):
            raise Cql2Error(f"{name} stands where a value is expected")
