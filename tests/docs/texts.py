"""What people read of Outcrop, text by text: pages, the browser's page, the commands' help, messages."""

from __future__ import annotations

import ast
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[2]
ROOMS: list[str] = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"][
    "build"
]["targets"]["wheel"]["packages"]


def prose(text: str) -> str:
    """Return the words of a page: without code, comments and the targets of links."""
    text = re.sub(r"^```.*?^```", "", text, flags=re.M | re.S)
    text = re.sub(r"<!--.*?-->|`[^`\n]*`", "", text, flags=re.S)
    return re.sub(r"\]\([^)]*\)", "]", text)


def paragraphs(text: str) -> Iterator[str]:
    """Yield the paragraphs of a text, rows of tables and items of lists apart, each in one line."""
    for paragraph in re.split(r"\n\s*\n|\n(?=\s*(?:[|*-]|\d+\.) )", text):
        yield " ".join(paragraph.split())


def pages() -> Iterator[tuple[str, str]]:
    """Yield the paragraphs of every page for readers, with the page's name."""
    found = [p for folder in ("docs", "examples") for p in (ROOT / folder).rglob("*.md")]
    for page in sorted([*ROOT.glob("*.md"), *found]):
        for paragraph in paragraphs(prose(page.read_text(encoding="utf-8"))):
            yield str(page.relative_to(ROOT)), paragraph


def browser_page() -> Iterator[tuple[str, str]]:
    """Yield the sources of the page: what stands on it, and the comments beside it.

    The types of the API are made from docstrings, which `program` reads.
    """
    for path in sorted((ROOT / "web/src").rglob("*")):
        if path.suffix in {".svelte", ".ts"} and not path.name.endswith(".d.ts"):
            for paragraph in paragraphs(path.read_text(encoding="utf-8")):
                yield str(path.relative_to(ROOT)), paragraph


def helps(command: Any, path: str) -> Iterator[tuple[str, str]]:
    """Yield the help of a command, of its options and of the commands below it."""
    yield path, " ".join((command.help or "").split())
    for parameter in command.params:
        yield f"{path} {parameter.name}", " ".join((getattr(parameter, "help", None) or "").split())
    for name, lower in getattr(command, "commands", {}).items():
        yield from helps(lower, f"{path} {name}")


def commands() -> Iterator[tuple[str, str]]:
    """Yield the help of every command, hidden ones too."""
    import typer

    from ground.cli.main import app, register_all

    if not app.registered_groups:
        register_all()
    yield from helps(typer.main.get_command(app), "outcrop")


def _spoken(node: ast.AST) -> Iterator[tuple[int, str]]:
    if isinstance(node, ast.JoinedStr):
        parts = (p.value if isinstance(p, ast.Constant) else "X" for p in node.values)
        yield node.lineno, "".join(map(str, parts))
        for part in node.values:
            if isinstance(part, ast.FormattedValue):
                yield from _spoken(part.value)
    elif isinstance(node, ast.Constant) and isinstance(node.value, str):
        yield node.lineno, node.value
    else:
        for child in ast.iter_child_nodes(node):
            yield from _spoken(child)


def spoken(source: str) -> Iterator[tuple[int, str]]:
    """Yield the sentences in a program with their lines: messages, help, docstrings. "X" stands for a value.

    Names of parameters stand alone on a line of a docstring, and names in backticks anywhere: neither counts.
    """
    for line, text in _spoken(ast.parse(source)):
        if " " in text.strip():
            plain = re.sub(r"^ +[\w, *]+$(?=\n {5,})", "", re.sub(r"`[^`\n]*`", "", text), flags=re.M)
            yield from ((line, paragraph) for paragraph in paragraphs(plain))


def program() -> Iterator[tuple[str, str]]:
    """Yield every sentence of the product's modules and of the rovers' dictionaries and profiles."""
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*")):
            name = str(path.relative_to(ROOT))
            if "node_modules" in path.parts:
                continue
            if path.suffix == ".py":
                for line, text in spoken(path.read_text(encoding="utf-8")):
                    yield f"{name}:{line}", text
            elif path.suffix == ".toml":
                yield from ((name, text) for text in paragraphs(path.read_text(encoding="utf-8")))


SURFACES = {"pages": pages, "page of the browser": browser_page, "help": commands, "program": program}
