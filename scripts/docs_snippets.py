#!/usr/bin/env python3
"""Run the commands and check the snippets of `docs/learn` and `docs/how-to` against the real program.

    python scripts/docs_snippets.py [--slow] [PAGE ...]      exit status 1 and one line for each that fails

All `console` blocks of a page run in one shell, in order, in an empty folder. Each line that begins with `$ `
is a command; the lines below it are what it prints, in this order, `...` for anything. A comment on the line
before a block changes that:

    <!-- slow -->            runs with --slow only, that is in scripts/docs
    <!-- file: NAME -->      the block is written to this file of the folder
    <!-- form: REASON -->    not run; commands and options are held against the program

Blocks without a language are not run, their commands are held against the program. Blocks in Python are
compiled and what they import is looked up; TOML and JSON are parsed.
"""

from __future__ import annotations

import ast
import importlib
import json
import os
import re
import shlex
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
GUIDES = ("learn", "how-to")
FENCE = re.compile(
    r"(?:^<!-- (?P<mark>[^\n]*) -->\n)?^```(?P<lang>\w*)[^\n]*\n(?P<text>.*?)^```", re.M | re.S
)
LIMIT_S = 600
"""The first tutorial has to come to its end in ten minutes on two cores."""
SHELLS = {"console", "sh"}


@dataclass(frozen=True, slots=True)
class Block:
    """One fenced block of a page: its language, mark, text and first line."""

    lang: str
    mark: str
    text: str
    line: int

    @property
    def runs(self) -> bool:
        """Whether the commands of the block are carried out."""
        return self.lang in SHELLS and not self.mark.startswith(("form:", "file:"))


def blocks(text: str) -> list[Block]:
    """Return the fenced blocks of a page in order."""
    return [
        Block(m["lang"], (m["mark"] or "").strip(), m["text"], text.count("\n", 0, m.start("text")))
        for m in FENCE.finditer(text)
    ]


def steps(block: Block) -> list[tuple[str, list[str]]]:
    """Return the commands of a console block, each with the lines that it has to print."""
    found: list[tuple[str, list[str]]] = []
    inside = False
    for line in block.text.splitlines():
        if block.lang == "sh" or line.startswith("$ ") or inside:
            command = line.removeprefix("$ ")
            if inside:
                found[-1] = (f"{found[-1][0]}\n{command}", [])
            else:
                found.append((command, []))
            inside = line.endswith("\\")
        elif found and line.strip():
            found[-1][1].append(line)
    return found


def missing_line(wanted: list[str], printed: str) -> str | None:
    """Return the first line that was not printed in its turn, None if all were."""
    place = 0
    for line in wanted:
        if line.strip() == "...":
            continue
        pattern = r"\s+".join(re.escape(word).replace(r"\.\.\.", ".*?") for word in line.split())
        match = re.search(pattern, printed[place:])
        if match is None:
            return line
        place += match.end()
    return None


def run_page(page: Path, slow: bool) -> list[str]:
    """Return what went wrong in the commands of a page, run in order in one shell."""
    todo = []
    with tempfile.TemporaryDirectory() as folder:
        for block in blocks(page.read_text(encoding="utf-8")):
            if block.mark.startswith("file:"):
                target = Path(folder, block.mark.removeprefix("file:").strip())
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(block.text, encoding="utf-8")
            elif block.runs and (slow or block.mark != "slow"):
                todo += [(block, *step) for step in steps(block)]
        if not todo:
            return []
        script = "set -eu\n" + "\n".join(
            f"echo; echo @@{k}\n{command}" for k, (_, command, _) in enumerate(todo)
        )
        environment = {
            **os.environ,
            "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
            "PYTHONPATH": str(ROOT),
            "OUTCROP_DATA_DIR": str(Path(folder, "data")),
            "OUTCROP_SOURCE": str(ROOT),
            "HOME": folder,
            "COLUMNS": "120",
        }
        done = subprocess.run(
            ["bash", "-c", script],
            cwd=folder,
            env=environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=LIMIT_S,
        )
    parts = re.split(r"^@@\d+\n", done.stdout, flags=re.M)[1:]
    name = page.name
    for (block, command, wanted), printed in zip(todo, parts, strict=False):
        lost = missing_line(wanted, printed)
        if lost is not None:
            return [
                f"{name}:{block.line}: {command!r} did not print {lost.strip()!r}, but:\n{printed[-1500:]}"
            ]
    if done.returncode:
        block, command, _ = todo[len(parts) - 1]
        return [f"{name}:{block.line}: {command!r} ended with {done.returncode}:\n{parts[-1][-1500:]}"]
    return []


