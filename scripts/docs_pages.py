#!/usr/bin/env python3
"""Write the generated pages of `docs/reference`: the commands and the file formats.

    python scripts/docs_pages.py            write them
    python scripts/docs_pages.py --check    exit status 1 and the names of the pages that are out of date

The command line is read from the program itself, the formats from `docs/formats`.
"""

from __future__ import annotations

import inspect
import re
import sys
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
PAGES = ROOT / "docs" / "reference"

CLI_HEAD = """# Commands

<!-- made by scripts/docs_pages.py -->

`outcrop COMMAND --help` shows the same in the terminal. A command that needs a server says so; it reads
`OUTCROP_SERVER`, `OUTCROP_PERSON` and `OUTCROP_API_KEY` from the environment.
"""

FORMATS_HEAD = """# File formats

<!-- made by scripts/docs_pages.py -->

Each file that Outcrop reads or writes names its format and version in the member `format`. The schemas are
JSON Schema. Outcrop refuses a file by the first member that is wrong, with its value and the limit.

| format | what it holds | schema |
|---|---|---|
"""


WHAT = {
    "calibration": "Odds of lost tracks and drives, times and energies, and the runs they are from",
    "campaign": "What many runs of one plan say together",
    "day": "One mission's day: targets, requests, keep-outs, start and limits",
    "dictionary": "The commands that a rover takes and the telemetry that it sends",
    "fault": "Faults that a simulated rover suffers, and when",
    "flight-map": "What a flight dictionary does not say: costs, instruments, how actions are sent (TOML)",
    "image-pairs": "Stereo pairs of plain pictures: rig, poses, where the rover stands (TOML)",
    "package": "Manifest of an uplink package: the digests that people signed",
    "plan-tree": "A contingent plan as data",
    "problem": "A planning problem: observations, drives, budgets, odds",
    "profile": "What a rover is: body, wheels, power, mast, arm, cameras, instruments",
    "ros2-mapping": "The ROS 2 names and fields of a dictionary's actions and telemetry (YAML)",
    "rocks": "The rocks of a terrain, each with its place and size",
    "sol-series": "Battery, times and power of sols that follow each other",
    "stereo-calibration": "A calibrated stereo pair with the covariance of its parameters",
    "terrain": "The rasters and images of a terrain",
    "trust": "Whose signature counts for what on board",
    "world": "What a simulated rover lives in: terrain, targets, profile, start",
}


def cell(text: str) -> str:
    """Return a text that a Markdown table can hold in one cell."""
    return re.sub(r"\s+", " ", text).replace("|", "\\|").replace("<", "&lt;").strip()


def options(command: Any) -> list[str]:
    """Return one table row for each argument and option of a command."""
    rows = []
    for parameter in command.params:
        if parameter.name == "help" or getattr(parameter, "hidden", False):
            continue
        if parameter.param_type_name == "argument":
            name = f"`{(parameter.metavar or parameter.name).upper()}`"
        else:
            name = ", ".join(f"`{option}`" for option in [*parameter.opts, *parameter.secondary_opts])
        default = parameter.default
        plain = isinstance(default, str | int | float | Path) and not isinstance(default, bool)
        shown = f"`{default}`" if plain and str(default) else ""
        if parameter.required:
            shown = "required"
        rows.append(f"| {name} | {cell(getattr(parameter, 'help', None) or '')} | {shown} |")
    return rows


def command_lines(path: str, command: Any, depth: int) -> list[str]:
    """Return the lines of a command, and of the commands below it."""
    lines = [f"{'#' * min(depth, 4)} {path}", "", cell(inspect.cleandoc(command.help or "")), ""]
    context = command.context_class(command)
    names = command.list_commands(context) if hasattr(command, "list_commands") else []
    rows = options(command)
    if rows:
        lines += ["| argument or option | meaning | default |", "|---|---|---|", *rows, ""]
    for name in sorted(names):
        lower = command.get_command(context, name)
        if not lower.hidden:
            lines += command_lines(f"{path} {name}", lower, depth + 1)
    return lines


def cli_page() -> str:
    """Return the page of all commands."""
    import typer

    from ground.cli.main import app, register_all

    if not app.registered_groups:
        register_all()
    root: Any = typer.main.get_command(app)
    lines = [CLI_HEAD]
    for name in sorted(root.commands):
        lines += command_lines(f"outcrop {name}", root.commands[name], 2)
    return "\n".join(lines).rstrip() + "\n"


def formats_page() -> str:
    """Return the page of all formats that have a schema."""
    rows = []
    for path in sorted((ROOT / "docs" / "formats").glob("*.schema.json")):
        name, version = re.fullmatch(r"(.+)-(\d+)\.schema\.json", path.name).groups()  # type: ignore[union-attr]
        if name not in WHAT:
            raise SystemExit(f"{path.name} has no line in WHAT of scripts/docs_pages.py")
        rows.append(f"| `{name}/{version}` | {WHAT[name]} | [{path.name}](../formats/{path.name}) |")
    return FORMATS_HEAD + "\n".join(rows) + "\n"


def main() -> int:
    """Write or check the pages."""
    made = {"cli.md": cli_page(), "formats.md": formats_page()}
    if "--check" not in sys.argv[1:]:
        for name, text in made.items():
            (PAGES / name).write_text(text, encoding="utf-8")
        return 0
    old = [n for n, t in made.items() if not (PAGES / n).is_file() or (PAGES / n).read_text("utf-8") != t]
    for name in old:
        print(f"docs/reference/{name} is out of date: python scripts/docs_pages.py", file=sys.stderr)
    return 1 if old else 0


if __name__ == "__main__":
    sys.exit(main())
