"""How the fields of forms are declared: the syntax of a value, and what follows from a class of `nodes.py`.

A field is declared where it is defined: `field(default=(), metadata=of(Syntax.CONDITIONS))`. How a value of
each syntax is read, written and put into JSON stands in `syntax.py`, once for each syntax.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, StrEnum, auto
from typing import Any


class Syntax(Enum):
    """How the value of a field is written; a choice among words is the enumeration of the words."""

    SYMBOL = auto()
    STRING = auto()
    EPOCH = auto()
    NUMBER = auto()
    INTEGER = auto()
    RETRIES = auto()
    INSERTIONS = auto()
    DELAY = auto()
    TRUTH = auto()
    CONDITIONS = auto()
    TEMPORALS = auto()
    INTERVAL = auto()
    USES = auto()
    REQUIRES = auto()
    BUDGETS = auto()
    EXPECTATIONS = auto()
    PARAMETERS = auto()
    UTILITY = auto()
    RESOURCES = auto()
    NODE = auto()
    """One node."""
    NODE_LIST = auto()
    """A list of nodes."""
    FORM_LIST = auto()
    """A list of forms of one kind, each of which holds a node."""


STRUCTURE = (Syntax.NODE, Syntax.NODE_LIST, Syntax.FORM_LIST)

Metadata = Mapping[str, object]


def of(syntax: Syntax | type[StrEnum], *, flag: bool = False, holds: str = "") -> Metadata:
    """Declare the syntax of a field.

    An enumeration stands for one of its words. A `flag` may stand without a value, meaning true. `holds` is
    the kind of the forms in a FORM_LIST.
    """
    return {"syntax": syntax, "flag": flag, "holds": holds}


@dataclass(frozen=True, slots=True)
class Declared:
    """One field: its word in the text, its attribute in the class, and what is written after it."""

    word: str
    attribute: str
    syntax: Syntax | type[StrEnum]
    required: bool
    default: object
    flag: bool = False
    holds: str = ""


@dataclass(frozen=True, slots=True)
class Form:
    """A kind of form: its head, its class, its fields in the order of the canonical text."""

    kind: str
    cls: type[Any]
    fields: Mapping[str, Declared]
    structure: tuple[Declared, ...]
    """Those fields that hold nodes or forms."""


def forms_of(*classes: type[Any]) -> Mapping[str, Form]:
    """Return what classes declare, by the heads of their forms (`ConcurrentBlock`: `concurrent-block`)."""
    forms: dict[str, Form] = {}
    for cls in classes:
        kind = re.sub(r"(?<!^)(?=[A-Z])", "-", cls.__name__).lower()
        declared = [_declared(field) for field in dataclasses.fields(cls) if "syntax" in field.metadata]
        structure = tuple(field for field in declared if field.syntax in STRUCTURE)
        forms[kind] = Form(kind, cls, {field.word: field for field in declared}, structure)
    return forms


def _declared(field: dataclasses.Field[Any]) -> Declared:
    missing = dataclasses.MISSING
    made = field.default_factory is not missing
    return Declared(
        word=field.name.removesuffix("_ms").replace("_", "-"),
        attribute=field.name,
        syntax=field.metadata["syntax"],
        required=field.default is missing and not made,
        default=field.default_factory() if field.default_factory is not missing else field.default,
        flag=field.metadata["flag"],
        holds=field.metadata["holds"],
    )
