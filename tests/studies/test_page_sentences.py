"""The study of the page's sentences: a short run finds none that is false, and it sees a false one."""

from __future__ import annotations

import re
import time
from typing import Any

import numpy as np
import pytest

from studies.page_sentences import CHECKS, cases, said, study

pytestmark = pytest.mark.slow

FIGURE = re.compile(r"(?<![\w.:])[<>\u2212]?\d+(?:\.\d+)?(?![\w:])")
FIGURES_MATTER = ("changes in value", "is worth", "expected", "earns")


def _lie(line: Any) -> Any:
    """Return a line with its last figure changed by far, or turned round where it has none that counts."""
    if isinstance(line, dict):
        return line | {"here": _other(line["here"])}
    return _other(line) if any(words in line for words in FIGURES_MATTER) else f"Not so: {line}"


def _other(text: str) -> str:
    last = list(FIGURE.finditer(text))[-1]
    value = float(last[0].lstrip("<>\u2212"))
    return f"{text[: last.start()]}{95.0 if value < 50.0 else 3.0:.2f}{text[last.end() :]}"


def test_a_few_sentences_of_fresh_days_are_true() -> None:
    seed = time.time_ns() % 1_000_000_000
    told, wrong = study(8, seed)
    print(f"seed {seed}: {dict(told)}")
    assert sum(told.values()) >= 8
    assert wrong == [], f"seed {seed}"


def test_false_sentences_are_seen() -> None:
    rng = np.random.default_rng(5)
    found = [case for _ in range(2) for case in cases(rng)]
    kinds = set()
    for case, true in zip(found, said(found), strict=True):
        for k, line in enumerate(true):
            if line is not None:
                kinds.add(case.kind)
                lied = [*true[:k], _lie(line), *true[k + 1 :]]
                assert list(CHECKS[case.kind](case, lied)) != [], lied
    assert kinds == set(CHECKS)
