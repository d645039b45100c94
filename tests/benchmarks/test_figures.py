"""What a benchmark says is held to its limit, and each benchmark has the form that `scripts/bench` runs."""

from __future__ import annotations

import importlib
import inspect
import json
import math
import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import pytest

import benchmarks
from benchmarks.__main__ import names_in
from benchmarks.common.figure import Figure, command, number
from benchmarks.cost import Curve, draw

NAMES = names_in(benchmarks.__path__)


@pytest.mark.parametrize(
    ("value", "verdict", "at_least"),
    [(0.9, "ok", "under"), (1.0, "ok", "ok"), (1.1, "over", "ok"), (math.nan, "over", "under")],
)
def test_a_value_is_held_to_the_most_or_the_least(value: float, verdict: str, at_least: str) -> None:
    figure = Figure("a job", value, "s", 1.0)
    assert (figure.verdict, figure.exceeded) == (verdict, verdict != "ok")
    figure = replace(figure, least=True)
    assert (figure.verdict, figure.exceeded) == (at_least, at_least != "ok")


def test_a_figure_without_a_limit_passes_none() -> None:
    figure = Figure("a job", math.inf, "s")
    assert (figure.verdict, figure.exceeded, figure.cells()[2:]) == ("", False, ["", ""])


def test_a_limit_of_zero_is_a_limit() -> None:
    assert Figure("lost", 1, limit=0).verdict == "over"
    assert Figure("lost", 0, limit=0).verdict == "ok"


def test_where_there_is_a_ratio_the_limit_is_the_ratios() -> None:
    figure = Figure("a job", 100.0, "s", 2.0, ratio=1.5, to="a peer")
    assert figure.cells() == ["a job", "100 s, 1.5 times a peer", "at most 2 times", "ok"]
    assert replace(figure, value=0.1, ratio=2.5).verdict == "over"


@pytest.mark.parametrize(("ratio", "to"), [(1.5, ""), (None, "a peer")])
def test_a_ratio_says_what_it_is_to(ratio: float | None, to: str) -> None:
    with pytest.raises(ValueError, match="a job"):
        Figure("a job", 1.0, ratio=ratio, to=to)


def test_numbers_are_short_and_never_in_powers_of_ten() -> None:
    found = [number(value) for value in (0.0, 0.012345, 3.14159, 99.96, 999.96, 10_000, 1_234_567.8)]
    assert found == ["0", "0.0123", "3.142", "99.96", "1,000", "10,000", "1,234,568"]


def some(
    count: int = 3, names: tuple[str, ...] = (), scale: float = 1.0, twice: bool = False
) -> Iterator[Figure]:
    yield Figure("-".join(names) or "none", count * scale * (2 if twice else 1), "s", 10.0)


@pytest.mark.parametrize(
    ("given", "name", "value", "status"),
    [
        ([], "none", 3.0, 0),
        (["--quick"], "none", 1.0, 0),
        (["--quick", "--count", "7"], "none", 7.0, 0),
        (["--names", "a", "b", "--scale", "1.5", "--twice"], "a-b", 9.0, 0),
        (["--count", "11"], "none", 11.0, 1),
    ],
)
def test_arguments_of_the_function_are_the_options_of_the_command(
    given: list[str], name: str, value: float, status: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    into = tmp_path / "found.jsonl"
    monkeypatch.setattr(sys, "argv", ["some", *given, "--into", str(into)])
    with pytest.raises(SystemExit) as ended:
        command(some, {"count": 1}, 60.0)
    budget, figure = [json.loads(line) for line in into.read_text().splitlines()]
    assert budget == {"budget_s": 60.0}
    assert (ended.value.code, Figure(**figure)) == (status, Figure(name, value, "s", 10.0))


@pytest.mark.parametrize("name", NAMES)
def test_each_benchmark_yields_figures_and_says_what_is_quick_and_how_long_it_may_take(name: str) -> None:
    module = importlib.import_module(f"benchmarks.{name}")
    assert inspect.isgeneratorfunction(module.figures)
    options = inspect.signature(module.figures).parameters
    assert all(option.default is not option.empty for option in options.values())
    assert set(module.QUICK) <= set(options)
    for option, value in module.QUICK.items():
        assert value != options[option].default
        assert type(value) is type(options[option].default)
    assert 0 < module.BUDGET_S <= 3600
    assert module.__doc__


def test_there_are_benchmarks() -> None:
    assert {"api", "cost", "dry_run", "executive_speed", "web"} <= set(NAMES)


def test_a_power_law_is_found_again_and_a_point_beside_it_is_told() -> None:
    sizes = (5, 10, 20, 40)
    exact = Curve("planning", "targets", sizes, tuple(0.02 * n**1.7 for n in sizes))
    assert exact.fit() == pytest.approx((0.02, 1.7))
    *_, power, farthest = exact.figures()
    assert (power.value, farthest.value) == pytest.approx((1.7, 1.0))
    bent = replace(exact, seconds=(*exact.seconds[:-1], 3.0 * exact.seconds[-1]))
    assert list(bent.figures())[-1].value > 1.3


def test_each_curve_is_drawn_with_its_sizes_and_its_power(tmp_path: Path) -> None:
    curves = [Curve(f"work {k}", "runs", (10, 1_000), (0.1, 0.1 * 100**k)) for k in (1, 2)]
    draw(curves, tmp_path / "cost.svg")
    text = (tmp_path / "cost.svg").read_text()
    assert text.count(">1k<") == 2
    assert "n^1.00" in text
    assert "n^2.00" in text
