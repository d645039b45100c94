#!/usr/bin/env python3
"""Run the commands and check the snippets of `docs/learn` and `docs/how-to` against the real program.

    python scripts/docs_snippets.py [--slow] [--ros DIR] [PAGE ...]      exit 1, a line for each that fails

All `console` blocks of a page run in one shell, in order, in an empty folder. Each line that begins with `$ `
is a command; the lines below it are what it prints, in this order, `...` for anything. A comment on the line
before a block changes that:

    <!-- slow -->            runs with --slow only, that is in scripts/docs
    <!-- ros -->             runs with --ros only, in the ROS 2 that scripts/ros-venv made in DIR
    <!-- file: NAME -->      the block is written to this file of the folder
    <!-- form: REASON -->    not run; commands and options are checked against the program

Blocks without a language are not run, their commands are checked against the program. Blocks in Python are
compiled and what they import is looked up; TOML and JSON are parsed.
"""

from __future__ import annotations

import argparse
import ast
import contextlib
import importlib
import json
import os
import re
import shlex
import signal
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
QUOTED = re.compile(r"'[^']*'|\"[^\"$]*\"")
"""Quoted text of a shell that runs no command: what stands in it ends none either."""
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


def in_ros(folder: Path, ros: Path) -> dict[str, str]:
    """Return an environment whose `outcrop` and `python` are those of a ROS 2; `folder` keeps the first."""
    outcrop = folder / ".bin/outcrop"
    outcrop.parent.mkdir()
    outcrop.write_text(f'#!/bin/sh\nexec {ros}/bin/python -m ground.cli "$@"\n')
    outcrop.chmod(0o755)
    return {
        "PATH": os.pathsep.join((str(outcrop.parent), f"{ros}/bin", os.environ["PATH"])),
        "AMENT_PREFIX_PATH": str(ros),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
        "ROS_DOMAIN_ID": str(1 + os.getpid() % 100),
        "ROS_LOG_DIR": str(folder / ".log"),
    }


def in_one_shell(script: str, folder: Path, environment: dict[str, str]) -> tuple[int, str]:
    """Return how a shell ended and what it printed; what it left running in the background is ended."""
    with (folder / ".printed").open("w+", encoding="utf-8", errors="replace") as out:
        shell = subprocess.Popen(
            ["bash", "-c", script],
            cwd=folder,
            env=environment,
            stdout=out,
            stderr=subprocess.STDOUT,
            start_new_session=True,
        )
        try:
            shell.wait(LIMIT_S)
        finally:
            with contextlib.suppress(ProcessLookupError):
                os.killpg(shell.pid, signal.SIGTERM)
            shell.wait()
        out.seek(0)
        return shell.returncode, out.read()


def run_page(page: Path, slow: bool, ros: Path | None = None) -> list[str]:
    """Return what went wrong in the commands of a page, run in order in one shell."""
    todo = []
    with tempfile.TemporaryDirectory() as folder:
        for block in blocks(page.read_text(encoding="utf-8")):
            if block.mark.startswith("file:"):
                target = Path(folder, block.mark.removeprefix("file:").strip())
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(block.text, encoding="utf-8")
            elif block.runs and (block.mark != "slow" or slow) and (block.mark != "ros" or ros):
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
            **({} if ros is None else in_ros(Path(folder), ros)),
        }
        code, printed_all = in_one_shell(script, Path(folder), environment)
    parts = re.split(r"^@@\d+\n", printed_all, flags=re.M)[1:]
    name = page.name
    for (block, command, wanted), printed in zip(todo, parts, strict=False):
        lost = missing_line(wanted, printed)
        if lost is not None:
            return [
                f"{name}:{block.line}: {command!r} did not print {lost.strip()!r}, but:\n{printed[-1500:]}"
            ]
    if code:
        block, command, _ = todo[len(parts) - 1]
        return [f"{name}:{block.line}: {command!r} ended with {code}:\n{parts[-1][-1500:]}"]
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
        if word == "--":  # what follows are arguments
            return None
        option = word.split("=")[0]
        if option.startswith("--") and option not in known:
            return f"outcrop {' '.join(path)} {option}"
    return None


def outcrop_commands(text: str) -> Iterator[str]:
    """Return each `outcrop` command of a shell text."""
    for line in text.replace("\\\n", " ").splitlines():
        quoted = iter(QUOTED.findall(line))
        bare = QUOTED.sub("\0", line.removeprefix("$ "))
        for part in re.split(r"&&|\|\||[;|&](?=\s)|\$\(|\)", bare):
            whole = "".join(next(quoted) if c == "\0" else c for c in part)
            match = re.match(r"\s*(?:export\s+)?(?:\w+=\S+\s+)*outcrop\s+(.*)", whole)
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
    reader = argparse.ArgumentParser()
    reader.add_argument("--slow", action="store_true")
    reader.add_argument("--ros", type=Path)
    reader.add_argument("pages", nargs="*", type=Path)
    asked = reader.parse_args()
    wrong = 0
    for page in asked.pages or guide_pages():
        found = [*wrong_form(page), *run_page(page, asked.slow, asked.ros)]
        commands = sum(len(steps(b)) for b in blocks(page.read_text(encoding="utf-8")) if b.runs)
        print(f"{page.name}: {commands} commands run, {len(found)} wrong", flush=True)
        for line in found:
            print(line, file=sys.stderr)
        wrong += len(found)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    sys.exit(main())
