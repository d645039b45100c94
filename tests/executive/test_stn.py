"""The temporal network against all-pairs longest paths worked out by brute force."""

from __future__ import annotations

import itertools
import random
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from executive.stn import ORIGIN, TemporalNetwork

NEVER = -(10**15)


class Oracle:
    """The same network as a matrix of longest paths, worked out anew each time (Floyd and Warshall)."""

    def __init__(self, points: int) -> None:
        self.points = points
        self.constraints: dict[int, tuple[int, int, int | None, int | None]] = {}
        self.executed: dict[int, int] = {ORIGIN: 0}
        self.void: set[int] = set()
        self.now = 0

    def edges(self) -> Iterator[tuple[int, int, int]]:
        """Yield each edge (from, to, least difference) of points that count."""
        for point in set(range(self.points)) - self.void:
            yield ORIGIN, point, self.executed.get(point, self.now)
            if point in self.executed:
                yield point, ORIGIN, -self.executed[point]
        for source, target, lo, hi in self.constraints.values():
            if {source, target} & self.void or {source, target} <= self.executed.keys():
                continue
            if lo is not None:
                yield source, target, lo
            if hi is not None:
                yield target, source, -hi

    def longest(self) -> list[list[int]] | None:
        """Return longest path lengths; None if there is a cycle of positive length."""
        size = self.points
        d = [[0 if i == j else NEVER for j in range(size)] for i in range(size)]
        for u, v, w in self.edges():
            d[u][v] = max(d[u][v], w)
        for k in range(size):
            dk = d[k]
            for i in range(size):
                if d[i][k] <= NEVER:
                    continue
                di = d[i]
                for j in range(size):
                    if dk[j] > NEVER and di[k] + dk[j] > di[j]:
                        di[j] = di[k] + dk[j]
        if any(d[i][i] > 0 for i in range(size)):
            return None
        return d


Row = tuple[int, int, int | None, int | None]
bound = st.one_of(st.none(), st.integers(-8, 12))
operation = st.one_of(
    st.tuples(st.just("add"), st.integers(0, 6), st.integers(0, 6), bound, bound),
    st.tuples(st.just("remove"), st.integers(0, 30)),
    st.tuples(st.just("execute"), st.integers(1, 6), st.integers(0, 5)),
    st.tuples(st.just("advance"), st.integers(0, 6)),
    st.tuples(st.just("void"), st.integers(1, 6)),
    st.tuples(st.just("relax")),
)


@settings(max_examples=400, deadline=None)
@given(st.lists(operation, min_size=1, max_size=25))
def test_network_agrees_with_all_pairs_after_every_step(steps: list[tuple[object, ...]]) -> None:
    network = TemporalNetwork()
    for _ in range(6):
        network.add_point()
    oracle = Oracle(7)
    known: list[int] = []
    for step in steps:
        match step:
            case ("add", int(u), int(v), lo, hi) if u != v:
                if isinstance(lo, int) and isinstance(hi, int) and lo > hi:
                    lo, hi = hi, lo
                assert lo is None or isinstance(lo, int)
                assert hi is None or isinstance(hi, int)
                index = network.add(u, v, lo, hi)
                oracle.constraints[index] = (u, v, lo, hi)
                known.append(index)
            case ("remove", int(k)) if known:
                index = known[k % len(known)]
                network.remove(index)
                oracle.constraints.pop(index, None)
            case ("execute", int(p), int(later)) if p not in oracle.executed and p not in oracle.void:
                oracle.now = oracle.now + later
                network.advance(oracle.now)
                network.execute(p, oracle.now)
                oracle.executed[p] = oracle.now
            case ("advance", int(later)):
                oracle.now += later
                network.advance(oracle.now)
            case ("void", int(p)) if p not in oracle.executed:
                network.void(p)
                oracle.void.add(p)
            case ("relax",):
                network.relax()
        paths = oracle.longest()
        assert network.consistent == (paths is not None), step
        if paths is None:
            conflict = network.conflict
            assert conflict is not None
            assert conflict.deficit_ms > 0
            continue
        for point in range(1, 7):
            if point not in oracle.executed and point not in oracle.void:
                assert network.dispatch_bound(point) == paths[ORIGIN][point], (step, point)


