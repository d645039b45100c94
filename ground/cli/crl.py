"""Commands about plan texts: check, expand, format. Another module adds `run` to the same group."""

from __future__ import annotations

import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import BAD_INPUT, fail, refusals

if TYPE_CHECKING:
    from executive.crl import Finding, Plan
    from executive.crl.dictionary import Dictionary

crl_app = typer.Typer(name="crl", help="Check, format and try out plan texts (CRL).", no_args_is_help=True)


def register(app: typer.Typer) -> None:
    """Add the group to the program."""
    app.add_typer(crl_app)


@crl_app.command()
def check(
    file: Annotated[Path, typer.Argument(help="CRL text, or its JSON form (.json)")],
    as_json: Annotated[bool, typer.Option("--json", help="findings as JSON on stdout")] = False,
    dictionary: Annotated[
        str | None,
        typer.Option(
            help="look actions and keys up in a rover's dictionary: its name (outcrop-rover) or file"
        ),
    ] = None,
    level: Annotated[
        list[str] | None,
        typer.Option(help="KEY=VALUE at the start of the plan, for the resource envelope"),
    ] = None,
) -> None:
    """Report everything that is wrong or doubtful in a plan. Exit 1 if it must be rejected."""
    from executive.crl import check as check_text

    levels = _levels(level or [])
    commands = telemetry = None
    if dictionary is not None:
        language = dictionary_of(dictionary)
        commands, telemetry = language.commands, language.telemetry
    text = plan_text(file)
    report = check_text(text, commands=commands, telemetry=telemetry, levels=levels)
    if as_json:
        typer.echo(json.dumps([f.to_json() for f in report.findings], indent=2))
    else:
        lines = text.removeprefix("\ufeff").split("\n")
        for finding in report.findings:
            typer.echo(_show(finding, str(file), lines))
        typer.echo(_summary(str(file), len(report.errors), len(report.findings) - len(report.errors)))
    if not report.valid:
        raise typer.Exit(1)


@crl_app.command()
def expand(
    file: Annotated[Path, typer.Argument(help="CRL text with macros, repetition and arithmetic")],
    readable: Annotated[bool, typer.Option(help="the readable text instead of the canonical one")] = False,
    limit: Annotated[
        int | None, typer.Option(min=1, help="how many items an expansion may have (default: 1,000,000)")
    ] = None,
) -> None:
    """Print the plain plan that a source stands for; findings point into the source. Exit 1 on an error."""
    from functools import partial

    from executive.crl import canonical_text, readable_text
    from executive.crl import check as check_text
    from executive.crl.expand import EXPANSION_LIMIT, expand_items

    text = _read(file)
    report = check_text(text, front=partial(expand_items, limit=limit or EXPANSION_LIMIT))
    lines = text.removeprefix("\ufeff").split("\n")
    for finding in report.findings:
        typer.echo(_show(finding, str(file), lines), err=True)
    if report.plan is None or not report.valid:
        raise typer.Exit(1)
    typer.echo(readable_text(report.plan) if readable else canonical_text(report.plan), nl=not readable)


@crl_app.command("format")
def format_(
    file: Annotated[Path, typer.Argument(help="CRL text, or its JSON form (.json)")],
    canonical: Annotated[bool, typer.Option(help="the one text the digest is taken of")] = False,
    digest: Annotated[bool, typer.Option(help="SHA-256 of the canonical text")] = False,
    json_form: Annotated[bool, typer.Option(help="the JSON form")] = False,
) -> None:
    """Print a plan anew: readable, canonical, as JSON, or its digest. Comments are lost."""
    from executive.crl import CrlSyntaxError, canonical_text, parse, readable_text, to_json
    from executive.crl import digest as digest_of

    if canonical + digest + json_form > 1:
        fail("--canonical, --digest and --json-form exclude each other")
    text = _read(file)
    if file.suffix == ".json":
        plan = _from_json(file, text)
    else:
        try:
            plan = parse(text)
        except CrlSyntaxError as error:
            lines = text.removeprefix("\ufeff").split("\n")
            typer.echo(_show(error.finding(), str(file), lines), err=True)
            raise typer.Exit(1) from error
    if digest:
        typer.echo(digest_of(plan))
    elif canonical:
        typer.echo(canonical_text(plan))
    elif json_form:
        typer.echo(json.dumps(to_json(plan), indent=2, ensure_ascii=False))
    else:
        typer.echo(readable_text(plan), nl=False)


