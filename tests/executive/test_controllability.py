"""Dynamic controllability against what must hold, and against strategies tried by exhaustion."""

from __future__ import annotations

from itertools import product

from hypothesis import given, settings
from hypothesis import strategies as st

from executive.crl.checks.controllability import Contingent, dynamically_controllable

Row = tuple[int, int, int | None, int | None]


def test_waiting_for_the_end_of_an_uncertain_task_is_possible() -> None:
    assert dynamically_controllable(3, [(1, 2, 0, 5)], [Contingent(0, 1, 10, 20)]) is True


def test_acting_before_an_uncertain_end_is_not() -> None:
    assert dynamically_controllable(3, [(2, 1, 5, 9)], [Contingent(0, 1, 10, 20)]) is False


def test_too_narrow_a_window_after_an_uncertain_task_is_not() -> None:
    assert (
        dynamically_controllable(3, [(1, 2, 0, None), (0, 2, None, 19)], [Contingent(0, 1, 10, 20)]) is False
    )
    assert (
        dynamically_controllable(3, [(1, 2, 0, None), (0, 2, None, 20)], [Contingent(0, 1, 10, 20)]) is True
    )


def test_the_effort_is_bounded() -> None:
    rows: list[Row] = [(1, 2, 0, None), (0, 2, None, 20)]
    assert dynamically_controllable(3, rows, [Contingent(0, 1, 10, 20)], steps=0) is None


def strategy_exists(rows: list[Row], link: Contingent, point: int, horizon: int) -> bool:
    """Try every strategy for one free point: a fixed time, or, once the end is seen, any later time.

    Points: 0 = origin and start of the link, 1 = its end, `point` = 2 is ours. The decision at time t may
    depend on the end only if that is not later than t (whole seconds; the end is seen before we act).
    """

    def holds(end: int, ours: int) -> bool:
        at = {0: 0, 1: end, point: ours}
        return all(
            (lo is None or at[v] - at[u] >= lo) and (hi is None or at[v] - at[u] <= hi)
            for u, v, lo, hi in rows
        )

    durations = range(link.lo, link.hi + 1)
    # Act at `fixed` unless the end was seen before; then at any time from the end on.
    for fixed in range(horizon + 1):
        if all(
            holds(d, fixed) if d > fixed else any(holds(d, ours) for ours in range(d, horizon + 1))
            for d in durations
        ):
            return True
    return False


bound = st.one_of(st.none(), st.integers(-6, 8))


@settings(max_examples=300, deadline=None)
@given(
    st.lists(st.tuples(st.sampled_from([(0, 2), (1, 2)]), bound, bound), max_size=3),
    st.integers(1, 4),
    st.integers(1, 4),
)
def test_agrees_with_every_strategy_for_one_free_point(
    given_rows: list[tuple[tuple[int, int], int | None, int | None]], lo: int, more: int
) -> None:
    link = Contingent(0, 1, lo, lo + more)
    rows: list[Row] = [(0, 2, 0, 16)]
    for (u, v), low, high in given_rows:
        if low is None or high is None or low <= high:
            rows.append((u, v, low, high))
    assert dynamically_controllable(3, rows, [link]) is strategy_exists(rows, link, 2, 16)


@settings(max_examples=200, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5), bound, bound), max_size=8),
    st.lists(st.tuples(st.integers(1, 4), st.integers(1, 5)), min_size=2, max_size=2),
)
def test_a_controllable_network_is_consistent_for_all_extreme_durations(
    given_rows: list[Row], spans: list[tuple[int, int]]
) -> None:
    from executive.stn import TemporalNetwork

    links = [Contingent(2 * k, 2 * k + 1, lo, lo + more) for k, (lo, more) in enumerate(spans)]
    ends = {link.end for link in links}
    rows: list[Row] = [(0, point, 0, None) for point in range(1, 6)]
    rows += [
        (u, v, lo, hi) for u, v, lo, hi in given_rows if u != v and (lo is None or hi is None or lo <= hi)
    ]
    assert ends == {1, 3}

    def consistent(durations: tuple[int, ...]) -> bool:
        network = TemporalNetwork()
        for _ in range(5):
            network.add_point()
        for row in rows:
            network.declare(*row)
        for link, duration in zip(links, durations, strict=True):
            network.declare(link.start, link.end, duration, duration)
        return network.check() is None

    if dynamically_controllable(6, rows, links) is True:
        assert all(consistent(choice) for choice in product(*((link.lo, link.hi) for link in links)))
