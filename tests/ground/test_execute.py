"""An execution whose process died goes on, and comes to the end it would have had."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from ground.errors import AlreadyExecutedError, InvalidInputError, StateError
from ground.uplink.execute import Place, execute_package
from ground.uplink.flight import Sample
from ground.uplink.ledger import COPY, LEDGER, Ledger, begun
from tests.ground.signed import small_site


class Killed(BaseException):
    """The process is gone."""


@pytest.fixture
def site(tmp_path: Path) -> tuple[Path, Place]:
    """Give a signed package and the place it is for."""
    return small_site(tmp_path)


def forget(place: Place) -> None:
    """Make a rover that has begun nothing yet."""
    for name in (LEDGER, COPY):
        (place.world / name).unlink()


def die_at(number: int) -> Any:
    count = iter(range(1, 10**6))

    def die(_sample: Sample) -> None:
        if next(count) == number:
            raise Killed

    return die


def contents(folder: Path) -> dict[str, bytes]:
    """Return what a run left, but for what says that it was interrupted."""
    document = json.loads((folder / "run.json").read_text())
    document.pop("resumed_after_records", None)
    files = {
        name: (folder / name).read_bytes() for name in ("journal.jsonl", "trace.jsonl", "telemetry.jsonl")
    }
    return {**files, "run.json": json.dumps(document, sort_keys=True).encode()}


@pytest.mark.parametrize("sample", [2, 3, 4])
def test_an_interrupted_execution_goes_on_to_the_end_it_would_have_had(
    sample: int, site: tuple[Path, Place], tmp_path: Path
) -> None:
    package, place = site
    _, whole = execute_package(package, place, tmp_path / "whole")
    assert len(whole.samples) > 4
    forget(place)
    out = tmp_path / "run"
    with pytest.raises(Killed):
        execute_package(package, place, out, on_sample=die_at(sample))
    with pytest.raises(AlreadyExecutedError, match="was executed before"):
        execute_package(package, place, tmp_path / "other")
    with pytest.raises(Killed):  # and dies again
        execute_package(package, place, out, resume=True, on_sample=die_at(sample + 1))
    _, resumed = execute_package(package, place, out, resume=True)
    assert contents(out) == contents(tmp_path / "whole")
    assert resumed.document["resumed_after_records"] > 0
    assert (out / "interrupted" / "1" / "journal.jsonl").is_file()
    assert len((place.world / LEDGER).read_text().splitlines()) == 2  # the trust file, and the package
    with pytest.raises(InvalidInputError, match="nothing to resume"):
        execute_package(package, place, out, resume=True)


def dies_at(opening: int, out: Path, work: Callable[[], object]) -> bool:
    """Do `work` in a process that dies when it has opened the n-th file to write in `out`; tell if it did."""
    child = os.fork()
    if child == 0:
        count = iter(range(1, 10**6))

        def hook(event: str, given: tuple[Any, ...]) -> None:
            if event != "open" or not str(given[0]).startswith(str(out)) or not given[2] & os.O_WRONLY:
                return
            if next(count) == opening:
                if given[2] & os.O_CREAT:
                    Path(given[0]).touch()
                    os.truncate(given[0], 0)  # it is open, and holds nothing yet
                os._exit(9)

        sys.addaudithook(hook)
        try:
            work()
            os._exit(0)
        finally:
            os._exit(1)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    assert status in {0, 9}
    return status == 9


def test_a_death_at_any_file_leaves_a_run_that_goes_on_or_is_over(
    site: tuple[Path, Place], tmp_path: Path
) -> None:
    package, place = site
    execute_package(package, place, tmp_path / "whole")
    deaths = 0
    for opening in range(1, 100):
        forget(place)
        out = tmp_path / f"run{opening}"
        if not dies_at(opening, out, partial(execute_package, package, place, out)):
            break
        deaths += 1
        if not (out / "run.json").exists():
            going_on = any(begun(Ledger(place.world).entries))
            out = out if going_on else tmp_path / f"again{opening}"
            execute_package(package, place, out, resume=going_on)
        assert contents(out) == contents(tmp_path / "whole"), opening
    assert deaths >= 6


def test_a_torn_last_line_of_the_journal_is_made_good(site: tuple[Path, Place], tmp_path: Path) -> None:
    package, place = site
    out = tmp_path / "run"
    with pytest.raises(Killed):
        execute_package(package, place, out, on_sample=die_at(3))
    journal = out / "journal.jsonl"
    os.truncate(journal, journal.stat().st_size - 5)
    _, resumed = execute_package(package, place, out, resume=True)
    assert resumed.outcome.outcome is not None


def test_what_cannot_be_resumed_says_why(site: tuple[Path, Place], tmp_path: Path) -> None:
    package, place = site
    out = tmp_path / "run"
    with pytest.raises(InvalidInputError, match="was not begun here"):
        execute_package(package, place, out, resume=True)
    with pytest.raises(Killed):
        execute_package(package, place, out, on_sample=die_at(3))
    with pytest.raises(InvalidInputError, match="the seed 5; it cannot go on"):
        execute_package(package, Place("abstract", place.world, place.trust, 6), out, resume=True)
    records = out / "journal.jsonl"
    other = execute_package(package, _fresh(place, tmp_path, seed=6), tmp_path / "other")[1]
    records.write_bytes((other.folder / "journal.jsonl").read_bytes())
    with pytest.raises(StateError, match="does not repeat record"):
        execute_package(package, Place("abstract", place.world, place.trust), out, resume=True)


def _fresh(place: Place, folder: Path, *, seed: int) -> Place:
    world = folder / "fresh"
    world.mkdir()
    (world / "world.json").write_bytes((place.world / "world.json").read_bytes())
    return Place(place.rover, world, place.trust, seed)


@pytest.mark.parametrize("left", [None, b"", b'{"n":0,"k":"hea'], ids=["missing", "empty", "torn header"])
def test_a_run_whose_journal_is_gone_is_never_begun_anew(
    left: bytes | None, site: tuple[Path, Place], tmp_path: Path
) -> None:
    package, place = site
    out = tmp_path / "run"
    with pytest.raises(Killed):
        execute_package(package, place, out, on_sample=die_at(3))
    (out / "journal.jsonl").unlink()
    if left is not None:
        (out / "journal.jsonl").write_bytes(left)
    with pytest.raises(InvalidInputError, match="cannot be resumed"):
        execute_package(package, place, out, resume=True)
    assert not (out / "run.json").exists()


def test_a_run_that_died_before_its_first_command_can_be_begun_again(
    site: tuple[Path, Place], tmp_path: Path
) -> None:
    package, place = site
    with pytest.raises(Killed):
        execute_package(package, place, tmp_path / "first", on_sample=die_at(1))
    assert "send" not in (tmp_path / "first" / "journal.jsonl").read_text()
    _, flight = execute_package(package, place, tmp_path / "second")
    assert flight.outcome.outcome is not None


def test_the_command_goes_on_after_sigkill(site: tuple[Path, Place], tmp_path: Path) -> None:
    package, place = site
    out = tmp_path / "run"
    kill = (
        "import os, signal, sys; from pathlib import Path; "
        "from ground.uplink.execute import Place, execute_package; "
        "p, w, t, o = map(Path, sys.argv[1:]); n = iter(range(9)); "
        "die = lambda s: os.kill(os.getpid(), signal.SIGKILL) if next(n) == 3 else None; "
        "execute_package(p, Place('abstract', w, t, 5), o, on_sample=die)"
    )
    died = subprocess.run([sys.executable, "-c", kill, package, place.world, place.trust, out], check=False)
    assert died.returncode == -signal.SIGKILL
    command: list[str | Path] = [
        sys.executable,
        "-m",
        "ground.cli",
        "execute",
        package,
        "--world",
        place.world,
    ]
    given = [*command, "--trust", place.trust, "--out", out, "--resume"]
    done = subprocess.run(given, capture_output=True, text=True, check=False)
    assert done.returncode in {0, 1}, done.stderr
    assert "package 3 of M" in done.stdout
    assert json.loads((out / "run.json").read_text())["resumed_after_records"] > 0
