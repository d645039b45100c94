"""Pieces of sentences: numbers, times, durations and places, each as it stands at a position of a text."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field

LARGEST_M = 100_000.0
"""No coordinate of the site frame is larger (`ground.records.forms.Metres`)."""
NUMBER = r"[-+]?\d+(?:\.\d+)?(?![\w:])(?![.,]\d)"
"""A number in plain digits. What a comma without a space follows may be one number or two, and is none."""
SPOT = rf"\(?\s*({NUMBER})(?:\s*,\s*|\s+)({NUMBER})\s*\)?"
"""Two numbers, east and north."""
EDGE = r"(?![\w-])"
"""No letter goes on here, so that no word is read for half of it."""
TIME = r"(\d{1,2}:\d{2})(?![:\d])(?:\s*(?:LMST|hours?)\b)?"
LENGTH = rf"({NUMBER})\s*(cm|m|metres?|meters?)\b"
_UNIT_S = {"s": 1.0, "m": 60.0, "h": 3600.0}
DURATION = rf"(?:({NUMBER})\s*(seconds?|s|minutes?|min|hours?|h)\b|(half\s+an\s+hour|an\s+hour|one\s+hour)\b)"
PARTS_OF_DAY = {"morning": (6.0, 12.0), "afternoon": (12.0, 18.0)}
"""Hours of local mean solar time that the words stand for."""


class QuestionError(Exception):
    """Something of a sentence is not understood; the text asks for it by its words."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a sentence may name: targets with (east, north), metres of the site frame; instruments."""

    targets: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    instruments: Mapping[str, str] = field(default_factory=dict)
    """Each word for an instrument, in lower case, and the name under which requests hold it."""


@dataclass(slots=True)
class Reader:
    """Reads a sentence from its head; only spaces, commas and words that say nothing are passed over."""

    text: str
    around: Surroundings
    at: int = 0

    def skip(self) -> None:
        """Pass what says nothing."""
        found = re.compile(r"(?:[\s,]+|please\b|you\b)*", re.IGNORECASE).match(self.text, self.at)
        assert found is not None
        self.at = found.end()

    @property
    def done(self) -> bool:
        """Whether all of it is read."""
        self.skip()
        return self.at >= len(self.text)

    def take(self, pattern: str) -> re.Match[str] | None:
        """Return what stands here and go behind it; None if it is something else."""
        self.skip()
        found = re.compile(pattern, re.IGNORECASE).match(self.text, self.at)
        if found is not None:
            self.at = found.end()
        return found

    def word(self, pattern: str) -> re.Match[str] | None:
        """Return whole words that stand here and go behind them."""
        return self.take(rf"(?:{pattern}){EDGE}")

    def ahead(self) -> str:
        """Return the next words, as a question names them."""
        self.skip()
        words = self.text[self.at :].split()
        return " ".join(words[:4])[:200] if words else "nothing more"

    def name(self) -> str | None:
        """Return the name of a target that stands here, the longest that does; None if none does.

        Raises
        ------
        QuestionError
            If the names of several targets differ by their capitals alone.
        """
        self.skip()
        for pattern in sorted({n.lower() for n in self.around.targets}, key=len, reverse=True):
            found = re.compile(rf"{re.escape(pattern)}(?![\w-])", re.IGNORECASE).match(self.text, self.at)
            if found is None:
                continue
            names = [n for n in self.around.targets if n.lower() == pattern]
            exact = [n for n in names if n == found.group()]
            if len(names) > 1 and not exact:
                raise QuestionError(f"which of the targets {', '.join(names)} is {found.group()!r}?")
            self.at = found.end()
            return (exact or names)[0]
        return None

    def place(self, behind: str) -> tuple[float, float]:
        """Return the point (east, north), metres, that has to stand here.

        Raises
        ------
        QuestionError
            If no point and no target stands here, or both could be meant.
        """
        start = self.at
        name = self.name()
        behind_name, self.at = self.at, start
        spot = self.spot()
        if name is not None and spot is not None:
            raise QuestionError(f"is {name!r} behind {behind!r} the target or a number of a place?")
        if name is not None:
            self.at = behind_name
            return self.around.targets[name]
        if spot is None:
            raise QuestionError(
                f"where is that? Behind {behind!r} two numbers in metres (east, north) or the name of a "
                f"target are understood, not {self.ahead()!r}"
            )
        return spot

    def spot(self) -> tuple[float, float] | None:
        """Return the point whose numbers stand here; None if something else does."""
        east = north = ""
        if found := self.take(
            rf"east\s+({NUMBER})\s*(?:m\b)?\s*,?\s*(?:and\s+)?north\s+({NUMBER})\s*(?:m\b)?"
        ):
            east, north = found.groups()
        elif found := self.take(rf"{LENGTH}\s+(north|east)\s*,?\s*(?:and\s+)?{LENGTH}\s+(north|east)\b"):
            first, first_unit, one, second, second_unit, other = found.groups()
            if one.lower() == other.lower():
                raise QuestionError(f"{found.group()!r} says {one} twice; a place has an east and a north")
            points = {one.lower(): metres(first, first_unit), other.lower(): metres(second, second_unit)}
            return limited(points["east"]), limited(points["north"])
        elif found := self.take(SPOT):
            east, north = found.groups()
            if ("(" in found.group()) != (")" in found.group()):
                raise QuestionError(f"{found.group()!r} has one bracket")
        else:
            return None
        return limited(float(east)), limited(float(north))


def limited(number_m: float) -> float:
    """Return a coordinate that can be one.

    Raises
    ------
    QuestionError
        If no site is so large.
    """
    if abs(number_m) > LARGEST_M:
        raise QuestionError(f"{number_m:g} m is farther than {LARGEST_M:g} m; which place is meant?")
    return number_m


def metres(number: str, unit: str) -> float:
    """Return a length in metres."""
    return float(number) / (100.0 if unit.lower() == "cm" else 1.0)


def hours(told: str) -> float:
    """Return a time of the clock as hours of local mean solar time.

    Raises
    ------
    QuestionError
        If there is no such time.
    """
    hour, minute = (int(part) for part in told.split(":"))
    if minute > 59 or hour + minute / 60.0 > 24.0:
        raise QuestionError(f"{told} is not a time of a day from 0:00 to 24:00; which is meant?")
    return hour + minute / 60.0


def seconds(found: re.Match[str]) -> float:
    """Return the length of time that `DURATION` found.

    Raises
    ------
    QuestionError
        If it is none, or longer than a day.
    """
    number, unit, words = found.groups()[-3:]
    if words:
        return 1800.0 if words.lower().startswith("half") else 3600.0
    value = float(number) * _UNIT_S[unit[0].lower()]
    if not 0.0 < value <= 86_400.0:
        raise QuestionError(f"{number} {unit} is not a time from a second to a day; how long is meant?")
    return value
