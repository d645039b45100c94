"""Multipliers of a relaxation, for each number of tracks that a day may begin with its own.

With how many tracks a day begins is decided before anything happens. So the bound is the largest, over these
numbers, of the least value that any multipliers give, and not the least of the largest: where several numbers
are as good, the latter mixes their policies. A question is answered for all numbers at once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from planner.contingency.by_place.bundle import Bundle
from planner.contingency.by_place.memories import Credits, Excursion
from planner.contingency.by_place.relaxation import NgRelaxation
from planner.evaluate.model import Floats


@dataclass(eq=False)
class _Lowered:
    """A bundle for one number of tracks, and what the policies forget that it looked at, in their order."""

    bundle: Bundle
    followed: list[dict[Excursion, float]] = field(default_factory=list)


class Multipliers:
    """The multipliers found so far, with what they are good for.

    `least` holds the least values by number of tracks, whatever the memory, and `points` where these were;
    `often` how often the policy of each question makes what is wanted [wanted], in their order.
    """

    def __init__(self, relaxation: NgRelaxation, credits: Credits) -> None:
        self.relaxation, self.credits = relaxation, credits
        self.least = np.full(relaxation.tracks + 1, math.inf)
        self.points = [np.zeros(len(relaxation.wanted.number))] * (relaxation.tracks + 1)
        self.largest: list[float] = []  # of `least`, after each question of the last search
        self.often: list[Floats] = []

    def with_more_tracks(self, relaxation: NgRelaxation) -> Multipliers:
        """Return them for a relaxation of days with more tracks.

        It is asked at the point of the number with the largest value, for what it says of the new numbers;
        of the others it says what was said before.
        """
        wider, known = Multipliers(relaxation, self.credits), len(self.least)
        point = self.points[int(self.least.argmax())]
        wider.least = relaxation.by_count(point)
        wider.least[:known] = self.least
        wider.points = [*self.points, *[point] * (len(wider.points) - known)]
        wider.often = self.often
        return wider

    def lower(
        self,
        steps: int,
        aim: float,
        should_stop: Callable[[], bool],
        *,
        enough: tuple[int, float] = (0, 0.0),
    ) -> None:
        """Lower the largest of the least values in so many questions, and credit what policies forget.

        The first step of a bundle aims at a share `aim` of the value below. It ends early where so many
        questions in a row win less than a share of the value that is `enough`.
        """
        lowered: dict[int, _Lowered] = {}
        some, share_won = enough
        self.largest = []

        def little() -> bool:
            last = self.largest[-some - 1 :]
            return some > 0 and len(last) > some and last[-1] > (1.0 - share_won) * last[0]

        def turned(count: int) -> bool:
            return should_stop() or little() or int(self.least.argmax()) != count

        looks = 0
        while looks < steps and not (should_stop() or little()):
            count = int(self.least.argmax())
            one = lowered.setdefault(count, _Lowered(Bundle(self.points[count])))
            if one.bundle.lowest_found:
                break
            before = one.bundle.looks
            one.bundle.lowered(
                partial(self._look, count, one.followed),
                steps - looks,
                first=aim,
                should_stop=partial(turned, count),
            )
            looks += one.bundle.looks - before
        self.credits.add(
            (share / len(lowered), one.followed[number])
            for one in lowered.values()
            for number, share in one.bundle.shares().items()
        )

    def _look(
        self, count: int, followed: list[dict[Excursion, float]], prices: Floats
    ) -> tuple[float, Floats]:
        """Return value and slope for days that begin with so many tracks, and follow their policy."""
        values = self.relaxation.by_count(prices)
        for lower in np.nonzero(values < self.least)[0]:
            self.least[lower], self.points[lower] = values[lower], prices
        self.largest.append(float(self.least.max()))
        followed.append(self.credits.followed(self.relaxation, count))
        often = self.relaxation.often(count)
        self.often.append(often)
        return float(values[count]), self.relaxation.limit(count) - often

    def asked(self, last: NgRelaxation, is_late: Callable[[], bool]) -> tuple[float, Floats]:
        """Return the bound of another relaxation at these multipliers, and those of the largest number.

        It is asked for the largest number of tracks, and again as long as another one is the largest.
        """
        least, at = np.full(len(self.least), math.inf), list(self.points)
        count, asked = int(self.least.argmax()), set[int]()
        while count not in asked and not (asked and is_late()):
            asked.add(count)
            values = last.by_count(self.points[count])
            for lower in np.nonzero(values < least)[0]:
                least[lower], at[lower] = values[lower], self.points[count]
            count = int(least.argmax())
        return float(least[count]), at[count]
