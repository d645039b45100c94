"""Tables of studies, and the marked sections of `docs/results` that they are written into."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any


def table(head: list[str], rows: list[list[str]]) -> str:
    """Return a Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "".join("| " + " | ".join(line) + " |\n" for line in lines)


def write_section(docs: Path, page: str, name: str, body: str) -> None:
    """Write a body between the marks `begin:name` and `end:name` of a page of results.

    Raises
    ------
    ValueError
        If the page has no such marks: a study of half an hour must not end in nothing.
    """
    path = docs / "results" / f"{page}.md"
    marked = re.compile(rf"(<!-- begin:{name} -->).*?(<!-- end:{name} -->)", re.DOTALL)
    text, count = marked.subn(
        lambda m: f"{m.group(1)}\n{body.strip()}\n{m.group(2)}", path.read_text(encoding="utf-8")
    )
    if count != 1:
        raise ValueError(f"{path} has {count} sections between begin:{name} and end:{name}; one is wanted")
    path.write_text(text, encoding="utf-8")


def write_sections(
    docs: Path, page: str, results: Mapping[str, Any], makers: Mapping[str, Callable[[Any], str]]
) -> None:
    """Write what each maker says of the results; what has not run (`KeyError`) stays as it is."""
    for name, make in makers.items():
        try:
            body = make(results)
        except KeyError:
            continue
        write_section(docs, page, name, body)
