"""The link between ground and rover: what is known where and when, with light time and passes. Pure.

The executive is on board and does not wait for the link; only commands of the operator, and what comes back,
do. A pass is the time in which the rover can hear and be heard, on the clock of the plan where the rover is.
"""

from __future__ import annotations

import json
import math
from bisect import bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path

from ground.errors import InvalidInputError
from mission.values import value

FORMAT = "ground-view/1"
LONGEST_LIGHT_TIME_S = 36_000.0
"""Ten hours: beyond Pluto."""


@value
class Pass:
    """A time of contact; `data_mbit` is what it can bring down."""

    name: str
    start_s: float
    end_s: float
    data_mbit: float

    @property
    def rate_mbit_s(self) -> float:
        return self.data_mbit / (self.end_s - self.start_s)


@value
class Link:
    """One-way light time and the passes in order; without passes there is contact at all times, and room.

    Raises
    ------
    InvalidInputError
        If the light time is not a time from 0 to `LONGEST_LIGHT_TIME_S`, or passes overlap or are empty.
    """

    light_time_s: float = 0.0
    passes: tuple[Pass, ...] = ()

    def __post_init__(self) -> None:
        if not 0.0 <= self.light_time_s <= LONGEST_LIGHT_TIME_S:
            raise InvalidInputError(
                f"the light time is {self.light_time_s:g} s; it may be 0 to {LONGEST_LIGHT_TIME_S:g} s"
            )
        before: Pass | None = None
        for one in self.passes:
            if not (math.isfinite(one.start_s) and math.isfinite(one.end_s) and one.start_s < one.end_s):
                raise InvalidInputError(
                    f"pass {one.name!r} ends at {one.end_s:g} s, not after {one.start_s:g} s"
                )
            if not (math.isfinite(one.data_mbit) and one.data_mbit >= 0.0):
                raise InvalidInputError(
                    f"pass {one.name!r} brings {one.data_mbit:g} Mbit; it may be 0 or more"
                )
            if before is not None and one.start_s < before.end_s:
                raise InvalidInputError(
                    f"pass {one.name!r} begins at {one.start_s:g} s, before {before.name!r} ends at "
                    f"{before.end_s:g} s"
                )
            before = one

    def contact_s(self, t_s: float) -> float | None:
        """Return the first time from `t_s` on at which there is contact; None if there is none any more."""
        if not self.passes:
            return t_s
        place = bisect_right([p.start_s for p in self.passes], t_s)
        if place and t_s <= self.passes[place - 1].end_s:
            return t_s
        return self.passes[place].start_s if place < len(self.passes) else None

    def command_arrives_s(self, sent_s: float) -> float | None:
        """Return when the rover hears a command that the ground wants to send at `sent_s`.

        It is held on the ground until it will arrive in a pass.
        """
        return self.contact_s(sent_s + self.light_time_s)

    def record_known_s(self, t_s: float) -> float | None:
        """Return when the ground knows of a record made on board at `t_s`.

        Records are small and go before products; their volume is not counted.
        """
        contact = self.contact_s(t_s)
        return None if contact is None else contact + self.light_time_s

    def products_known_s(self, products: Sequence[tuple[float, float]]) -> list[float | None]:
        """Return when each product is whole on the ground, None where it never is.

        `products` are pairs of the time at which one was made and its volume in Mbit. They go down in the
        order in which they were made, one after the other, at the even rate of each pass; one that does not
        fit into what is left of a pass goes on in the next.
        """
        known: list[float | None] = [None] * len(products)
        free_s = -math.inf
        for number in sorted(range(len(products)), key=lambda k: products[k][0]):
            made_s, volume = products[number]
            end_s = self._sent(max(made_s, free_s), volume)
            if end_s is None:
                free_s = math.inf
                continue
            free_s = end_s
            known[number] = end_s + self.light_time_s
        return known

    def _sent(self, t_s: float, volume: float) -> float | None:
        """Return when the last bit leaves the rover, of a product whose first may leave from `t_s` on."""
        if not self.passes:
            return t_s
        for one in self.passes:
            begin = max(t_s, one.start_s)
            if begin > one.end_s or one.rate_mbit_s <= 0.0:
                continue
            room = one.rate_mbit_s * (one.end_s - begin)
            if volume <= room:
                return begin + volume / one.rate_mbit_s
            volume -= room
        return None


def read_passes(path: Path) -> tuple[Pass, ...]:
    """Return the passes of a JSON file: a list of them, or a sol as `outcrop sol show` prints it.

    Raises
    ------
    InvalidInputError
        If the file cannot be read, or a pass lacks a member.
    """
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as err:
        raise InvalidInputError(f"{path} holds no passes: {err}") from err
    found = document.get("passes") if isinstance(document, Mapping) else document
    if not isinstance(found, list):
        raise InvalidInputError(f"{path} holds no passes: a list, or a sol with `passes`, is wanted")
    passes = []
    for number, one in enumerate(found, 1):
        try:
            start, end, data = (float(one[key]) for key in ("start_s", "end_s", "data_mbit"))
            passes.append(Pass(str(one.get("name") or f"pass {number}"), start, end, data))
        except (KeyError, TypeError, ValueError, AttributeError) as err:
            raise InvalidInputError(
                f"{path}: pass {number} needs the numbers start_s, end_s and data_mbit: {err!r}"
            ) from err
    return tuple(passes)


@dataclass(frozen=True, slots=True)
class KnownCommand:
    """A command of the operator: when it was sent, and when the rover heard it, None where it never did."""

    operation: str
    sent_s: float
    heard_s: float | None


@dataclass(frozen=True, slots=True)
class KnownRecord:
    """A record of the trace, and when the ground knows of it."""

    t_s: float
    event: str
    known_s: float | None


@dataclass(frozen=True, slots=True)
class KnownProduct:
    """A product, and when it is whole on the ground."""

    path: str
    t_s: float
    mbit: float
    known_s: float | None


@dataclass(frozen=True, slots=True)
class GroundView:
    """What the ground knows of a run and when."""

    link: Link
    commands: tuple[KnownCommand, ...]
    end_known_s: float | None
    records: tuple[KnownRecord, ...]
    products: tuple[KnownProduct, ...]

    def text(self) -> str:
        """Return the JSON text, the form `ground-view/1`."""
        members = asdict(self)
        members["records"] = [[r.t_s, r.event, r.known_s] for r in self.records]
        return json.dumps({"format": FORMAT, **members.pop("link"), **members}) + "\n"


def ground_view(
    link: Link,
    records: Iterable[tuple[float, str]],
    products: Sequence[tuple[float, str, int]],
    *,
    end_s: float | None,
    commands: Iterable[KnownCommand] = (),
) -> GroundView:
    """Return what the ground knows of a run and when.

    Parameters
    ----------
    records
        Time and name of each record of the trace, in order.
    products
        Time, path and size in bytes of each product.
    end_s
        When the run ended, if it did.
    """
    arrive = link.products_known_s([(t_s, 8e-6 * size) for t_s, _, size in products])
    return GroundView(
        link,
        tuple(commands),
        None if end_s is None else link.record_known_s(end_s),
        tuple(KnownRecord(t_s, event, link.record_known_s(t_s)) for t_s, event in records),
        tuple(
            KnownProduct(path, t_s, round(8e-6 * size, 6), known)
            for (t_s, path, size), known in zip(products, arrive, strict=True)
        ),
    )
