"""The folder of a campaign.

================================  ====================================================================
`order.json`                      `campaign-order/1`: what is flown; refuses the runs of another campaign
`units/000000.jsonl`              rows of a unit; each file is whole or absent, and stays
`runs.csv`                        the rows that count, for people and other programs, sorted by seed
`campaign.json`                   `campaign/1`: what the rows say
`variants/NAME`, `helps/NAME`     the same of another case on the same seeds
================================  ====================================================================
"""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path

from ground.campaigns.case import Case, sha256_of
from ground.campaigns.row import CSV_HEAD, Row
from ground.campaigns.units import Unit
from ground.errors import InvalidInputError, StateError
from mission.codec import Codec
from mission.values import value

ORDER, RUNS, RESULT, UNITS = "order.json", "runs.csv", "campaign.json", "units"
MAIN = ""
"""Name of the series of the plan as it is; the others are folders: `variants/NAME`."""


@value
class SeriesOrder:
    """One case of a campaign: `name` is its folder, `runs` 0 stands for as many as the campaign has."""

    name: str
    crl_text: str
    world_text: str
    runs: int = 0


@value
class CampaignOrder:
    """All that decides the rows of a campaign but their number, and the utility that the planner expected."""

    program: str
    rover: str
    seed: int
    unit: int
    series: tuple[SeriesOrder, ...]
    expected_utility: float | None = None

    def case(self, name: str = MAIN) -> Case:
        """Return the case of a series."""
        return next(self.case_of(s) for s in self.series if s.name == name)

    def case_of(self, series: SeriesOrder) -> Case:
        """Return the case that a series stands for."""
        return Case(series.crl_text, series.world_text, self.rover)

    @property
    def digest(self) -> str:
        """Return the SHA-256 of what decides the rows of the main series."""
        main = self.case()
        return sha256_of(self.program, self.rover, str(self.seed), str(self.unit), main.digest)


ORDERS = Codec(CampaignOrder, "campaign-order/1", "campaign order", error=InvalidInputError)


