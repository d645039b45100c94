"""How the suite spreads over processes."""

from __future__ import annotations

import pytest


@pytest.mark.xdist_group("one process")
def test_tests_of_a_group_come_to_one_process(request: pytest.FixtureRequest) -> None:
    """The name of the group stands behind a test's own, where pytest-xdist looks for it."""
    if not request.config.getoption("loadgroup", default=False):
        pytest.skip("the suite runs in one process")
    assert request.node.nodeid.endswith("@one process")
