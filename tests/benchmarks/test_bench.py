"""`scripts/bench` runs benchmarks one after the other; whatever becomes of one, what was measured stays."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from benchmarks import __main__ as bench
from benchmarks.common.figure import Figure

HEAD = """
import threading
from benchmarks.common.figure import Figure, command
QUICK = {{"size": 1}}
BUDGET_S = {budget}
def figures(size=5):
    yield Figure("first", size, "s", 5.0)
{then}
if __name__ == "__main__":
    command(figures, QUICK, BUDGET_S)
"""
BODIES = {
    "good": "    yield Figure('second', 2.5, 's', ratio=1.5, to='a peer')",
    "slow_one": "    yield Figure('late', 7.0, 's', 6.0)",
    "broken": "    raise RuntimeError('no such rover')",
    "endless": "    threading.Event().wait()",
}
BUDGETS = {"endless": 0.5}
read = bench.read


@pytest.fixture
def page(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Give a page of results; `fakes` is a package with a benchmark for each thing that may happen."""
    folder = tmp_path / "fakes"
    (folder / "common").mkdir(parents=True)
    for name in ("__init__", "__main__", "common/__init__"):
        (folder / f"{name}.py").touch()
    for name, then in BODIES.items():
        (folder / f"{name}.py").write_text(HEAD.format(budget=BUDGETS.get(name, 60.0), then=then))
    root = Path(bench.__file__).parents[1]
    monkeypatch.setenv("PYTHONPATH", f"{tmp_path}:{root}")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.delitem(sys.modules, "fakes", raising=False)
    monkeypatch.setattr(bench, "LOOK_S", 0.02)
    path = tmp_path / "benchmarks.md"
    path.write_text("# Results\n\nA head.\n\n<!-- begin:older -->\n## older\n\nkept\n<!-- end:older -->\n")
    return path


def test_an_unknown_name_is_told_with_those_that_exist(
    page: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    before = page.read_text()
    assert bench.main(["good", "nosuch"], "fakes", page) == 2
    said = capsys.readouterr()
    assert said.err == "no benchmark nosuch; there are: broken, endless, good, slow_one\n"
    assert (said.out, page.read_text()) == ("", before)


def test_all_limits_held_is_status_0_and_each_figure_stands_in_the_table(
    page: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench.main(["good"], "fakes", page) == 0
    text = page.read_text()
    assert text.startswith("# Results\n\nA head.\n\n<!-- begin:good -->\n## good\n\n`scripts/bench good`, ")
    assert "| first | 5 s | at most 5 s | ok |" in text
    assert "| second | 2.5 s, 1.5 times a peer |  |  |" in text
    assert "<!-- begin:older -->\n## older\n\nkept\n<!-- end:older -->" in text
    assert "1 limits held, 0 exceeded" in capsys.readouterr().out


def test_a_section_takes_the_place_of_the_one_before(page: Path) -> None:
    bench.main(["good"], "fakes", page)
    first = page.read_text()
    bench.main(["good", "--quick"], "fakes", page)
    second = page.read_text()
    assert "| first | 1 s | at most 5 s | ok |" in second
    assert second.count("<!-- begin:good -->") == 1
    assert "`scripts/bench good --quick`" in second
    assert len(second.splitlines()) == len(first.splitlines())


def test_one_that_fails_and_one_over_its_limit_and_one_without_end_are_told_and_the_others_go_on(
    page: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert bench.main([], "fakes", page) == 1
    text, said = page.read_text(), capsys.readouterr().out
    parts = dict(bench.SECTION.findall(text))
    assert set(parts) == {*BODIES, "older"}
    assert all("| first | 5 s | at most 5 s | ok |" in parts[name] for name in BODIES)
    assert "It failed: `RuntimeError: no such rover`" in parts["broken"]
    assert "It failed: `not done within 0.5 s`" in parts["endless"]
    assert "| late | 7 s | at most 6 s | over |" in parts["slow_one"]
    assert "It failed" not in parts["slow_one"] + parts["good"]
    assert "broken failed: RuntimeError: no such rover" in said
    assert "4 limits held, 1 exceeded" in said


@pytest.mark.parametrize("name", ["broken", "slow_one", "endless"])
def test_each_of_these_by_itself_is_status_1(page: Path, name: str) -> None:
    assert bench.main([name], "fakes", page) == 1


@pytest.mark.parametrize("measured", [True, False])
def test_stopped_by_hand_what_was_measured_stays_and_the_rest_is_not_begun(
    page: Path, monkeypatch: pytest.MonkeyPatch, measured: bool
) -> None:
    def stop(_self: bench.Line, _name: str, figures: tuple[Figure, ...], _shown: int) -> int:
        if not stopped and bool(figures) is measured:
            stopped.append(figures)
            raise KeyboardInterrupt
        return 0

    stopped: list[tuple[Figure, ...]] = []
    monkeypatch.setattr(bench.Line, "news", stop)
    monkeypatch.setattr(bench, "read", lambda into: read(into) if measured else (60.0, ()))
    before = page.read_text()
    assert bench.main(["endless", "good"], "fakes", page) == 130
    text = page.read_text()
    if measured:
        assert "| first | 5 s | at most 5 s | ok |" in text
        assert "It was stopped before its end." in text
    else:
        assert text == before
    assert "begin:good" not in text
