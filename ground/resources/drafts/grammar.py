"""Plain sentences as proposals, by a grammar: every word is understood, or asked about by its name.

    request    VERB THING at PLACE with INSTRUMENT [WINDOW] [at most DURATION] [for DURATION] [worth NUMBER]
    window     only observe TARGET WINDOW; set the window of TARGET to WINDOW
    keep-out   keep out of SHAPE; keep LENGTH away from PLACE; do not drive within LENGTH of PLACE

No model and no guess: what stands in no rule, is said twice, contradicts or is missing becomes a question.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace

from ground.resources.drafts.phrases import (
    DURATION,
    LENGTH,
    NUMBER,
    PARTS_OF_DAY,
    SPOT,
    TIME,
    QuestionError,
    Reader,
    Surroundings,
    hours,
    limited,
    metres,
    seconds,
)

VERBS = r"image|photograph|observe|measure|look\s+at|take\s+(?:a\s+)?(?:picture|photograph|image)s?\s+of"
KINDS_OF_GROUND = (
    r"rocks?|stones?|outcrops?|dunes?|veins?|boulders?|pebbles?|soil|sand|ridge|ledge|float|crater|layer|"
    r"layers|bedrock|cobbles?|ripples?|fracture|clast|nodule|regolith|dust|cliff|slab"
)
ADJECTIVES = (
    r"layered|pale|dark|bright|red|grey|gray|white|black|blue|green|large|small|big|tall|flat|round|smooth|"
    r"rough|fractured|broken|dusty|sandy|weathered|bedded|fine|coarse|fine-grained|coarse-grained|light|thin|thick"
)
MAX_WORDS = 2000
"""Characters of a sentence: one thing is asked at a time."""
LARGEST_VALUE = 1e6
"""No request is worth more (`ground.records.forms.Utility`)."""
MAX_CORNERS = 500


@dataclass(frozen=True, slots=True)
class Said:
    """What a sentence asks for; what it does not say is None.

    Places are (east, north) in metres of the site frame, windows hours of local mean solar time, times
    seconds. `circle` is east, north, radius.
    """

    kind: str
    what: str | None = None
    target: str | None = None
    place_m: tuple[float, float] | None = None
    instrument: str | None = None
    window_lmst_h: tuple[float, float] | None = None
    at_most_s: float | None = None
    dwell_s: float | None = None
    value: float | None = None
    must_do: bool | None = None
    only: bool | None = None
    circle_m: tuple[float, float, float] | None = None
    polygon_m: tuple[tuple[float, float], ...] | None = None


def understand(text: str, around: Surroundings) -> Said:
    """Return what a sentence asks for.

    Raises
    ------
    QuestionError
        If any word of it is not understood, something is missing, said twice or contradicts.
    """
    if len(text) > MAX_WORDS:
        raise QuestionError(
            f"{len(text)} characters are more than the {MAX_WORDS} of one sentence; say it shorter"
        )
    reader = Reader(re.sub(r"[.!]+\s*$", "", text), around)
    if reader.done:
        raise QuestionError("nothing was said; what shall be drafted?")
    for begins in (_keep_out, _window, _request):
        said = begins(reader)
        if said is not None:
            return said
    raise QuestionError(
        f"what is meant by {reader.ahead()!r}? A sentence begins with image, photograph, observe or measure, "
        "with only or window, or with keep out of, keep ... away from or do not drive within"
    )


# ---- keep-outs


def _keep_out(reader: Reader) -> Said | None:
    if reader.word(r"keep\s+out\s+of|stay\s+out\s+of|avoid"):
        said = _shape(reader)
    elif reader.word(r"do\s+not\s+drive\s+within|no\s+driving\s+within"):
        said = _circle(reader, r"of|around", "of")
    elif reader.word(r"(?:keep|stay)(?=\s+[-+\d])"):
        said = _circle(reader, r"away\s+from", "away from")
    else:
        return None
    if not reader.done:
        raise QuestionError(f"a keep-out is understood, but not {reader.ahead()!r}; what does it mean there?")
    return said


def _circle(reader: Reader, between: str, word: str) -> Said:
    found = reader.take(LENGTH)
    if found is None:
        raise QuestionError(f"how far? A length such as 3 m is needed, not {reader.ahead()!r}")
    radius = _radius(*found.groups())
    if not reader.word(between):
        raise QuestionError(
            f"{found.group()} {word} what? {reader.ahead()!r} says no place: {word} from where?"
        )
    return Said("keep_out", circle_m=(*reader.place(word), radius))


def _radius(number: str, unit: str) -> float:
    radius = metres(number, unit)
    if not 0.0 < radius <= 1000.0:
        raise QuestionError(f"{number} {unit} is not a radius from a hair to 1,000 m; which is meant?")
    return radius


def _shape(reader: Reader) -> Said:
    reader.word(r"the|a")
    if reader.word(r"circle"):
        found = reader.take(rf"(?:of|with\s+(?:a\s+)?radius\s+(?:of\s+)?)\s*{LENGTH}")
        if found is None:
            raise QuestionError(f"which radius has the circle? {reader.ahead()!r} says none")
        radius = _radius(*found.groups())
        if not reader.word(r"around|at|about"):
            raise QuestionError(f"around what is the circle? {reader.ahead()!r} says no place")
        return Said("keep_out", circle_m=(*reader.place("around"), radius))
    if reader.word(r"box|rectangle"):
        reader.word(r"from")
        west, south = reader.place("from")
        if not reader.word(r"to"):
            raise QuestionError(f"to which corner goes the box? {reader.ahead()!r} says none")
        east, north = reader.place("to")
        if west == east or south == north:
            raise QuestionError("the box has no area: its corners are on one line; which are meant?")
        west, east, south, north = min(west, east), max(west, east), min(south, north), max(south, north)
        return Said("keep_out", polygon_m=((west, south), (east, south), (east, north), (west, north)))
    if reader.word(r"polygon"):
        corners: list[tuple[float, float]] = []
        while found := reader.take(SPOT):
            corners.append((limited(float(found[1])), limited(float(found[2]))))
        if not 3 <= len(corners) <= MAX_CORNERS or len(set(corners)) < 3:
            raise QuestionError(
                f"a polygon has 3 to {MAX_CORNERS} corners, each east and north; {len(corners)} corners are "
                f"read before {reader.ahead()!r}"
            )
        return Said("keep_out", polygon_m=tuple(corners))
    raise QuestionError(f"out of what? A circle, box or polygon is understood, not {reader.ahead()!r}")


# ---- windows of requests that are there


def _window(reader: Reader) -> Said | None:
    if reader.word(r"(?:set\s+)?(?:the\s+)?window\s+(?:of|for)"):
        target = reader.name()
        if target is None:
            raise QuestionError(f"the window of what? There is no target {reader.ahead()!r}")
        reader.word(r"is|to(?=\s+\d)|to(?=\s+(?:in|before|after|between)\b)")
        said = Said("window", target=target)
        while not reader.done:
            if (found := _when(reader)) is None:
                raise QuestionError(
                    f"a window is understood, but not {reader.ahead()!r}; what does it mean there?"
                )
            said = _with(said, "window_lmst_h", found, reader)
        return _whole_window(said)
    return None


def _whole_window(said: Said) -> Said:
    if said.window_lmst_h is None:
        raise QuestionError(f"which window? When may the observation of {said.target} start?")
    return said


# ---- requests

Phrase = Callable[[Reader], tuple[str, object] | None]


def _request(reader: Reader) -> Said | None:
    begins = rf"(?:(only)\s+)?(?:(must)\s+)?(?:{VERBS})"
    found = reader.word(begins)
    if found is None:
        if reader.word(r"with"):
            raise QuestionError(f"what shall be observed with {reader.ahead()!r}? The sentence names nothing")
        return None
    said = Said("request", only=True if found[1] else None, must_do=True if found[2] else None)
    while not reader.done:
        for phrase in _PHRASES:
            told = phrase(reader)
            if told is not None:
                said = _with(said, told[0], told[1], reader)
                break
        else:
            raise QuestionError(f"what does {reader.ahead()!r} mean? It is in no rule of these sentences")
    return _whole_request(said)


def _with(said: Said, name: str, value: object, reader: Reader) -> Said:
    if getattr(said, name) is not None:
        before = reader.text[max(0, reader.at - 40) : reader.at].strip()
        raise QuestionError(f"{name.rpartition('_')[0] or name} is said twice: {before!r}; which is meant?")
    changed: Said = replace(said, **{name: value})  # type: ignore[arg-type] # the name says the type
    return changed


def _whole_request(said: Said) -> Said:
    if said.only:
        extra = [
            n
            for n in ("what", "place_m", "instrument", "at_most_s", "dwell_s", "value", "must_do")
            if getattr(said, n) is not None
        ]
        if extra or said.target is None:
            raise QuestionError(
                "`only` sets the window of a request that is there: only observe TARGET WINDOW; "
                f"what do {', '.join(extra) or 'the other words'} mean here?"
            )
        return _whole_window(replace(said, kind="window", only=None))
    if said.target is None and said.what is None:
        raise QuestionError("what shall be observed? Neither a target nor something to be seen is named")
    if said.target is not None and (said.what is not None or said.place_m is not None):
        raise QuestionError(f"is the target {said.target} meant, or {said.what or said.place_m} beside it?")
    if said.target is None and said.place_m is None:
        raise QuestionError(f"where is {said.what!r}? Say: near EAST, NORTH in metres")
    if said.instrument is None:
        raise QuestionError("with which instrument? Say: with the ...")
    return said


def _instrument(reader: Reader) -> tuple[str, object] | None:
    if not reader.word(r"with(?!\s+value)|using"):
        return None
    reader.word(r"the|a")
    for words in sorted(reader.around.instruments, key=len, reverse=True):
        if reader.word(re.escape(words)):
            return "instrument", reader.around.instruments[words]
    known = ", ".join(sorted(set(reader.around.instruments)))
    raise QuestionError(f"which instrument is {reader.ahead()!r}? There are: {known}")


def _length_of_time(reader: Reader) -> tuple[str, object] | None:
    most = reader.word(r"at\s+most|up\s+to|(?:for\s+)?no(?:t)?\s+(?:longer|more)\s+than")
    if most is None and not reader.word(r"for(?=\s+[-+\d]|\s+half|\s+an|\s+one)"):
        return None
    found = reader.take(DURATION)
    if found is None:
        raise QuestionError(
            f"how long is {reader.ahead()!r}? A number and seconds, minutes or hours are needed"
        )
    return ("at_most_s" if most else "dwell_s"), seconds(found)


def _worth(reader: Reader) -> tuple[str, object] | None:
    if not reader.word(r"worth|(?:with\s+)?(?:a\s+)?value(?:\s+of)?"):
        return None
    found = reader.take(NUMBER)
    if found is None or not 0.0 < float(found.group()) <= LARGEST_VALUE:
        told = found.group() if found else reader.ahead()
        raise QuestionError(f"what is it worth? {told!r} is not a number above 0 and up to {LARGEST_VALUE:g}")
    return "value", float(found.group())


def _when(reader: Reader) -> tuple[float, float] | None:
    if found := reader.word(r"in\s+the\s+(morning|afternoon)"):
        return PARTS_OF_DAY[found[1].lower()]
    if found := reader.take(rf"(?:before|until)\s+{TIME}"):
        first, last = 0.0, hours(found[1])
    elif found := reader.take(rf"after\s+{TIME}"):
        first, last = hours(found[1]), 24.0
    elif found := reader.take(rf"(?:between\s+{TIME}\s+and|(?:from\s+)?{TIME}\s*(?:to|-|until))\s*{TIME}"):
        times = [time for time in found.groups() if time]
        first, last = hours(times[0]), hours(times[1])
    elif reader.word(r"before|after|until|between"):
        raise QuestionError(f"which time is {reader.ahead()!r}? Times are said as 10:30")
    else:
        return None
    if first >= last:
        raise QuestionError(f"{found.group()!r}: the window ends at or before its beginning; which is meant?")
    return first, last


def _window_said(reader: Reader) -> tuple[str, object] | None:
    found = _when(reader)
    return None if found is None else ("window_lmst_h", found)


def _only(reader: Reader) -> tuple[str, object] | None:
    return ("only", True) if reader.word(r"only") else None


def _where(reader: Reader) -> tuple[str, object] | None:
    found = reader.word(r"near|at(?!\s+most)|around")
    return None if found is None else ("place_m", reader.place(found.group()))


def _thing(reader: Reader) -> tuple[str, object] | None:
    start = reader.at
    reader.word(r"(?:the\s+)?target(?=\s)")
    if (name := reader.name()) is not None:
        return "target", name
    reader.at = start
    if quoted := reader.take(r"(?:the\s+|a\s+)?[\"“]([^\"“”\n]{1,80})[\"”]"):
        if not quoted[1].strip():
            raise QuestionError(f"{quoted.group()!r} names nothing; what shall be observed?")
        return "what", quoted[1].strip()
    found = reader.word(rf"(?:the\s+|an?\s+)?((?:(?:{ADJECTIVES})\s+)*(?:{KINDS_OF_GROUND}))")
    return None if found is None else ("what", " ".join(found[1].split()))


_PHRASES: tuple[Phrase, ...] = (
    _length_of_time,
    _worth,
    _instrument,
    _window_said,
    _only,
    _where,
    _thing,
)
"""What may follow the verb, in any order; the first that begins so is taken."""