@settings(max_examples=300, deadline=None)
@given(
    st.lists(
        st.tuples(st.integers(0, 7), st.integers(0, 7), bound, bound),
        min_size=1,
        max_size=30,
    ),
    st.booleans(),
)
def test_conflict_is_a_chain_of_given_bounds_that_cannot_hold(rows: list[Row], incremental: bool) -> None:
    network = TemporalNetwork()
    for _ in range(7):
        network.add(ORIGIN, network.add_point(), 0, None)
    oracle = Oracle(8)
    if incremental:
        assert network.check() is None
    for u, v, lo, hi in rows:
        if u == v or (lo is not None and hi is not None and lo > hi):
            continue
        oracle.constraints[len(oracle.constraints)] = (u, v, lo, hi)
        (network.add if incremental else network.declare)(u, v, lo, hi)
    conflict = network.conflict if incremental else network.check()
    assert (conflict is None) == (oracle.longest() is not None)
    if conflict is None:
        return
    total = 0
    for link, following in zip(conflict.links, (*conflict.links[1:], conflict.links[0]), strict=True):
        assert link.to == following.from_
        total += link.weight_ms
        if link.constraint is not None:
            given = link.constraint
            expected = (given.source, given.target, given.lo_ms)
            if link.is_upper_bound:
                assert given.hi_ms is not None
                expected = (given.target, given.source, -given.hi_ms)
            assert (link.from_, link.to, link.weight_ms) == expected
    assert total == conflict.deficit_ms > 0


@settings(max_examples=150, deadline=None)
@given(
    st.lists(st.tuples(st.integers(0, 5), st.integers(0, 5), bound, bound), max_size=12),
    st.lists(st.tuples(st.integers(0, 8), st.integers(0, 8), bound, bound), max_size=12),
)
def test_a_trial_leaves_no_mark(
    base: list[tuple[int, int, int, int]], more: list[tuple[int, int, int, int]]
) -> None:
    network = TemporalNetwork()
    for _ in range(5):
        network.add(ORIGIN, network.add_point(), 0, None)
    for u, v, lo, hi in base:
        if u != v:
            network.declare(u, v, lo, hi)
    if network.check() is not None:
        return
    before = network.schedule()
    network.push()
    network.mark_points()
    for _ in range(3):
        network.add_point()
    for u, v, lo, hi in more:
        if u != v:
            network.add(u, v, lo, hi)
    network.pop()
    assert network.schedule() == before
    assert network.consistent
    assert network.check() is None
    assert network.schedule() == before


def test_check_names_the_cycle_and_by_how_much_it_fails() -> None:
    network = TemporalNetwork()
    a, b = network.add_point(), network.add_point()
    network.declare(ORIGIN, a, 0, None)
    network.declare(a, b, 30_000, None, "at least 30 s")
    network.declare(ORIGIN, b, None, 20_000, "by 20 s")
    conflict = network.check()
    assert conflict is not None
    assert conflict.deficit_ms == 10_000
    assert {link.constraint.label for link in conflict.links if link.constraint} == {
        "at least 30 s",
        "by 20 s",
    }
    assert [link.from_ for link in conflict.links] == [ORIGIN, a, b]


def test_a_start_is_delayed_until_its_partner_can_follow() -> None:
    # b must start within 10 s of a, and not before c has taken 100 s.
    network = TemporalNetwork()
    a, b, c = (network.add_point() for _ in range(3))
    for point in (a, b, c):
        network.declare(ORIGIN, point, 0, None)
    network.declare(a, b, 0, 10_000)
    network.declare(c, b, 100_000, None)
    assert network.check() is None
    network.relax()
    assert network.dispatch_bound(a) == 90_000
    assert network.dispatch_time(a) is None
    network.advance(5_000)
    assert network.dispatch_bound(a) == 95_000
    network.execute(c, 5_000)
    assert network.dispatch_time(a) == 95_000


