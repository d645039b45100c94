"""Write ``ground/client/operations.pyi``: the types of the client's methods, from the OpenAPI document.

The build does so for every wheel and editable install, and ``scripts/check`` before mypy; no package of ours
is needed.
"""

from __future__ import annotations

import json
import keyword
from pathlib import Path
from typing import Any

HEAD = """# Made from ground/openapi.json by every build and check. Do not edit.
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, BinaryIO, Literal, TypeAlias

from ground.client.interface import Record

"""
PLAIN = {
    "string": "str",
    "integer": "int",
    "number": "float",
    "boolean": "bool",
    "null": "None",
    "object": "Record",
}
TAKEN = set(dir(dict)) | set(keyword.kwlist)


def read_type(schema: dict[str, Any]) -> str:
    """Return the type of a value that comes back."""
    if "$ref" in schema:
        return str(schema["$ref"]).rpartition("/")[2]
    if "anyOf" in schema:
        return " | ".join(dict.fromkeys(map(read_type, schema["anyOf"])))
    words = schema.get("enum", [schema["const"]] if "const" in schema else [])
    if words:
        return f"Literal[{', '.join(map(repr, words))}]"
    if "prefixItems" in schema:
        return f"tuple[{', '.join(map(read_type, schema['prefixItems']))}]"
    if schema.get("type") == "array":
        return f"list[{read_type(schema.get('items', {}))}]"
    if isinstance(schema.get("additionalProperties"), dict):
        return f"dict[str, {read_type(schema['additionalProperties'])}]"
    return PLAIN.get(schema.get("type", ""), "Any")


def sent_type(schema: dict[str, Any], schemas: dict[str, Any]) -> str:
    """Return the type of a value that is given: any mapping for an object, any sequence for an array."""
    if "$ref" in schema:
        return sent_type(schemas[schema["$ref"].rpartition("/")[2]], schemas)
    if "properties" not in schema and ("anyOf" in schema or "oneOf" in schema):
        cases = schema.get("anyOf", schema.get("oneOf"))
        return " | ".join(dict.fromkeys(sent_type(case, schemas) for case in cases))
    if schema.get("type") == "array":
        return f"Sequence[{sent_type(schema['items'], schemas) if 'items' in schema else 'Any'}]"
    return "Mapping[str, Any]" if schema.get("type") == "object" else read_type(schema)


def answer_type(operation: dict[str, Any]) -> str:
    """Return the type of what an operation gives back."""
    done = next(answer for status, answer in operation["responses"].items() if status.startswith("2"))
    media, content = next(iter(done.get("content", {"": {}}).items()))
    if media == "application/json":
        found = read_type(content.get("schema", {}))
        return f"Iterator[{found.split('_')[1]}]" if found.startswith("Page_") else found
    return {"": "None", "text/plain": "str", "text/event-stream": "Iterator[Record]"}.get(media, "bytes")


def method(operation: dict[str, Any], schemas: dict[str, Any]) -> str:
    """Return the line that declares one operation."""
    where, named = ["self"], []
    for p in operation.get("parameters", []):
        if "$ref" in p:  # what many operations take is the connection's affair
            continue
        if p["in"] == "path":
            where.append(f"{p['name']}: {sent_type(p['schema'], schemas)}")
        elif p["name"] == "if-match":
            named.append("revision: int | None = ...")
        elif p["name"] not in {"cursor", "after"}:  # the client turns the pages
            default = "" if p.get("required") else " = ..."
            named.append(f"{p['name'].replace('-', '_')}: {sent_type(p['schema'], schemas)}{default}")
    for media, content in operation.get("requestBody", {}).get("content", {}).items():
        if media != "application/json":
            named.append("content: bytes | BinaryIO")
            continue
        body = schemas[content["schema"]["$ref"].rpartition("/")[2]]
        for name, schema in body.get("properties", {}).items():
            default = "" if name in body.get("required", []) else " = ..."
            named.append(f"{name}: {sent_type(schema, schemas)}{default}")
    given = ", ".join([*where, *(["*", *named] if named else [])])
    return f"    def {operation['operationId']}({given}) -> {answer_type(operation)}: ..."


def stub(document: dict[str, Any]) -> str:
    """Return the text of the stub."""
    schemas = document["components"]["schemas"]
    lines = []
    for name, schema in schemas.items():
        if name.startswith("Page_"):
            continue
        if "properties" not in schema:
            lines.append(f"{name}: TypeAlias = {read_type(schema)}")
            continue
        lines.append(f"class {name}(Record):")
        members = [(n, s) for n, s in schema["properties"].items() if n.isidentifier() and n not in TAKEN]
        lines += [f"    {n}: {read_type(s)}" for n, s in members] or ["    ..."]
    lines.append("class Operations:")
    for path, ways in document["paths"].items():
        lines += [method(told, schemas) for told in ways.values() if path.startswith("/api/")]
    return HEAD + "\n".join(lines) + "\n"


def write(root: Path) -> None:
    """Write the stub of the checkout or source archive at ``root``."""
    document = json.loads((root / "ground" / "openapi.json").read_text(encoding="utf-8"))
    (root / "ground" / "client" / "operations.pyi").write_text(stub(document), encoding="utf-8")


if __name__ == "__main__":
    write(Path(__file__).resolve().parents[1])