class CampaignFolder:
    """Reads and writes the folder of a campaign."""

    def __init__(self, path: Path) -> None:
        self.path = path

    # ---- order

    def open(self, order: CampaignOrder, *, resume: bool) -> None:
        """Take the folder for a campaign: new and empty, or one of the same order if it is to go on.

        The order that is written also keeps the series that lie there and are not asked for this time: their
        rows stay, and are those of another variant when one of the same name is asked for.

        Raises
        ------
        StateError
            If there is a campaign and `resume` is not set, or it is another one.
        InvalidInputError
            If the path is a file, or nothing of a campaign is there to go on with.
        """
        if self.path.exists() and not self.path.is_dir():
            raise InvalidInputError(f"{self.path} is a file; a folder is needed")
        there = (self.path / ORDER).exists()
        if there and not resume:
            raise StateError(f"{self.path} holds a campaign; --resume goes on with it")
        if there:
            held = self.order()
            _same(self.path, held, order)
            asked = {s.name for s in order.series}
            order = replace(order, series=order.series + tuple(s for s in held.series if s.name not in asked))
            known = {s.name for s in held.series}
            for series in order.series:
                if series.name not in known and (self.series_folder(series.name) / UNITS).exists():
                    raise StateError(f"{self.path}: {series.name} holds runs of which {ORDER} says nothing")
        elif self.path.exists() and any(self.path.iterdir()):
            raise InvalidInputError(f"{self.path} is not empty and holds no campaign")
        self.path.mkdir(parents=True, exist_ok=True)
        write_whole(self.path / ORDER, ORDERS.write(order, indent=1) + "\n")

    def order(self) -> CampaignOrder:
        """Return the order of the campaign.

        Raises
        ------
        InvalidInputError
            If there is none, or it cannot be read.
        """
        if not (self.path / ORDER).is_file():
            raise InvalidInputError(f"{self.path} holds no campaign ({ORDER} is missing)")
        return ORDERS.read_file(self.path / ORDER)

    # ---- units

    def series_folder(self, series: str) -> Path:
        """Return the folder of a series."""
        return self.path / series if series else self.path

    def _unit(self, unit: Unit) -> Path:
        return self.series_folder(unit.series) / UNITS / f"{unit.index:06d}.jsonl"

    def read_unit(self, unit: Unit) -> str | None:
        """Return the rows of a unit if all are there and sound, a longer file cut to them, else None."""
        try:
            content = self._unit(unit).read_text(encoding="utf-8")
            kept = content.split("\n")[: unit.count]
            seeds = [Row.read(line).seed for line in kept]
        except (FileNotFoundError, ValueError):
            return None
        text = "".join(line + "\n" for line in kept)
        whole = seeds == list(range(unit.first, unit.first + unit.count)) and content.startswith(text)
        return text if whole else None

    def write_unit(self, unit: Unit, text: str) -> None:
        """Write the rows of a unit, wholly or not at all."""
        path = self._unit(unit)
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text)

    def rows(self, series: str = MAIN, runs: int | None = None) -> Iterator[Row]:
        """Yield the rows of a series in the order of their seeds: the first `runs`, or all that are there.

        More may be there than a campaign counts: it was asked for more before, or a stop rule ended it.

        Raises
        ------
        InvalidInputError
            If a line is damaged.
        """
        return islice(self._rows(series), runs)

    def _rows(self, series: str) -> Iterator[Row]:
        for path in sorted((self.series_folder(series) / UNITS).glob("*.jsonl")):
            with path.open(encoding="utf-8") as file:
                try:
                    yield from map(Row.read, file)
                except ValueError as err:
                    raise InvalidInputError(f"{path} is damaged: {err}") from err

    def row(self, seed: int, series: str = MAIN) -> Row:
        """Return the row of a seed.

        Raises
        ------
        InvalidInputError
            If the campaign has none; the message says which it has.
        """
        first = last = None
        for row in self.rows(series):
            if row.seed == seed:
                return row
            first, last = row.seed if first is None else first, row.seed
        held = "no runs" if first is None else f"the seeds {first} to {last}"
        raise InvalidInputError(f"{self.path} has no seed {seed}; it holds {held}")

    # ---- results

    def write_csv(self, series: str, runs: int) -> str:
        """Write `runs.csv` from the first runs of the units; return its SHA-256."""
        path = self.series_folder(series) / RUNS
        draft = path.with_suffix(".draft")
        digest = hashlib.sha256()
        try:
            with draft.open("w", encoding="utf-8", newline="\n") as file:
                head = CSV_HEAD + "\n"
                file.write(head)
                digest.update(head.encode())
                for row in self.rows(series, runs):
                    line = row.csv() + "\n"
                    file.write(line)
                    digest.update(line.encode())
            draft.replace(path)
        except OSError:
            draft.unlink(missing_ok=True)
            raise
        return digest.hexdigest()

    def result_document(self, series: str = MAIN) -> object:
        """Return `campaign.json`, parsed.

        Raises
        ------
        InvalidInputError
            If it is missing or damaged: the campaign has not ended.
        """
        path = self.series_folder(series) / RESULT
        try:
            return json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise InvalidInputError(
                f"{self.path} has no {RESULT}: the campaign has not ended (outcrop campaign run --resume)"
            ) from None
        except (OSError, ValueError) as err:
            raise InvalidInputError(f"{path} cannot be read: {err}") from err


def _same(path: Path, held: CampaignOrder, asked: CampaignOrder) -> None:
    if held.digest == asked.digest:
        wanted = {s.name: s for s in asked.series}
        for series in held.series:
            other = wanted.get(series.name)
            if other is None:
                continue
            there, wanted_digest = held.case_of(series).digest, asked.case_of(other).digest
            if there != wanted_digest:
                raise StateError(
                    f"{path}: {series.name} holds the runs of another variant of that name: its digest is "
                    f"{there[:12]}, this one's {wanted_digest[:12]}"
                )
        return
    differs = next(
        name
        for name, a, b in (
            ("the seed", held.seed, asked.seed),
            ("the rover", held.rover, asked.rover),
            ("the plan", held.case().crl_text, asked.case().crl_text),
            ("the world", held.case().world_text, asked.case().world_text),
            ("the version of the program", (held.program, held.unit), (asked.program, asked.unit)),
        )
        if a != b
    )
    raise StateError(
        f"{path} holds another campaign: its digest is {held.digest[:12]}, this one's {asked.digest[:12]}; "
        f"{differs} differs"
    )


def write_whole(path: Path, text: str) -> None:
    """Write a file so that it is whole, durable, or not there at all."""
    draft = path.with_suffix(".draft")
    try:
        with draft.open("w", encoding="utf-8", newline="\n") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except OSError:
        draft.unlink(missing_ok=True)
        raise
