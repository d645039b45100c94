"""`outcrop plan sequence` and `outcrop plan plandev`: plans in the forms of flight projects."""

from __future__ import annotations

import json
from datetime import datetime
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import fail, refusals

if TYPE_CHECKING:
    from executive.crl.nodes import Plan

PLAN = Annotated[Path, typer.Argument(help="CRL file of the plan.")]
BRANCH = Annotated[
    list[str] | None,
    typer.Option("--branch", help="Option to take, or nominal: the last option of each branch. Repeatable."),
]


class SequenceForm(StrEnum):
    """What a sequence is written as."""

    SEQ = "seq"
    SEQ_JSON = "seq-json"


def sequence(
    plan: PLAN,
    dictionary: Annotated[
        Path, typer.Option("--dictionary", help="F Prime's dictionary (.json) or XTCE (.xml).")
    ],
    out: Annotated[Path, typer.Option("--out", help="File to write.")],
    form: Annotated[SequenceForm, typer.Option("--as", help="What is written.")] = SequenceForm.SEQ,
    branch: BRANCH = None,
    mapping: Annotated[
        Path | None, typer.Option("--map", help="flight-map/1 of the dictionary's import.")
    ] = None,
    epoch: Annotated[str, typer.Option(help="UTC of the plan's start: windows open at absolute times.")] = "",
) -> None:
    """Write a straight run of a plan as a sequence of F Prime or PlanDev.

    What a sequence cannot say (branches, conditions, windows that close) is listed by name; then --branch has
    to say which run is meant. Exit status 0: written, 2: refused.
    """
    from ground.cli.flight_group.dictionary import read_foreign
    from neighbours.flight.flight_map import load_flight_map
    from neighbours.flight.sequence import sent_commands, seq_json, seq_text, unsaid_times
    from neighbours.flight.straight_run import NOMINAL, straight_run, unsaid

    with refusals():
        tree = _read(plan)
        start = _time(epoch) if epoch else None
        run = straight_run(tree, branch or [NOMINAL])
        commands = sent_commands(run, read_foreign(dictionary), load_flight_map(mapping))
        left = (*unsaid(tree), *unsaid_times(commands, form.value, start))
        for line in left:
            typer.echo(f"not said: {line}", err=True)
        if left and not branch:
            fail(f"{plan}: {len(left)} things are left out; name the run: --branch {NOMINAL} or an option")
        if form is SequenceForm.SEQ:
            text = seq_text(commands, f"{tree.id or plan.stem}, run {run.name}", left, start)
        else:
            text = json.dumps(seq_json(commands, tree.id or plan.stem, left, start), indent=1) + "\n"
        out.write_text(text, encoding="utf-8")
    typer.echo(f"wrote {len(commands)} commands of the run {run.name} to {out}")


def plandev(
    plan: PLAN,
    out: Annotated[Path, typer.Option("--out", help="Folder: one file for each run of the plan.")],
    start: Annotated[str, typer.Option(help="UTC of the plan's start, ISO 8601.")],
    profile: Annotated[
        str, typer.Option(help="Rover profile whose dictionary gives the types of activities.")
    ] = "k9",
) -> None:
    """Write each run of a plan as a model-free plan for PlanDev.

    A file holds activities with their types, spans, and profiles of energy and time.
    """
    from neighbours.flight.plandev import plandev_plan
    from neighbours.flight.straight_run import straight_runs
    from rover_iface.profile import load_profile

    with refusals():
        tree = _read(plan)
        begins = _time(start)
        commands = load_profile(profile).language.commands
        runs = straight_runs(tree)
        out.mkdir(parents=True, exist_ok=True)
        for run in runs:
            name = f"{tree.id or plan.stem}-{'-'.join(run.options) or run.name}"
            document = plandev_plan(tree, run, commands, begins, name)
            (out / f"{name}.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    typer.echo(f"wrote {len(runs)} plans to {out}")


def _read(path: Path) -> Plan:
    from executive.crl import parse

    return parse(path.read_text(encoding="utf-8"))


def _time(text: str) -> datetime:
    try:
        found = datetime.fromisoformat(text)
    except ValueError:
        fail(f"{text!r} is not a time in ISO 8601, for instance 2030-01-01T00:00:00Z")
    if found.tzinfo is None:
        fail(f"{text!r} has no zone: end it with Z for UTC")
    return found