def test_network_becomes_consistent_again_when_the_late_point_is_over() -> None:
    network = TemporalNetwork()
    a, b = network.add_point(), network.add_point()
    network.declare(ORIGIN, a, 0, 10_000)
    network.declare(a, b, 0, None)
    assert network.check() is None
    network.advance(10_000)
    assert network.consistent
    network.advance(10_001)
    assert not network.consistent
    assert network.conflict is not None
    assert network.conflict.deficit_ms == 1
    network.execute(a, 12_000)
    assert network.consistent
    assert network.dispatch_bound(b) == 12_000


@pytest.mark.parametrize("seed", range(20))
def test_network_breaks_at_the_time_that_it_names_if_nothing_occurs(seed: int) -> None:
    rng = random.Random(seed)
    network = TemporalNetwork()
    points = [network.add_point() for _ in range(12)]
    for before, after in itertools.pairwise(points):
        network.declare(before, after, rng.randrange(0, 900), rng.choice((None, 2_000)))
    for point in points[rng.randrange(12) :: 5]:
        network.declare(ORIGIN, point, 0, rng.randrange(11_000, 15_000))
    assert network.check() is None
    network.relax()
    now = 0
    for point in points[: rng.randrange(10)]:
        breaks = network.breaks_at()
        now = max(now, network.dispatch_bound(point)) + rng.randrange(200)
        network.advance(now)
        assert network.consistent == (breaks is None or now < breaks)
        if not network.consistent:
            return
        network.execute(point, now)
    breaks = network.breaks_at()
    if breaks is None:
        network.advance(10**9)
        assert network.consistent
        return
    network.advance(breaks - 1)
    assert network.consistent
    network.advance(breaks)
    assert not network.consistent


@pytest.mark.parametrize("seed", range(3))
def test_running_a_large_network_in_a_feasible_order_never_makes_it_inconsistent(seed: int) -> None:
    rng = random.Random(seed)
    network = TemporalNetwork()
    points = [network.add_point() for _ in range(300)]
    for before, after in itertools.pairwise(points):
        network.declare(before, after, rng.randrange(0, 5_000), rng.choice((None, 20_000)))
    network.declare(ORIGIN, points[0], 0, None)
    assert network.check() is None
    network.relax()
    now = 0
    for point in points:
        bound = network.dispatch_bound(point)
        now = max(now, bound)
        network.advance(now)
        network.execute(point, now)
        assert network.consistent


@pytest.mark.parametrize("seed", range(20))
def test_a_trial_leaves_nothing_behind(seed: int) -> None:
    rng = random.Random(seed)

    def network() -> TemporalNetwork:
        made, chance = TemporalNetwork(), random.Random(seed)
        points = [made.add_point() for _ in range(6)]
        for before, after in itertools.pairwise(points):
            made.declare(before, after, chance.randrange(0, 900), chance.choice((None, 2_000)))
        made.declare(ORIGIN, points[-1], 0, 11_000)
        assert made.check() is None
        made.advance(10)
        return made

    tried, other = network(), network()
    for _ in range(5):
        if rng.random() < 0.5:
            tried.breaks_at()
        tried.push()
        tried.mark_points()
        extra = tried.add_point()
        tried.add(rng.randrange(6), extra, 0, rng.randrange(500))
        tried.add(extra, rng.randrange(1, 6), rng.randrange(500), None)
        tried.breaks_at()
        tried.pop()
        assert tried.consistent == other.consistent
        assert tried.breaks_at() == other.breaks_at()
        for point in range(1, 7):
            assert tried.dispatch_bound(point) == other.dispatch_bound(point)
        now = tried.now_ms + rng.randrange(300)
        for one in (tried, other):
            one.advance(now)
        assert tried.schedule() == other.schedule()
        assert tried.consistent == other.consistent
