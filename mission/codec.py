"""Reading and writing of values as JSON documents with a version, and their JSON Schema, from their types.

A document is an object with the member `format`, for instance `day/1`. Refused are members that a value does
not have, numbers that are not finite, strings for numbers, and versions newer than this program's; older ones
are brought up to date first.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, TypeVar

from mission.constraints import GROUP, constraint_kinds, constraint_type
from mission.errors import FormatError, MissionError

if TYPE_CHECKING:
    from pydantic import TypeAdapter, ValidationError
    from pydantic_core import ErrorDetails

T = TypeVar("T")
Document = Mapping[str, Any]
Upgrade = Callable[[dict[str, Any]], dict[str, Any]]
"""Brings the members of a document (without `format`) from one version to the next."""

SHOWN = 60
"""Characters of a value that a message repeats; a line of a terminal holds the rest of the sentence."""

MOST_NESTED = 200
"""Lists and objects within each other that a document may hold: as many as pydantic's parser takes."""


class Codec(Generic[T]):
    """Reads and writes one kind of value.

    Parameters
    ----------
    kind
        The value's class, made of `mission.values.value` classes, numbers, strings and tuples.
    format
        Name and version: `day/1`.
    what
        What the value is, for messages: `day`.
    upgrades
        For each older format the step to the next one; "" is a document without a format.
    error
        Class of the errors raised: a room may give its own kind of `FormatError`.
    """

    def __init__(
        self,
        kind: type[T],
        format: str,
        what: str,
        *,
        upgrades: Mapping[str, tuple[str, Upgrade]] | None = None,
        error: type[Exception] = FormatError,
    ) -> None:
        self._kind, self.format, self.what = kind, format, what
        self._upgrades, self._error = dict(upgrades or {}), error

    @property
    def _adapter(self) -> TypeAdapter[T]:
        kind: Any = self._kind
        made: TypeAdapter[T] = _adapter_of(kind)
        return made

    def read(self, text: str | bytes, where: str = "") -> T:
        """Return the value in a JSON text; `where` it is from stands before each message.

        Raises
        ------
        FormatError
            Or the class given for it: with the first member that is wrong, its value, and what is allowed.
        """
        return self.from_document(self.parsed(text, where), where)

    def read_file(self, path: Path) -> T:
        """Return the value in a file; raises as `read` does."""
        return self.from_document(self.parsed_file(path), str(path))

    def parsed(self, text: str | bytes, where: str = "") -> object:
        """Return what a JSON text holds, for `from_document`; raises as `read` does."""
        try:
            return json.loads(text, parse_constant=self._not_finite)
        except (ValueError, RecursionError) as err:
            raise self._wrong(f"is not JSON: {err}", where) from err

    def parsed_file(self, path: Path) -> object:
        """Return what a JSON file holds, for `from_document`; raises as `read` does."""
        try:
            text = path.read_bytes()
        except OSError as err:
            raise self._wrong(f"cannot be read: {err.strerror or err}", str(path)) from err
        return self.parsed(text, str(path))

    def from_document(self, document: object, where: str = "") -> T:
        """Return the value in a document that was parsed already; raises as `read` does."""
        from pydantic import ValidationError

        members = self._members(document, where)
        try:
            return self._adapter.validate_json(json.dumps(members), strict=True)
        except ValidationError as err:
            raise self._told(err, members, where) from err
        except (TypeError, ValueError, RecursionError) as err:
            raise self._wrong(f"cannot be read: {err}", where) from err

    def document(self, value: T) -> dict[str, Any]:
        """Return the value as a document of plain JSON types, `format` first, members in their order."""
        return {"format": self.format, **self._adapter.dump_python(value, mode="json")}

    def write(self, value: T, *, indent: int | None = None) -> str:
        """Return the value as JSON text; `read` returns an equal one."""
        return json.dumps(self.document(value), indent=indent, allow_nan=False)

    def schema(self) -> dict[str, Any]:
        """Return the JSON Schema (2020-12) of the documents."""
        schema = self._adapter.json_schema(mode="validation")
        schema["$schema"] = "https://json-schema.org/draft/2020-12/schema"
        schema["title"] = self.what
        schema["properties"] = {"format": {"const": self.format}, **schema.get("properties", {})}
        schema["required"] = ["format", *schema.get("required", ())]
        return schema

    def _members(self, document: object, where: str) -> dict[str, Any]:
        if not isinstance(document, Mapping):
            raise self._wrong(f"must be an object, found {shown(document)}", where)
        found = document.get("format", "" if "" in self._upgrades else None)
        members = {str(k): v for k, v in document.items() if k != "format"}
        seen: set[str] = set()
        while found != self.format:
            if not isinstance(found, str) or found not in self._upgrades or found in seen:
                raise self._wrong(self._other_format(found), where)
            seen.add(found)
            found, upgrade = self._upgrades[found]
            members = upgrade(members)
        return members

    def _other_format(self, found: object) -> str:
        known = ", ".join([*sorted(filter(None, self._upgrades)), self.format])
        if isinstance(found, str) and _newer(found, self.format):
            return f'has the format "{found}", newer than this program; it reads {known}'
        return f'has the format {shown(found)}; it must be "{self.format}"' + (
            f" or older ({known})" if self._upgrades else ""
        )

    def _not_finite(self, name: str) -> float:
        raise ValueError(f"{name} is not a number of JSON")

    def _wrong(self, message: str, where: str, members: tuple[str | int, ...] = ()) -> Exception:
        text = f"{where}: {message}" if where else f"{self.what} {message}"
        if issubclass(self._error, FormatError):
            return self._error(text, members)
        return self._error(text)

    def _told(self, err: ValidationError, members: dict[str, Any], where: str) -> Exception:
        """Return the error for the first thing that is wrong, in the words of this house."""
        first = err.errors(include_url=False)[0]
        if first["type"] == "json_invalid":  # what was written here as JSON can only be nested too deeply
            return self._wrong(f"is nested deeper than {MOST_NESTED} lists and objects", where)
        missing = first["type"] in ("missing", "missing_argument")
        way = tuple(_true_way(first["loc"], members, missing=missing))
        place = _named_way(way, members)
        return self._wrong(f"{place} {_sentence(first)}".strip(), where, way)


