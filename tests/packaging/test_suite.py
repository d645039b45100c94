"""How the suite spreads over processes, and what these keep."""

from __future__ import annotations

import gc
import weakref
from collections.abc import Iterator
from types import ModuleType

import pytest

from tests.conftest import keeps
from tests.memory import GROWN_MIB, Leavings


@pytest.mark.xdist_group("one process")
def test_tests_of_a_group_come_to_one_process(request: pytest.FixtureRequest) -> None:
    """The name of the group stands behind a test's own, where pytest-xdist looks for it."""
    if not request.config.getoption("loadgroup", default=False):
        pytest.skip("the suite runs in one process")
    assert request.node.nodeid.endswith("@one process")


def test_a_module_whose_functions_keep_what_they_returned_belongs_to_one_process() -> None:
    first, second, third = (ModuleType(name) for name in ("first", "second", "third"))
    exec("from functools import cache\n@cache\ndef site(): return 1", vars(first))
    vars(second)["site"] = vars(first)["site"]
    exec("from functools import cache\ndef site(): return 1", vars(third))
    assert [keeps(module) for module in (first, second, third)] == [True, False, False]


@pytest.fixture
def by_hand() -> Iterator[None]:
    """Let nothing be collected but by hand."""
    gc.disable()
    yield
    gc.enable()


@pytest.mark.usefixtures("by_hand")
def test_what_tests_leave_in_circles_goes_once_the_process_has_grown() -> None:
    class Circle:
        def __init__(self) -> None:
            self.itself = self

    resident_mib = 1000.0
    leavings = Leavings(lambda: resident_mib)
    left = weakref.ref(Circle())
    resident_mib += GROWN_MIB - 1.0
    assert not leavings.clear()
    assert left() is not None
    resident_mib += 1.0
    assert leavings.clear()
    assert left() is None
    assert not leavings.clear(), "it has grown no further since"
