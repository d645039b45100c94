"""The graph from a target or request to all that came of it."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class LineageNode:
    """A node of the provenance graph."""

    kind: str
    id: str
    title: str
    url: str


@dataclass(frozen=True, slots=True)
class LineageEdge:
    """`source` came about by `relation` of `target` (used, generated, derived)."""

    source: str
    relation: str
    target: str


@dataclass(frozen=True, slots=True)
class Lineage:
    nodes: list[LineageNode]
    edges: list[LineageEdge]
