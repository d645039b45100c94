"""Implementations by name: built in, of installed packages, and those that cannot be loaded."""

from __future__ import annotations

from importlib.metadata import EntryPoint, EntryPoints

import pytest

from mission import plugins
from mission.constraints import constraint_type
from mission.errors import PluginError
from mission.plugins import Registry


@pytest.fixture
def announced(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints(
        [
            EntryPoint("broken", "no_such_package.trackers:Tracker", "outcrop.tests"),
            EntryPoint("json", "json:loads", "outcrop.tests"),
            EntryPoint("raising", "tests.mission.raises_on_import:Tracker", "outcrop.tests"),
        ]
    )
    monkeypatch.setattr(plugins, "entry_points", lambda group: points.select(group=group))


@pytest.mark.usefixtures("announced")
def test_packages_add_to_what_is_built_in() -> None:
    registry = Registry("reader", "outcrop.tests", {"dumps": "json:dumps", "json": "json:load"})
    assert registry.names() == ["broken", "dumps", "json", "raising"]
    import json

    assert registry.load("dumps") is json.dumps
    assert registry.load("json") is json.loads, "an announced one takes the place of a built-in"
    assert registry.own_names() == ["dumps"]


@pytest.mark.usefixtures("announced")
@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("x", 'unknown reader "x"; known are broken, dumps, json, raising'),
        (
            "broken",
            r'reader "broken" \(no_such_package.trackers:Tracker\) cannot be loaded: ModuleNotFoundError',
        ),
        ("raising", r"cannot be loaded: ZeroDivisionError: .*; others are broken, dumps, json"),
    ],
)
def test_what_cannot_be_loaded_is_one_sentence(name: str, message: str) -> None:
    with pytest.raises(PluginError, match=message):
        Registry("reader", "outcrop.tests", {"dumps": "json:dumps"}).load(name)


def test_an_announced_constraint_must_be_one(monkeypatch: pytest.MonkeyPatch) -> None:
    points = EntryPoints([EntryPoint("odd", "json:loads", "outcrop.constraints")])
    monkeypatch.setattr(plugins, "entry_points", lambda group: points.select(group=group))
    with pytest.raises(PluginError, match=r'constraint "odd" is .*; a class of mission.Constraint is needed'):
        constraint_type("odd")
