"""The operations of the REST interface, as its OpenAPI document declares them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

DOCUMENT = Path(__file__).parents[1] / "openapi.json"
PREFIX = "/api/v1"


class Record(dict[str, Any]):
    """An object of an answer: its members are items and attributes alike."""

    def __getattr__(self, name: str) -> Any:
        try:
            return self[name]
        except KeyError:
            raise AttributeError(f"there is no member {name!r}; there are {', '.join(self)}") from None


@dataclass(frozen=True, slots=True)
class Member:
    """What an operation is given: a parameter, or a member of its body."""

    name: str
    required: bool
    types: frozenset[str]
    """JSON types of what it takes."""
    about: str
    choices: tuple[str, ...]
    """The words that it can be; empty where any will do."""

    @property
    def word(self) -> str:
        """The name as Python has it."""
        return {"if-match": "revision"}.get(self.name, self.name.replace("-", "_"))


@dataclass(frozen=True, slots=True)
class Operation:
    """One operation: where it is asked, what it takes and what comes back."""

    name: str
    method: str
    path: str
    """Behind the prefix of the interface, with the names of its variables in braces."""
    about: str
    parameters: Mapping[str, tuple[Member, ...]]
    """By where they stand: `path`, `query` or `header`."""
    body: tuple[Member, ...] | None
    """The required ones first, in the order that the document demands them; None where nothing is sent."""
    first: tuple[str, ...]
    """Of members that can be given in one way or another: those of the first way."""
    media: str
    """Media type of the answer, the first if there are several; empty if it has no body."""
    paged: bool
    sends_file: bool
    starts_job: bool


@cache
def _document() -> Mapping[str, Any]:
    """Return the OpenAPI document that belongs to this version."""
    found: Mapping[str, Any] = json.loads(DOCUMENT.read_text(encoding="utf-8"))
    return found


def _resolved(schema: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a schema, or the one that it refers to."""
    name = schema.get("$ref", "").rpartition("/")[2]
    return _document()["components"]["schemas"][name] if name else schema


def _cases(schema: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """Return the schemas of which a value has to fit one."""
    whole = _resolved(schema)
    return [case for part in whole.get("anyOf", ()) for case in _cases(part)] or [whole]


def _member(name: str, required: bool, schema: Mapping[str, Any], about: str = "") -> Member:
    known = _cases(schema)
    return Member(
        name,
        required,
        frozenset(case.get("type", "object") for case in known),
        about or schema.get("description", ""),
        tuple(word for case in known for word in case.get("enum", ()) if isinstance(word, str)),
    )


def _operation(method: str, path: str, told: Mapping[str, Any]) -> Operation:
    parameters: dict[str, list[Member]] = {"path": [], "query": [], "header": []}
    for p in told.get("parameters", ()):
        if "$ref" in p:  # what many operations take is the connection's affair
            continue
        required = p.get("required", False)
        parameters[p["in"]].append(_member(p["name"], required, p["schema"], p.get("description", "")))
    sent = told.get("requestBody", {}).get("content", {})
    body: list[Member] = []
    first: list[str] = []
    if "application/json" in sent:
        schema = _resolved(sent["application/json"]["schema"])
        needed = schema.get("required", [])
        first = next((way["required"] for way in schema.get("oneOf", ()) if "required" in way), [])
        rest = [name for name in schema.get("properties", {}) if name not in needed]
        body += [_member(name, name in needed, schema["properties"][name]) for name in [*needed, *rest]]
    done = next(answer for status, answer in told["responses"].items() if status.startswith("2"))
    media = next(iter(done.get("content", {})), "")
    schema = done.get("content", {}).get(media, {}).get("schema", {})
    return Operation(
        told["operationId"],
        method.upper(),
        path.removeprefix(PREFIX),
        told.get("description", ""),
        {place: tuple(found) for place, found in parameters.items()},
        tuple(body) if "application/json" in sent else None,
        tuple(first),
        media,
        "/Page_" in schema.get("$ref", ""),
        "application/octet-stream" in sent,
        "202" in told["responses"],
    )


@cache
def operations() -> Mapping[str, Operation]:
    """Return the operations of the interface by their names; those for machines alone are left out."""
    found = (
        _operation(method, path, told)
        for path, ways in _document()["paths"].items()
        for method, told in ways.items()
        if path.startswith(PREFIX)
    )
    return {operation.name: operation for operation in found}