@crl_app.command()
def export(
    file: Annotated[Path, typer.Argument(help="CRL text, or its JSON form (.json)")],
    to: Annotated[str, typer.Option("--to", help="bt: XML of BehaviorTree.CPP 4")] = "bt",
    out: Annotated[Path | None, typer.Option(help="the file to write; default stdout")] = None,
    partial: Annotated[
        bool, typer.Option("--partial", help="write what fits, with a comment where something does not")
    ] = False,
) -> None:
    """Write a plan for another executive. Exit 2, and nothing is written, if that cannot say all of it.

    Each construct that does not fit is named on stderr with its place and reason.
    """
    from executive.crl import CrlValidationError, load
    from neighbours.robots.behavior_tree import behavior_tree

    if to != "bt":
        fail(f"--to {to!r} is not a known form; bt is")
    try:
        plan = load(plan_text(file))
    except CrlValidationError as error:
        first = error.findings[0]
        fail(f"{file}:{first.line}:{first.column}: {first.message} ({len(error.findings)} findings in all)")
    tree = behavior_tree(plan)
    for one in tree.lacking:
        typer.echo(f"{file}: {one}", err=True)
    if tree.lacking and not partial:
        count = len(tree.lacking)
        places = "1 place" if count == 1 else f"{count} places"
        typer.echo(f"outcrop: the plan does not fit at {places}; nothing written (--partial)", err=True)
        raise typer.Exit(BAD_INPUT)
    if out is None:
        typer.echo(tree.xml, nl=False)
    else:
        try:
            out.write_text(tree.xml, encoding="utf-8")
        except OSError as error:
            fail(f"{out} cannot be written: {error.strerror}")


def dictionary_of(name: str) -> Dictionary:
    """Return the dictionary that `--dictionary` names; `outcrop` is that of the program's rovers."""
    from rover_iface.profile import STANDARD_DICTIONARY, dictionary_file

    with refusals():
        return dictionary_file(STANDARD_DICTIONARY if name == "outcrop" else name)


def plan_text(file: Path) -> str:
    """Return the CRL text of a file that holds it, or its JSON form."""
    from executive.crl import readable_text

    text = _read(file)
    return readable_text(_from_json(file, text)) if file.suffix == ".json" else text


def _from_json(file: Path, text: str) -> Plan:
    from executive.crl import CrlFormError, from_json

    try:
        return from_json(json.loads(text))
    except json.JSONDecodeError as error:
        fail(f"{file}: no JSON: {error}")
    except (CrlFormError, RecursionError) as error:
        fail(f"{file}: {error or 'nested too deep'}")


def _read(file: Path) -> str:
    try:
        raw = file.read_bytes()
    except FileNotFoundError:
        fail(f"{file}: no such file")
    except IsADirectoryError:
        fail(f"{file}: is a folder, not a plan")
    except OSError as error:
        fail(f"{file}: {error.strerror}")
    if not raw.strip():
        fail(f"{file}: the file is empty")
    if b"\x00" in raw:
        fail(f"{file}: not a text (a zero byte at offset {raw.index(0)})")
    try:
        return raw.decode()
    except UnicodeDecodeError as error:
        fail(f"{file}: not UTF-8 text (byte {raw[error.start]:#04x} at offset {error.start})")


def _levels(pairs: list[str]) -> dict[str, float]:
    levels = {}
    for pair in pairs:
        key, _, number = pair.partition("=")
        try:
            levels[key.strip().removeprefix(":")] = float(number)
        except ValueError:
            fail(f"--level needs KEY=VALUE with a number, found {pair!r}")
    return levels


def _show(finding: Finding, name: str, lines: list[str]) -> str:
    """Return a finding as a compiler prints it: place, message, line, caret, hint."""
    place = f"{name}:{finding.line}:{finding.column}: " if finding.line else f"{name}: "
    out = [f"{place}{finding.severity} {finding.code}: {finding.message}"]
    if 0 < finding.line <= len(lines):
        margin = f"{finding.line:5d} | "
        before, shown, length = _excerpt(lines[finding.line - 1], finding.column - 1, finding.length)
        out.append(margin + shown)
        out.append(" " * (len(margin) - 2) + "| " + " " * before + "^" + "~" * (length - 1))
    if finding.hint:
        out.append(f"        hint: {finding.hint}")
    return "\n".join(out)


def _excerpt(line: str, column: int, length: int, width: int = 100) -> tuple[int, str, int]:
    """Return the part of a line around a column, the caret's place in it and its length."""
    line = line.rstrip("\r").expandtabs(1)
    start = 0 if len(line) <= width else max(0, min(column - width // 3, len(line) - width))
    shown = line[start : start + width]
    before = column - start
    if start:
        shown, before = "..." + shown, before + 3
    if start + width < len(line):
        shown += "..."
    return before, shown, max(1, min(length, len(shown) - before))


def _summary(name: str, errors: int, warnings: int) -> str:
    def count(number: int, word: str) -> str:
        return f"{number} {word}{'' if number == 1 else 's'}"

    if not errors and not warnings:
        return f"{name}: no findings"
    return f"{name}: {count(errors, 'error')}, {count(warnings, 'warning')}"