@cache
def _adapter_of(kind: Any) -> TypeAdapter[Any]:
    """Return what reads and writes a class: a codec that another process was sent finds it made there.

    Making it takes as long as flying a short plan.
    """
    from pydantic import TypeAdapter

    return TypeAdapter(kind)


def read_object(path: Path, error: type[Exception] = FormatError, what: str = "") -> dict[str, Any]:
    """Return the members of a file that holds a JSON object; `what` the file is stands before its name.

    Raises
    ------
    FormatError
        Or the class given for it: if the file cannot be read, is not JSON, or holds something else.
    """
    where = f"{what} {path}".strip()
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except OSError as err:
        raise error(f"{where}: {err.strerror or err}") from err
    except (ValueError, RecursionError) as err:
        raise error(f"{where} is not JSON: {err}") from err
    if not isinstance(document, dict):
        raise error(f"{where} must be an object, found {shown(document)}")
    return document


def read_toml(raw: bytes, where: str, error: type[Exception] = FormatError) -> dict[str, Any]:
    """Return the members of a TOML text; `where` it is from stands before each message.

    Raises
    ------
    FormatError
        Or the class given for it: if it is not TOML, is nested too deeply, or has a whole number beyond the
        64 bits of TOML 1.0, which nothing could turn into a number or print.
    """
    try:
        document = tomllib.loads(raw.decode("utf-8"))
    except (ValueError, RecursionError) as err:
        raise error(f"{where}: not TOML: {err}") from err
    waiting: list[tuple[str, object]] = list(document.items())
    while waiting:
        name, value = waiting.pop()
        if isinstance(value, dict):
            waiting += [(f"{name}.{inner}", held) for inner, held in value.items()]
        elif isinstance(value, list):
            waiting += [(name, held) for held in value]
        elif isinstance(value, int) and not -(1 << 63) <= value < 1 << 63:
            raise error(f"{where}: not TOML: {name} is a whole number of {value.bit_length()} bits, over 64")
    return document


def shown(value: object) -> str:
    """Return a value as it stands in a message, short enough for a line."""
    text = json.dumps(value, default=str, ensure_ascii=False)
    return text if len(text) <= SHOWN else text[: SHOWN - 3] + "..."


