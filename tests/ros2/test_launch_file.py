"""The launch file of the example against a stand-in for ROS 2: it starts a command that Outcrop has."""

from __future__ import annotations

import runpy
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from typer.testing import CliRunner

from ground.cli.main import app, register_all
from tests.ros2.fakes import TURTLE


class Action:
    """What an action of a launch description was made of."""

    def __init__(self, *args: Any, **given: Any) -> None:
        self.args, self.given = args, given


def launched(monkeypatch: pytest.MonkeyPatch, **arguments: str) -> tuple[list[str], dict[str, Any]]:
    """Return the command of the file's one process with its substitutions done, and how it is kept up."""
    found: dict[str, str] = {}

    class Declared(Action):
        def __init__(self, name: str, default_value: str) -> None:
            super().__init__()
            found[name] = arguments.get(name, default_value)

    class Process(Action): ...

    class Configured(Action):
        def __str__(self) -> str:
            return found[self.args[0]]

    members: dict[str, dict[str, Any]] = {
        "launch": {"LaunchDescription": list},
        "launch.actions": {"DeclareLaunchArgument": Declared, "ExecuteProcess": Process},
        "launch.substitutions": {"LaunchConfiguration": Configured},
    }
    for name, values in members.items():
        module = ModuleType(name)
        module.__dict__.update(values)
        monkeypatch.setitem(sys.modules, name, module)
    described = runpy.run_path(str(TURTLE.parent / "turtle.launch.py"))["generate_launch_description"]()
    (process,) = (one for one in described if isinstance(one, Process))
    parts = process.given.pop("cmd")
    return ["".join(map(str, part)) if isinstance(part, list) else str(part) for part in parts], process.given


def test_it_starts_the_bridge_with_the_arguments_of_the_launch(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    command, kept = launched(monkeypatch, socket=str(tmp_path / "s.sock"))
    assert command[:3] == ["outcrop", "rover", "ros2"]
    assert Path(command[3]) == TURTLE
    assert command[4:] == ["--listen", f"unix:{tmp_path / 's.sock'}", "--out", "/tmp/turtle-products"]
    assert kept["respawn"] is True
    assert kept["respawn_delay"] > 0


def test_the_command_line_takes_what_it_starts(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    command, _ = launched(monkeypatch, out=str(tmp_path))
    register_all()
    checked = CliRunner().invoke(app, [*command[1:], "--check"])
    assert checked.exit_code == 0, checked.output
    assert "turtle" in checked.output