@cache
def program() -> Any:
    """Return the command line as a tree of commands."""
    import typer

    from ground.cli.main import app, register_all

    if not app.registered_groups:
        register_all()
    return typer.main.get_command(app)


def unknown_in(command: str) -> str | None:
    """Return the command or option of an `outcrop` command that the program does not know, or None."""
    words = shlex.split(command, comments=True)
    node, path = program(), []
    while words and hasattr(node, "list_commands"):
        word = words.pop(0)
        if word.startswith("-"):
            words = words[1:]
            continue
        lower = node.get_command(node.context_class(node), word.split("|")[0])
        if lower is None and path == ["plan"]:
            lower = node.get_command(node.context_class(node), "solve")  # `outcrop plan FILE` is short for it
        if lower is None:
            return f"outcrop {' '.join([*path, word])}"
        node, path = lower, [*path, word]
    known = {option for p in node.params for option in [*p.opts, *p.secondary_opts]} | {"--help"}
    for word in words:
        option = word.split("=")[0]
        if option.startswith("--") and option not in known:
            return f"outcrop {' '.join(path)} {option}"
    return None


def outcrop_commands(text: str) -> Iterator[str]:
    """Return each `outcrop` command of a shell text."""
    for line in text.replace("\\\n", " ").splitlines():
        for part in re.split(r"&&|\|\||[;|&](?=\s)|\$\(|\)", line.removeprefix("$ ")):
            match = re.match(r"\s*(?:export\s+)?(?:\w+=\S+\s+)*outcrop\s+(.*)", part)
            if match:
                yield match[1]


def wrong_form(page: Path) -> list[str]:
    """Return what is wrong with the snippets of a page as far as that is seen without running them."""
    found = []
    for block in blocks(page.read_text(encoding="utf-8")):
        place = f"{page.name}:{block.line}"
        try:
            if block.lang == "python":
                found += [f"{place}: {name} does not exist" for name in missing_imports(block.text)]
            elif block.lang == "json":
                json.loads(block.text)
            elif block.lang == "toml":
                tomllib.loads(block.text)
        except ValueError as err:
            found.append(f"{place}: {err}")
        except SyntaxError as err:
            found.append(f"{place}: line {err.lineno}: {err.msg}")
        if block.lang in {*SHELLS, ""}:
            found += [f"{place}: no such command or option: {u}" for u in unknown(block.text)]
    return found


def unknown(text: str) -> list[str]:
    """Return the commands and options of a shell text that the program does not know."""
    return [name for command in outcrop_commands(text) if (name := unknown_in(command)) is not None]


def missing_imports(text: str) -> list[str]:
    """Return the names that a snippet imports from our packages and that are not there."""
    ours = ("mission", "executive", "planner", "rover_iface", "neighbours", "ground")
    lost = []
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in ours:
            module = importlib.import_module(node.module or "")
            lost += [f"{node.module}.{a.name}" for a in node.names if not hasattr(module, a.name)]
    return lost


def guide_pages() -> list[Path]:
    """Return the pages whose snippets are held to the program."""
    return sorted(p for folder in GUIDES for p in (ROOT / "docs" / folder).glob("*.md"))


def main() -> int:
    """Check the pages that are named, or all."""
    arguments = [a for a in sys.argv[1:] if a != "--slow"]
    pages = [Path(a) for a in arguments] or guide_pages()
    wrong = 0
    for page in pages:
        found = [*wrong_form(page), *run_page(page, slow="--slow" in sys.argv)]
        commands = sum(len(steps(b)) for b in blocks(page.read_text(encoding="utf-8")) if b.runs)
        print(f"{page.name}: {commands} commands run, {len(found)} wrong", flush=True)
        for line in found:
            print(line, file=sys.stderr)
        wrong += len(found)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main())