def _newer(found: str, ours: str) -> bool:
    name, _, version = found.partition("/")
    our_name, _, our_version = ours.partition("/")
    return name == our_name and version.isdecimal() and int(version) > int(our_version)


def _true_way(loc: tuple[str | int, ...], members: object, *, missing: bool) -> list[str | int]:
    """Return the way to a member without the tags of unions, which pydantic puts between.

    Where a member is `missing`, the last step is its name, though the document does not have it.
    """
    way: list[str | int] = []
    node = members
    for index, step in enumerate(loc):
        if isinstance(node, Mapping):
            if step not in node and not (missing and index == len(loc) - 1):
                continue
            node = node.get(step)
        elif isinstance(node, list | tuple) and isinstance(step, int) and step < len(node):
            node = node[step]
        elif isinstance(step, str) and index > 0:
            continue
        way.append(step)
    return way


def _named_way(way: tuple[str | int, ...], members: object) -> str:
    """Return `requests[R3].value`: members of lists by their id, or what they lead from and to, if any."""
    text, node = "", members
    for step in way:
        child: object = None
        if isinstance(node, Mapping):
            child = node.get(step)
        elif isinstance(node, list | tuple) and isinstance(step, int) and step < len(node):
            child = node[step]
        if isinstance(step, int):
            text += f"[{_name_of(child) or step}]"
        else:
            text += f".{step}" if text else step
        node = child
    return text


def _name_of(child: object) -> str:
    if not isinstance(child, Mapping):
        return ""
    name, ends = child.get("id"), (child.get("from"), child.get("to"))
    if isinstance(name, str):
        return name
    return " -> ".join(map(str, ends)) if all(isinstance(end, str) for end in ends) else ""


_BOUNDS = {
    "greater_than_equal": ("ge", "at least"),
    "greater_than": ("gt", "more than"),
    "less_than_equal": ("le", "at most"),
    "less_than": ("lt", "less than"),
}
_KINDS = {
    "float_type": "a number",
    "int_type": "a whole number",
    "int_from_float": "a whole number",
    "string_type": "a string",
    "bool_type": "true or false",
    "tuple_type": "an array",
    "list_type": "an array",
    "dataclass_type": "an object",
    "dataclass_exact_type": "an object",
    "mapping_type": "an object",
    "dict_type": "an object",
    "model_attributes_type": "an object",
}


def _sentence(error: ErrorDetails) -> str:
    """Return what is wrong with a member: its value, and what it must be."""
    kind, value, context = error["type"], shown(error["input"]), error.get("ctx", {})
    if kind in _BOUNDS:
        name, words = _BOUNDS[kind]
        return f"is {value}; it must be {words} {context[name]:g}"
    if kind in _KINDS:
        return f"must be {_KINDS[kind]}, found {value}"
    match kind:
        case "missing" | "missing_argument":
            return "is missing"
        case "unexpected_keyword_argument" | "extra_forbidden":
            return "is not a known member"
        case "finite_number":
            return f"is {value}; it must be finite"
        case "enum" | "literal_error":
            return f"is {value}; it must be {context.get('expected', '')}"
        case "union_tag_invalid":
            if context.get("discriminator") == "'kind'":
                return _unknown_kind(str(context.get("tag")))
            return (
                f"has the {str(context['discriminator']).strip(chr(39))} {shown(context['tag'])}; it must be "
                f"{context['expected_tags']}"
            )
        case "union_tag_not_found":
            return f"has no {str(context['discriminator']).replace(chr(39), chr(34))}"
        case "too_short":
            return f"has {context['actual_length']} entries; it needs at least {context['min_length']}"
        case "too_long":
            return f"has {context['actual_length']} entries; at most {context['max_length']} are allowed"
        case "value_error" if isinstance(context.get("error"), MissionError):
            return f"is not possible: {context['error']}"
    return f"is {value}: {error['msg']}"


def _unknown_kind(tag: str) -> str:
    """Return what is wrong with a kind of constraint: unknown, or its package cannot be imported."""
    try:
        constraint_type(tag)
    except MissionError as err:
        return f"is not possible: {err}"
    return f'has the kind "{tag}", which {GROUP} cannot read; known are {", ".join(constraint_kinds())}'
