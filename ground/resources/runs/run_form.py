"""What the files of a `run/1` folder may hold: they come from elsewhere, and each member is looked at."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Generic, TypedDict, TypeVar, cast

from ground.errors import ArchiveError
from ground.uplink.flight import ProductLine, SampleLine

MAX_SEED = 2**63 - 1
"""What the database keeps of an integer."""
MAX_OUTCOME = 40

Check = Callable[[object], bool]
T = TypeVar("T")


class RunDocument(TypedDict, total=False):
    """What is read of a `run.json`; any member may be null."""

    format: str
    outcome: str | None
    outcomes: dict[str, str] | None
    utility: float | None
    end_s: float | None
    seed: int | None
    rover: str | None
    mission: str | None
    plan: str | None
    plan_digest: str | None
    package_sha256: str | None
    training: bool | None


@dataclass(frozen=True, slots=True)
class Form(Generic[T]):
    """What the members of an object of type `T` must be; it may have others."""

    checks: Mapping[str, Check]

    def read(self, path: Path, value: object) -> T:
        """Return an object of a file whose members are as they must be.

        Raises
        ------
        ArchiveError
            If one is not; the message names it.
        """
        if not isinstance(value, dict):
            raise _malformed(path, "", value)
        for name, check in self.checks.items():
            if not check(value.get(name)):
                raise _malformed(path, f"{name} ", value.get(name))
        return cast("T", value)


def is_number(value: object) -> bool:
    """Return whether a value is a finite number."""
    return type(value) in {int, float} and math.isfinite(float(str(value)))


def is_text(value: object, longest: int = 300) -> bool:
    """Return whether a value is a text that fits into a column."""
    return isinstance(value, str) and len(value) <= longest and "\0" not in value


def _or_none(check: Check) -> Check:
    return lambda value: value is None or check(value)


def _is_outcomes(value: object) -> bool:
    return isinstance(value, dict) and all(is_text(outcome, MAX_OUTCOME) for outcome in value.values())


def _is_seed(value: object) -> bool:
    return type(value) is int and 0 <= value <= MAX_SEED


def _is_trackers(value: object) -> bool:
    return isinstance(value, dict) and all(isinstance(one, dict) for one in value.values())


def _is_any_number(value: object) -> bool:
    return type(value) in {int, float}  # a rover that does not know its battery yet says NaN


DOCUMENT: Form[RunDocument] = Form(
    {
        "outcome": _or_none(lambda value: is_text(value, MAX_OUTCOME)),
        "outcomes": _or_none(_is_outcomes),
        "utility": _or_none(is_number),
        "end_s": _or_none(is_number),
        "seed": _or_none(_is_seed),
        "rover": _or_none(is_text),
        "mission": _or_none(is_text),
        "plan": _or_none(is_text),
        "plan_digest": _or_none(is_text),
        "package_sha256": _or_none(is_text),
        "training": _or_none(lambda value: type(value) is bool),
    }
)
SAMPLE: Form[SampleLine] = Form(
    {
        **dict.fromkeys(
            ("t_s", "east_m", "north_m", "heading_rad", "battery_j", "energy_used_j"), _is_any_number
        ),
        "task": is_text,
        "trackers": _is_trackers,
    }
)
PRODUCT: Form[ProductLine] = Form(
    {
        **dict.fromkeys(("path", "sha256", "kind", "task"), is_text),
        "t_s": is_number,
        "label": lambda value: isinstance(value, dict),
    }
)


def read_json(path: Path) -> Any:
    """Return what a file of JSON holds.

    Raises
    ------
    ArchiveError
        If it cannot be read.
    """
    return _parsed(path, _text(path))


def read_lines(path: Path) -> list[Any]:
    """Return what each line of a file of JSON lines holds.

    Raises
    ------
    ArchiveError
        If it cannot be read.
    """
    return [_parsed(path, line) for line in _text(path).splitlines() if line]


def held_record(path: Path, value: Any) -> list[Any]:
    """Return a record of a trace: time, event, arguments.

    Raises
    ------
    ArchiveError
        If it is none.
    """
    sound = isinstance(value, list) and len(value) >= 2 and is_number(value[0])
    if not sound or not all(isinstance(word, str) for word in value[1:]):
        raise _malformed(path, "", value)
    found: list[Any] = value
    return found


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, ValueError) as err:
        raise ArchiveError(f"{path.parent.name} is not a complete run/1 folder: {err}") from err


def _parsed(path: Path, text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError) as err:
        raise ArchiveError(
            f"{path.parent.name} is not a complete run/1 folder: {path.name} is not JSON: {err}"
        ) from err


def _malformed(path: Path, member: str, value: object) -> ArchiveError:
    return ArchiveError(f"{path.parent.name}: {path.name} is malformed: {member}{ascii(value)[:80]}")
