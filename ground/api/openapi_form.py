"""What is read here of an OpenAPI document, and written into it, as types."""

from __future__ import annotations

from typing import NotRequired, TypedDict

Schema = TypedDict("Schema", {
    "$ref": str, "title": str, "type": str, "format": str, "pattern": str, "const": object,
    "enum": list[object], "examples": list[object], "anyOf": list["Schema"], "oneOf": list["Schema"],
    "properties": dict[str, "Schema"], "required": list[str], "items": "Schema",
    "prefixItems": list["Schema"], "minItems": int, "maxItems": int, "minLength": int, "maxLength": int,
}, total=False)  # fmt: skip
"""What examples are made from, of a JSON Schema."""


class Media(TypedDict, total=False):
    """A body of one media type."""

    schema: Schema
    example: object
    examples: object


Answer = TypedDict(  # and what is sent, without headers
    "Answer",
    {"$ref": str, "description": str, "headers": dict[str, dict[str, str]], "content": dict[str, Media]},
    total=False,
)
Parameter = TypedDict(
    "Parameter",
    {"$ref": str, "name": str, "in": str, "required": bool, "schema": Schema, "example": object},
    total=False,
)


class Operation(TypedDict):
    """What one method does at one path."""

    operationId: str
    responses: dict[str, Answer]
    parameters: NotRequired[list[Parameter]]
    requestBody: NotRequired[Answer]
    security: NotRequired[list[dict[str, list[str]]]]


class Components(TypedDict, total=False):
    """What operations refer to, by kind and name."""

    schemas: dict[str, Schema]
    responses: dict[str, Answer]
    headers: object
    parameters: object
    securitySchemes: object
    examples: object


class OpenApi(TypedDict):
    """An OpenAPI document."""

    paths: dict[str, dict[str, Operation]]
    components: NotRequired[Components]
