"""What holds for every test."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from functools import _lru_cache_wrapper, cache
from types import ModuleType

import pytest
from hypothesis import settings

from tests.memory import Leavings
from tests.seeds import JUDGED

# Machines differ and are shared: no test is judged by its time.
settings.register_profile("outcrop", deadline=None, derandomize=JUDGED)
settings.load_profile("outcrop")

MADE_FOR_ALL = {"fprime": "fprime", "ros_python": "ros2"}
"""Fixtures of the session that take a minute to make, and the group of the tests that need them."""


@pytest.hookimpl(tryfirst=True)  # before xdist reads the groups
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Bring tests that share something costly to one process, which makes it once; begin with what is slow.

    What is shared is what a module makes for all its tests, by a fixture or by a function that keeps what it
    returned; each process of the suite would make its own.
    Groups go out by their size, then tests by themselves in this order: a slow one at the end would run
    when the other processes have nothing left to do.
    """
    for item in items:
        if isinstance(item, pytest.Function) and not any(item.iter_markers("xdist_group")):
            group = shared_by(item)
            if group:
                item.add_marker(pytest.mark.xdist_group(group))
    items.sort(key=lambda item: not (alone(item) and item.get_closest_marker("slow")))


def alone(item: pytest.Item) -> bool:
    """Return whether a test belongs to no group."""
    return item.get_closest_marker("xdist_group") is None


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """Keep the garbage collector from what is collected: 900,000 objects that all stay to the end.

    Afterwards it comes as rarely as in a server: it took a fourteenth of the time of tests of the ground.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.set_threshold(20_000, 10, 100)
        gc.enable()


LEAVINGS = Leavings()


def pytest_runtest_logfinish() -> None:
    """Let go of what the test left, if it is much."""
    LEAVINGS.clear()


def pytest_runtest_teardown(item: pytest.Item, nextitem: pytest.Item | None) -> None:
    """Close the browser that tests share after the last of them."""
    if in_browser(item) and not (nextitem and in_browser(nextitem)):
        from tests.web.page import close_chromium

        close_chromium()


def in_browser(item: pytest.Item) -> bool:
    """Return whether a test drives a browser."""
    return item.get_closest_marker("browser") is not None


def shared_by(item: pytest.Function) -> str:
    """Return the group of a test, empty where it shares nothing."""
    used = set(item.fixturenames)
    if costly := sorted(used & MADE_FOR_ALL.keys()):
        return MADE_FOR_ALL[costly[0]]
    scopes = {
        made.scope for name in used for made in item.session._fixturemanager.getfixturedefs(name, item) or ()
    }
    return item.nodeid.partition("::")[0] if "module" in scopes or keeps(item.module) else ""


@cache
def keeps(module: ModuleType) -> bool:
    """Return whether a module has functions of its own that keep what they returned."""
    return any(
        isinstance(made, _lru_cache_wrapper) and made.__module__ == module.__name__
        for made in vars(module).values()
    )
