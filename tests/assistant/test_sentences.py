"""Sixty sentences that were written down before the grammar, and mutations of them."""

from __future__ import annotations

import random
import re
from pathlib import Path
from typing import Any

import pytest
import yaml

from ground.resources.drafts.grammar import Said, understand
from ground.resources.drafts.phrases import QuestionError, Surroundings
from tests.seeds import drawn_seed

FILE = yaml.safe_load((Path(__file__).parent / "sentences.yaml").read_text(encoding="utf-8"))
SENTENCES: list[dict[str, Any]] = FILE["sentences"]
WORDS = {
    "mast camera": "science_camera",
    "science camera": "science_camera",
    "science_camera": "science_camera",
    "microscope": "microscopic_imager",
    "microscopic imager": "microscopic_imager",
    "microscopic_imager": "microscopic_imager",
}
AROUND = Surroundings({n: (p[0], p[1]) for n, p in FILE["context"]["targets"].items()}, WORDS)


def as_object(said: Said) -> dict[str, Any]:
    """Return what was understood in the form of the list."""
    found: dict[str, Any] = {"kind": said.kind}
    for name in ("what", "target", "instrument", "at_most_s", "dwell_s", "value", "must_do"):
        if getattr(said, name) is not None:
            found[name] = getattr(said, name)
    if said.place_m is not None:
        found["east_m"], found["north_m"] = said.place_m
    if said.window_lmst_h is not None:
        found["window_lmst_h"] = list(said.window_lmst_h)
    if said.circle_m is not None:
        found["circle"] = list(said.circle_m)
    if said.polygon_m is not None:
        found["polygon_m"] = [list(corner) for corner in said.polygon_m]
    return found


def test_there_are_sixty() -> None:
    assert len(SENTENCES) == 60


@pytest.mark.parametrize("case", SENTENCES, ids=lambda case: case["say"][:60])
def test_each_sentence_is_the_right_object_or_the_right_question(case: dict[str, Any]) -> None:
    if "want" in case:
        assert as_object(understand(case["say"], AROUND)) == case["want"]
        return
    with pytest.raises(QuestionError) as asked:
        understand(case["say"], AROUND)
    for word in case["question"]:
        assert word in str(asked.value)


# ---- mutations

NUMBER = re.compile(r"(?<![\w.:-])-?\d+(?:\.\d+)?(?![\w:.]*\d)(?!:)")


def swapped(text: str, want: dict[str, Any], rng: random.Random) -> tuple[str, list[dict[str, Any]]] | None:
    """Return a sentence with another number, and the objects it may become: those where that number alone,
    or what follows from it, is another."""
    found = list(NUMBER.finditer(text))
    if not found:
        return None
    hit = rng.choice(found)
    new = rng.choice([round(rng.uniform(-50, 50), 1), rng.randint(1, 99), 0, 10**7])
    old = float(hit.group())

    def put(value: Any) -> list[Any]:
        """Return a value with the number in every place where it may have stood."""
        if isinstance(value, bool) or not isinstance(value, int | float | list | dict):
            return []
        if isinstance(value, list | dict):
            items = list(value.items()) if isinstance(value, dict) else list(enumerate(value))
            out = []
            for key, item in items:
                for other in put(item):
                    changed = value.copy()
                    changed[key] = other  # type: ignore[index]
                    out.append(changed)
            return out
        scale = [s for s in (1.0, 60.0, 3600.0, 0.01) if abs(value - old * s) < 1e-9]
        return [new * s for s in scale]

    return text[: hit.start()] + f"{new}" + text[hit.end() :], put(want)


def corners(found: dict[str, Any]) -> Any:
    """Return an object so that boxes of the same corners are equal."""
    points = found.get("polygon_m")
    return {**found, "polygon_m": None if points is None else sorted(map(tuple, points))}


def test_a_swapped_number_is_in_the_object_or_asked_about() -> None:
    seed = drawn_seed()
    rng = random.Random(seed)
    understood = 0
    good = [case for case in SENTENCES if "want" in case and NUMBER.search(case["say"])]
    for _ in range(100):
        case = rng.choice(good)
        text, allowed = swapped(case["say"], case["want"], rng) or ("", [])
        try:
            found = as_object(understand(text, AROUND))
        except QuestionError:
            continue
        understood += 1
        if "box" in text or "rectangle" in text:  # one number moves two corners
            numbers = sorted(float(n) for n in NUMBER.findall(text))
            assert sorted({c[0] for c in found["polygon_m"]} | {c[1] for c in found["polygon_m"]}) == sorted(
                set(numbers)
            ), (seed, text)
            continue
        rounded = [corners(_rounded(a)) for a in allowed]
        assert corners(_rounded(found)) in rounded, (seed, text, found)
    assert understood > 20


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {k: _rounded(v) for k, v in value.items()}
    if isinstance(value, list):
        return [_rounded(v) for v in value]
    return round(float(value), 6) if isinstance(value, int | float) and not isinstance(value, bool) else value


def test_an_unknown_word_anywhere_is_asked_about() -> None:
    """Also words that turn the meaning round: no sentence with one of them passes for one without it."""
    seed = drawn_seed()
    rng = random.Random(seed)
    good = [case["say"] for case in SENTENCES if "want" in case]
    for _ in range(100):
        words = rng.choice(good).split()
        strange = rng.choice(
            [
                "not",
                "never",
                "unless",
                "except",
                "maybe",
                "zorgle",
                "without",
                "twice",
                "approve",
                "".join(rng.choices("bcdfgklmnprstvz", k=7)),
            ]
        )
        words.insert(rng.randrange(len(words) + 1), strange)
        text = " ".join(words)
        with pytest.raises(QuestionError):
            print(seed, text, understand(text, AROUND))


@pytest.mark.parametrize(
    "text",
    [
        "image the rock at 12,30 with the mast camera",
        "image Rock1 near 3, 4 with the mast camera",
        "image the rock at 1, 2 at 3, 4 with the mast camera",
        "image Rock1 with the mast camera with the microscope",
        "x" * 5000,
        "image the rock at 3, 4) with the mast camera",
        "image the rock at 2 m north and 5 m north with the mast camera",
        "image Rock1 with the mast camera before 10:75",
        "keep out of the box from 1, 2 to 1, 6",
        'image "  " at 1, 2 with the mast camera',
    ],
)
def test_what_can_be_read_in_two_ways_is_asked_about(text: str) -> None:
    with pytest.raises(QuestionError):
        understand(text, AROUND)


def test_names_that_differ_by_capitals_alone_are_asked_about() -> None:
    around = Surroundings({"Rock": (0.0, 0.0), "rock": (1.0, 1.0)}, WORDS)
    assert understand("image rock with the mast camera", around).target == "rock"
    with pytest.raises(QuestionError, match="Rock, rock"):
        understand("image ROCK with the mast camera", around)
