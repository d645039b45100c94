#!/usr/bin/env python3
"""Run the commands and check the snippets of `docs/learn` and `docs/how-to` against the real program.

    python scripts/docs_snippets.py [--slow] [--ros DIR] [PAGE ...]      exit 1, a line for each that fails

All `console` blocks of a page run in one shell, in order, in an empty folder. Each line that begins with `$ `
is a command; the lines below it are what it prints, in this order, `...` for anything. It has to end with 0,
or as its comment says (`# exit status 1`). Marks on the line before a block, joined by commas, change that:

    <!-- served -->          runs beside a service with a mission; for `msn-...`, `PLAN`, `/tmp/rover.sock`
                             and the like it gets what `tests/docs/served.py` makes for them
    <!-- serves -->          the last command runs until it is interrupted, once it has printed its lines
    <!-- slow -->            runs with --slow only, that is in scripts/docs
    <!-- ros -->             runs with --ros only, in the ROS 2 that scripts/ros-venv made in DIR
    <!-- installs -->        runs with --slow only, in an empty Python; `outcrop` is the wheel of this tree
    <!-- file: NAME -->      the block is written to this file of the folder

Files of `tests/docs/brought/PAGE/` lie in the folder from the start. Blocks without a language are not run,
their commands are checked against the program. Blocks in Python are compiled and what they import is looked
up; TOML and JSON are parsed.
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
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

from docs_shell import Shell

ROOT = Path(__file__).resolve().parents[1]
GUIDES = ("learn", "how-to")
FENCE = re.compile(
    r"(?:^<!-- (?P<mark>[^\n]*) -->\n)?^```(?P<lang>\w*)[^\n]*\n(?P<text>.*?)^```", re.M | re.S
)
LIMIT_S = 600
"""The first tutorial has to come to its end in ten minutes on two cores."""
SERVES_S = 60
"""So long may a command with the mark `serves` take to print its lines."""
BROUGHT = ROOT / "tests/docs/brought"
TYPED = "a password of Ada's\n" * 8
"""What a person types who is asked for something."""
STATUS = re.compile(r"#.*\bexit status (\d+)")
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
    def marks(self) -> frozenset[str]:
        """The words of the mark that say how the block is run."""
        return frozenset() if ":" in self.mark else frozenset(self.mark.replace(",", " ").split())

    @property
    def runs(self) -> bool:
        """Whether the commands of the block are carried out."""
        return self.lang in SHELLS and not self.mark.startswith("file:")


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


def prints_all(wanted: list[str], printed: str) -> bool:
    """Return whether every line was printed in its turn."""
    return missing_line(wanted, printed) is None


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


def in_an_empty_python(folder: Path) -> dict[str, str]:
    """Return an environment with an empty Python, whose pip takes the wheel of this tree for `outcrop`."""
    for command in (
        [sys.executable, "-m", "venv", folder / ".python"],
        [sys.executable, "-m", "build", "--no-isolation", "--outdir", folder / ".dist", ROOT],
    ):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise RuntimeError(f"{command[2]}: {done.stdout[-1000:]}{done.stderr[-1000:]}")
    (wheel,) = (folder / ".dist").glob("outcrop-*.whl")
    only = folder / ".python/only-this.txt"
    only.write_text(f"outcrop==={wheel.name.split('-')[1]}\n", encoding="utf-8")
    return {
        "PATH": f"{folder}/.python/bin{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": "",
        "PIP_CONSTRAINT": str(only),
        "PIP_FIND_LINKS": " ".join((str(wheel.parent), os.environ.get("PIP_FIND_LINKS", ""))),
    }


def surroundings(folder: Path, ros: Path | None) -> dict[str, str]:
    """Return the environment of a page's commands."""
    return {
        **os.environ,
        "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}",
        "PYTHONPATH": str(ROOT),
        "PYTHONUNBUFFERED": "1",
        "OUTCROP_DATA_DIR": str(folder / "data"),
        "OUTCROP_SOURCE": str(ROOT),
        "HOME": str(folder),
        "COLUMNS": "120",
        **({} if ros is None else in_ros(folder, ros)),
    }


def run_page(page: Path, slow: bool, ros: Path | None = None) -> list[str]:
    """Return what went wrong in the commands of a page, run in order in one shell."""
    left_out = {*(() if slow else ("slow", "installs")), *(() if ros else ("ros",))}
    found = blocks(page.read_text(encoding="utf-8"))
    todo = [block for block in found if block.runs and not block.marks & left_out]
    if not any(steps(block) for block in todo):
        return []
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        if (BROUGHT / page.stem).is_dir():
            shutil.copytree(BROUGHT / page.stem, folder, dirs_exist_ok=True)
        for block in found:
            if block.mark.startswith("file:"):
                target = folder / block.mark.removeprefix("file:").strip()
                target.parent.mkdir(parents=True, exist_ok=True)
                target.write_text(block.text, encoding="utf-8")
        shell = stack.enter_context(Shell(folder, surroundings(folder, ros), TYPED, LIMIT_S))
        stand = stack.enter_context(new_stand()) if any("served" in b.marks for b in todo) else None
        if any("installs" in block.marks for block in todo):
            shell.run(f"export {shlex.join(f'{k}={v}' for k, v in in_an_empty_python(folder).items())}")
        for block in todo:
            fault = run_block(block, shell, stand)
            if fault is not None:
                return [f"{page.name}:{block.line}: {fault}"]
    return []


def new_stand() -> Any:
    """Return what the placeholders of a page stand for, and the service that knows it."""
    if str(ROOT) not in sys.path:
        sys.path.insert(0, str(ROOT))
    return importlib.import_module("tests.docs.served").Stand()


def run_block(block: Block, shell: Shell, stand: Any) -> str | None:
    """Return what went wrong in a block, None if nothing did."""
    todo, served = steps(block), "served" in block.marks
    if served:
        settings = shlex.join(f"{name}={value}" for name, value in stand.settings.items())
        shell.run(f"kept=$OUTCROP_DATA_DIR; export {settings}")
    for number, (asked, wanted) in enumerate(todo, 1):
        try:
            command = stand.filled(asked) if served else asked
        except LookupError as err:
            return f"{asked!r}: nothing stands for the placeholder {err.args[0]!r}"
        if number == len(todo) and "serves" in block.marks:
            code, printed = shell.serve(command, partial(prints_all, wanted), SERVES_S)
        else:
            code, printed = shell.run(command)
        if served:
            stand.heard(printed)
        said = STATUS.search(asked)
        if code != (int(said[1]) if said else 0):
            return f"{command!r} ended with {code}:\n{printed[-1500:]}"
        lost = missing_line(wanted, printed)
        if lost is not None:
            return f"{command!r} did not print {lost.strip()!r}, but:\n{printed[-1500:]}"
    if served:
        shell.run("export OUTCROP_DATA_DIR=$kept; unset OUTCROP_SERVER")
    return None


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
            text = "\n".join(c for c, _ in steps(block)) if block.lang in SHELLS else block.text
            found += [f"{place}: no such command or option: {u}" for u in unknown(text)]
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
