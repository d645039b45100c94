"""One run of a campaign as a row, and its two written forms: a line of a unit and a line of `runs.csv`."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass

from ground.spreadsheet import inert

CSV_HEAD = "seed,utility,outcome,end_s,energy_used_j,options"
UNFINISHED = "UNFINISHED"

_LETTERS = {"SUCCEEDED": "S", "FAILED": "F", "ABORTED": "A", "SKIPPED": "-", None: "?"}
OUTCOMES = ("SUCCEEDED", "FAILED", "ABORTED", "SKIPPED", UNFINISHED)
"""Outcomes that a plan may have."""
_WORDS = {letter: word for word, letter in _LETTERS.items()}


@dataclass(frozen=True, slots=True)
class Row:
    """What is kept of a run.

    Attributes
    ----------
    outcome
        Of the plan; `UNFINISHED` if nothing could happen any more before it was over.
    energy_used_j
        As the rover last reported it.
    exceeded
        Budgets that the run went over.
    options
        Ids of the options that branches chose, in order.
    nodes
        Outcome of each node as a letter (S, F, A, -, ?), in the order of their ids.
    reasons
        Why a node FAILED or was ABORTED, by its id; of an action also the rover's word.
    lost
        Targets whose track was lost, in the order of their loss.
    trace
        First 16 digits of the SHA-256 of the run's `trace.jsonl`.
    """

    seed: int
    utility: float
    outcome: str
    end_ms: int
    energy_used_j: float
    exceeded: tuple[str, ...]
    options: tuple[str, ...]
    nodes: str
    reasons: Mapping[str, str]
    lost: tuple[str, ...]
    trace: str

    @property
    def end_s(self) -> float:
        return self.end_ms / 1000

    def line(self) -> str:
        """Return the row as a line of JSON, without the break."""
        return _encode(
            [
                self.seed,
                self.utility,
                self.outcome,
                self.end_ms,
                self.energy_used_j,
                self.exceeded,
                self.options,
                self.nodes,
                self.reasons,
                self.lost,
                self.trace,
            ]
        )

    @staticmethod
    def read(line: str) -> Row:
        """Return the row of a line.

        Raises
        ------
        ValueError
            If the line is not whole.
        """
        parts = json.loads(line)
        if not isinstance(parts, list) or not _is_row(*parts):
            raise ValueError(f"{line[:60]!r} is not a row")
        seed, utility, outcome, end_ms, energy, exceeded, options, nodes, reasons, lost, trace = parts
        return Row(
            seed,
            utility,
            outcome,
            end_ms,
            energy,
            tuple(exceeded),
            tuple(options),
            nodes,
            reasons,
            tuple(lost),
            trace,
        )

    def csv(self) -> str:
        """Return the row as a line of `runs.csv`, without the break; options are joined by `;`."""
        options = inert(";".join(self.options))
        return (
            f"{self.seed},{self.utility!r},{self.outcome},{self.end_s:.3f},{self.energy_used_j:.3f},{options}"
        )


def _is_row(*parts: object) -> bool:
    """Return whether the members of a line have the types of a row's."""
    return len(parts) == len(_KINDS) and all(isinstance(p, k) for p, k in zip(parts, _KINDS, strict=True))


_KINDS: tuple[type | tuple[type, ...], ...] = (
    int,
    (int, float),
    str,
    int,
    (int, float),
    list,
    list,
    str,
    dict,
    list,
    str,
)
"""Types of the members of a line, in its order."""

_encode = json.JSONEncoder(separators=(",", ":"), ensure_ascii=False, allow_nan=False).encode


def letters_of(outcomes: Mapping[str, str | None], ids: tuple[str, ...]) -> str:
    """Return outcomes as letters, in the order of `ids`."""
    return "".join(_LETTERS.get(outcomes[node], "?") for node in ids)


def word_of(letter: str) -> str:
    """Return the outcome that a letter stands for."""
    return _WORDS[letter] or UNFINISHED
