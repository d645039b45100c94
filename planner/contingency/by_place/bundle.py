"""A proximal bundle method for the least value of a convex function of multipliers (Kiwiel 1990).

What is known of the function are values and subgradients at points looked at: tangents that lie below it. The
next point is the lowest of their maximum, with a penalty on the distance to the best point so far. The answer
need not be exact: any multipliers give a bound.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from planner.evaluate.model import Floats
from planner.tally import Step, spend

MOST = 60
"""Tangents that are kept, the latest. By hand: as many as there are multipliers with 30 targets."""

ROUNDS = 300
"""Steps for the lowest point of the tangents. By hand."""

SERIOUS, GOOD = 0.1, 0.5
"""Share of what the tangents promise from which a point is the best so far, and from which the next may be
farther. Kiwiel 1990 has 0.1 and 0.5."""

FARTHER, NEARER = 1.6, 0.8
"""What the reach changes by. By hand."""

LITTLE, FAR, TRIES = 1e-3, 4.0, 4
"""Promise, as a share of the value, below which a point farther off is tried, what the reach grows by then,
and how often: one steep tangent may have set it too short. By hand, on 30 targets of seed 5277784."""

NOTHING = 1e-4
"""Promise, as a share of the value, below which nothing more is looked for. By hand."""


@dataclass(eq=False)
class Bundle:
    """The best point so far, (count,), its value, what is known, and `reach`, which weighs distance."""

    point: Floats
    reach: float = 0.0
    value: float = math.inf
    looks: int = 0
    lowest_found: bool = False
    points: list[Floats] = field(default_factory=list)
    values: list[float] = field(default_factory=list)
    slopes: list[Floats] = field(default_factory=list)
    weights: Floats = field(default_factory=lambda: np.ones(1))

    def lowered(
        self,
        look: Callable[[Floats], tuple[float, Floats]],
        steps: int,
        *,
        first: float,
        should_stop: Callable[[], bool],
    ) -> Bundle:
        """Look at so many points, no multiplier of them below 0; return the bundle.

        `look` gives value and slope at a point; the first step aims at a share `first` of the value below.
        """
        if not self.values:
            value, slope = look(self.point)
            self._learn(self.point, value, slope)
            self.value = value
            self.reach = first * abs(value) / max(float(slope @ slope), 1e-12)
            steps -= 1
        for _ in range(steps):
            if should_stop():
                break
            point, promise = self._promising()
            if promise < NOTHING * abs(self.value):
                self.lowest_found = True
                break
            value, slope = look(point)
            self._learn(point, value, slope)
            gain = self.value - value
            if gain >= SERIOUS * promise:
                self.point, self.value = point, value
                self.reach *= FARTHER if gain >= GOOD * promise else 1.0
            else:
                self.reach *= NEARER
        return self

    def shares(self) -> dict[int, float]:
        """Return the shares that looks have in the policy at the best point, by their number from 0 on.

        No single policy is best there, but several that are as good; these are their shares in the one in
        which nothing is made more often than it may be, as far as it can be avoided. They are the dual
        solution for the best point.
        """
        if len(self.values) < 2:
            return {self.looks - 1: 1.0}
        self.lowest()
        first = self.looks - len(self.values)
        return {first + k: float(share) for k, share in enumerate(self.weights) if share > 0.0}

    def _learn(self, point: Floats, value: float, slope: Floats) -> None:
        self.looks += 1
        self.points = [*self.points, point][-MOST:]
        self.values = [*self.values, value][-MOST:]
        self.slopes = [*self.slopes, slope][-MOST:]

    def _promising(self) -> tuple[Floats, float]:
        """Return the next point and what it promises, from farther off where one nearby promises little."""
        point, promised = self.lowest()
        for _ in range(TRIES):
            if self.value - promised >= LITTLE * abs(self.value):
                break
            self.reach *= FAR
            point, promised = self.lowest()
        return point, self.value - promised

    def lowest(self) -> tuple[Floats, float]:
        """Return the lowest point of the tangents near the best one, and their maximum there.

        Over weights a of tangents, of sum 1, the dual is concave and its slopes are the tangents' values at
        max(0, point - reach * sum of a * slope): accelerated projected steps (Beck and Teboulle 2009).
        """
        slopes, reach = np.array(self.slopes), self.reach
        at_zero = np.array(self.values) - np.einsum("kj,kj->k", slopes, np.array(self.points))
        step = 1.0 / (reach * float(np.linalg.norm(slopes @ slopes.T, 2)) + 1e-12)
        weights = ahead = np.full(len(slopes), 1.0 / len(slopes))
        speed = 1.0
        spend(Step.CALL, 100)
        for _ in range(ROUNDS):
            point = np.maximum(0.0, self.point - reach * (ahead @ slopes))
            new = _on_simplex(ahead + step * (at_zero + slopes @ point))
            faster = (1.0 + math.sqrt(1.0 + 4.0 * speed * speed)) / 2.0
            ahead = new + (speed - 1.0) / faster * (new - weights)
            weights, speed = new, faster
        self.weights = weights
        point = np.maximum(0.0, self.point - reach * (weights @ slopes))
        return point, float((at_zero + slopes @ point).max())


def _on_simplex(values: Floats) -> Floats:
    """Return the nearest weights, none below 0, of sum 1."""
    down = np.sort(values)[::-1]
    over = (np.cumsum(down) - 1.0) / np.arange(1, len(values) + 1)
    return np.asarray(np.maximum(values - over[np.nonzero(down > over)[0][-1]], 0.0))
