"""Transforms of a recording, put together: `map` to `odom` and `odom` to `base_link` give the pose.

Between two transforms of a link its value lies on the straight line and the shortest turn, as in tf2. After
its last one it stays: a correction holds until the next. Before its first one there is none.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections import Counter, deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

MOST_LINKS = 1000
"""Links that are kept. A robot has some tens; frames that each message numbers anew have no end."""

Point = tuple[float, float, float]
Turn = tuple[float, float, float, float]
"""x, y, z, w of a unit quaternion."""
Motion = tuple[Point, Turn]
Link = tuple[str, str]
"""Parent and child."""


@dataclass(slots=True)
class _Samples:
    """What was told of one link: times in nanoseconds, and seven numbers of each."""

    fixed: bool = False
    times: array[int] = field(default_factory=lambda: array("q"))
    numbers: array[float] = field(default_factory=lambda: array("d"))
    late: int = 0

    def add(self, t_ns: int, motion: Motion) -> None:
        if self.times and t_ns < self.times[-1]:
            self.late += 1
        self.times.append(t_ns)
        self.numbers.extend((*motion[0], *motion[1]))

    def motion(self, place: int) -> Motion:
        x, y, z, qx, qy, qz, qw = self.numbers[7 * place : 7 * place + 7]
        return (x, y, z), (qx, qy, qz, qw)

    def sort(self) -> None:
        """Put the samples in order of time; of two of one time the first stays."""
        order = sorted(range(len(self.times)), key=self.times.__getitem__)
        kept = [n for k, n in enumerate(order) if k == 0 or self.times[n] != self.times[order[k - 1]]]
        numbers = array("d", (v for n in kept for v in self.numbers[7 * n : 7 * n + 7]))
        self.times, self.numbers = array("q", (self.times[n] for n in kept)), numbers

    def at(self, t_ns: int) -> Motion | None:
        """Return the motion at a time, None before the first."""
        if self.fixed or len(self.times) == 1:
            return self.motion(len(self.times) - 1)
        place = bisect_right(self.times, t_ns)
        if place == 0:
            return None
        if place == len(self.times) or self.times[place - 1] == t_ns:
            return self.motion(place - 1)
        before, after = self.times[place - 1], self.times[place]
        return between(self.motion(place - 1), self.motion(place), (t_ns - before) / (after - before))


class Transforms:
    """Transforms as they come; `chain` leads down from a parent to a child, and `poses` is what it gives."""

    def __init__(self) -> None:
        self._links: dict[Link, _Samples] = {}
        self.left_out = 0

    def take(self, t_ns: int, link: Link, motion: Motion, *, fixed: bool) -> None:
        """Take in one transform; a fixed one holds for all times.

        Raises
        ------
        ValueError
            If it has a number that is not finite, or no direction.
        """
        length = math.hypot(*motion[1])
        if not all(map(math.isfinite, (*motion[0], length))) or length < 0.5:
            raise ValueError("no transform")
        samples = self._links.get(link)
        if samples is None:
            if len(self._links) == MOST_LINKS:
                self.left_out += 1
                return
            samples = self._links[link] = _Samples()
        samples.fixed = samples.fixed or fixed
        x, y, z, w = (v / length for v in motion[1])
        samples.add(t_ns, (motion[0], (x, y, z, w)))

    def chain(self, parents: Sequence[str], children: Sequence[str]) -> list[Link]:
        """Return the links from the first of the parents that leads to a child, the earlier the better."""
        above: dict[str, list[str]] = {}
        for parent, child in self._links:
            above.setdefault(child, []).append(parent)
        for top in parents:
            for bottom in children:
                found = _way_up(above, bottom, top)
                if found:
                    return found
        return []

    def frames(self) -> list[str]:
        """Return the links in words, for a refusal."""
        return [f"{parent} -> {child}" for parent, child in sorted(self._links)]

    def late(self, chain: Sequence[Link]) -> Counter[Link]:
        """Return how many transforms of each link came out of order."""
        return Counter({link: self._links[link].late for link in chain if self._links[link].late})

    def poses(self, chain: Sequence[Link]) -> Iterator[tuple[int, Motion | None]]:
        """Yield the motion of the whole chain at the times of its busiest link, in order.

        None where another link has none yet.
        """
        samples = [self._links[link] for link in chain]
        for one in samples:
            if not one.fixed:
                one.sort()
        busiest = max(samples, key=lambda one: 1 if one.fixed else len(one.times))
        times = busiest.times[-1:] if busiest.fixed else busiest.times
        for t_ns in times:
            whole: Motion | None = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 1.0))
            for one in samples:
                step = one.at(t_ns)
                whole = None if whole is None or step is None else composed(whole, step)
            yield t_ns, whole


def _way_up(above: dict[str, list[str]], bottom: str, top: str) -> list[Link]:
    """Return the shortest way from a frame up to another, the topmost link first; empty if there is none."""
    below: dict[str, str] = {}
    queue, seen = deque([bottom]), {bottom}
    while queue:
        child = queue.popleft()
        for parent in above.get(child, ()):
            if parent in seen:
                continue
            below[parent] = child
            if parent == top:
                way, frame = [], top
                while frame != bottom:
                    way.append((frame, below[frame]))
                    frame = below[frame]
                return way
            seen.add(parent)
            queue.append(parent)
    return []


def composed(first: Motion, second: Motion) -> Motion:
    """Return `a_from_c` of `a_from_b` and `b_from_c`."""
    (px, py, pz), turn = first
    rx, ry, rz = _turned(turn, second[0])
    return (px + rx, py + ry, pz + rz), _product(turn, second[1])


def between(before: Motion, after: Motion, share: float) -> Motion:
    """Return the motion a share of the distance from one to another."""
    x, y, z = (a + share * (b - a) for a, b in zip(before[0], after[0], strict=True))
    q, r = before[1], after[1]
    cosine = sum(a * b for a, b in zip(q, r, strict=True))
    if cosine < 0:  # the same turn the other way round would be the long one
        r, cosine = (-r[0], -r[1], -r[2], -r[3]), -cosine
    angle = math.acos(min(1.0, cosine))
    if angle < 1e-9:  # below this the sine is the angle, to all digits
        kept, gained = 1 - share, share
    else:
        kept = math.sin((1 - share) * angle) / math.sin(angle)
        gained = math.sin(share * angle) / math.sin(angle)
    qx, qy, qz, qw = (kept * a + gained * b for a, b in zip(q, r, strict=True))
    return (x, y, z), (qx, qy, qz, qw)


def _product(first: Turn, second: Turn) -> Turn:
    ax, ay, az, aw = first
    bx, by, bz, bw = second
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def _turned(turn: Turn, point: Point) -> Point:
    x, y, z, w = turn
    back = (-x, -y, -z, w)
    tx, ty, tz, _ = _product(_product(turn, (*point, 0.0)), back)
    return tx, ty, tz
