"""One contract for all rovers, and the checks of it seen red."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from executive.ports import Command, Event, Update
from ground.cli.main import app, register_all
from rover_iface.contract import CHECKS, check_rover, write_contract_world
from rover_iface.errors import RoverError, WorldError
from rover_iface.registry import find_rover, rover_names
from rover_iface.simulator import abstract_rover
from rover_iface.simulator.abstract_rover import AbstractRover
from tests.rover_iface.worlds import small_problem


@pytest.fixture(scope="module")
def world(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_contract_world(tmp_path_factory.mktemp("contract"))


@pytest.mark.parametrize("name", ["abstract", "subframe", pytest.param("full", marks=pytest.mark.slow)])
def test_every_rover_keeps_the_contract(name: str, world: Path) -> None:
    findings = check_rover(find_rover(name), world)
    assert len(findings) == len(CHECKS)
    assert [f"{f.name}: {f.detail}" for f in findings if not f.passed] == []


def make_faulty(**overrides: Any) -> Any:
    def make(world: Path) -> AbstractRover:
        rover = abstract_rover.make_rover(world)
        for name, value in overrides.items():
            setattr(rover, name, value.__get__(rover))
        return rover

    return make


def broken(make: Any, world: Path) -> dict[str, str]:
    return {f.name: f.detail for f in check_rover(make, world) if not f.passed}


def test_a_rover_that_does_repeats_is_caught(world: Path) -> None:
    def send(self: AbstractRover, command: Command) -> None:
        self._done.pop(command.id, None)
        AbstractRover.send(self, command)

    assert (
        "a repeat of a command id was carried out again"
        in broken(make_faulty(send=send), world)["waits exactly and once"]
    )


def test_a_rover_that_never_acknowledges_is_caught(world: Path) -> None:
    def abort(self: AbstractRover, command: object) -> None:
        return None

    found = broken(make_faulty(abort=abort), world)
    assert "instead of an acknowledgement" in found["acknowledges an abort"]


def test_a_rover_that_makes_up_keys_is_caught(world: Path) -> None:
    def next_event(self: AbstractRover, until_ms: int | None) -> Event | None:
        event = AbstractRover.next_event(self, until_ms)
        return Update(event.t_ms, {**event.values, "mood": 1.0}) if isinstance(event, Update) else event

    found = broken(make_faulty(next_event=next_event), world)
    assert (
        '":mood" is not in the telemetry dictionary' in found["visits a target and keeps to its dictionaries"]
    )


def test_a_rover_that_cannot_be_made_fails_every_check(world: Path) -> None:
    def make(world: Path) -> AbstractRover:
        raise WorldError("no such place")

    assert len(broken(make, world)) == len(CHECKS)


def test_rovers_are_found_by_name() -> None:
    assert {"abstract", "subframe", "full"} <= set(rover_names())
    with pytest.raises(RoverError, match='unknown rover "curiosity"; known are abstract'):
        find_rover("curiosity")


def test_the_command_checks_a_rover_and_names_an_unknown_one() -> None:
    if not any(group.name == "rover" for group in app.registered_groups):
        register_all()
    run = CliRunner().invoke(app, ["rover", "check", "abstract"])
    assert run.exit_code == 0, run.output
    assert "abstract: 12 of 12 checks passed" in run.output
    run = CliRunner().invoke(app, ["rover", "check", "curiosity"])
    assert run.exit_code == 2
    assert 'unknown rover "curiosity"' in run.output


def test_a_subframe_rover_without_terrain_says_what_it_needs() -> None:
    with pytest.raises(WorldError, match='world "small" has no terrain; a rover on terrain needs one'):
        find_rover("subframe")(small_problem())
