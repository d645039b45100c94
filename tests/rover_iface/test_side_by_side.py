"""Two things at once: in order, at the same time, errors told."""

from __future__ import annotations

import threading

import pytest

from rover_iface.side_by_side import side_by_side


def test_results_come_in_order_and_the_work_is_done_at_the_same_time() -> None:
    met = threading.Barrier(2, timeout=30.0)

    def work(value: int) -> int:
        met.wait()  # goes on only when both are here
        return 10 * value

    assert side_by_side(work, (1, 2)) == [10, 20]


def test_one_thing_needs_no_thread() -> None:
    assert side_by_side(lambda _: threading.current_thread(), (1,)) == [threading.current_thread()]


@pytest.mark.parametrize("bad", [1, 2])
def test_what_any_raises_is_raised(bad: int) -> None:
    def work(value: int) -> int:
        if value == bad:
            raise ValueError(f"{value} is bad")
        return value

    with pytest.raises(ValueError, match=f"{bad} is bad"):
        side_by_side(work, (1, 2))
