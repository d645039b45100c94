"""A package is begun once on a rover, whatever happens to the ledger and however many start it."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest

from ground.errors import AlreadyExecutedError, InvalidInputError
from ground.uplink.execute import execute_package
from ground.uplink.ledger import COPY, LEDGER, Ledger, locked_ledger
from tests.ground.signed import small_site

OLD = '{"mission": "M", "sequence": 2, "sha256": "aa", "rover": "abstract", "seed": 5}\n'


def entry(number: int) -> dict[str, object]:
    return {"mission": "M", "sequence": number, "sha256": f"{number:x}"}


def filled(folder: Path, count: int = 3) -> bytes:
    ledger = Ledger(folder)
    for number in range(1, count + 1):
        ledger.append(entry(number))
    return (folder / LEDGER).read_bytes()


def test_one_of_many_starts_of_a_package_runs_and_the_others_are_refused_by_name(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)

    def start(number: int) -> subprocess.Popen[str]:
        words = ["execute", package, "--world", place.world, "--trust", place.trust]
        out = ["--out", tmp_path / f"run{number}", "--seed", "5"]
        command = [sys.executable, "-m", "ground.cli", *words, *out]
        return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)

    started = [start(number) for number in range(4)]
    told = [process.communicate() for process in started]
    codes = sorted(process.returncode for process in started)
    assert codes[1:] == [2, 2, 2], told
    assert codes[0] in {0, 1}
    refused = [err for (_, err), process in zip(told, started, strict=True) if process.returncode == 2]
    for err in refused:
        assert err.count("\n") == 1
        assert "package 3 of M" in err
    assert len(list(tmp_path.glob("run*/run.json"))) == 1


def test_a_run_that_goes_on_is_neither_begun_again_nor_resumed(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    refused: list[str] = []

    def once_more(_sample: object) -> None:
        for resume in (False, True):
            with pytest.raises(AlreadyExecutedError, match=r"is busy: process \d+ does package 3 of M"):
                execute_package(package, place, tmp_path / "other", resume=resume)
            refused.append("busy")

    execute_package(package, place, tmp_path / "run", on_sample=once_more)
    assert refused


@pytest.mark.parametrize("cut", [1, 20, len(OLD) - 1])
def test_a_torn_last_line_of_an_old_ledger_is_cut_off_and_told(tmp_path: Path, cut: int) -> None:
    package, place = small_site(tmp_path)
    whole = OLD + OLD.replace('"sequence": 2', '"sequence": 9')
    (place.world / LEDGER).write_text(whole[: len(OLD) + cut])
    told: list[str] = []
    assert len(Ledger(place.world).entries) == len(Ledger(place.world).entries)  # looking changes nothing
    if cut == len(OLD) - 1:  # all of it but the line break: it may have been begun
        with pytest.raises(AlreadyExecutedError, match="older than package 9"):
            execute_package(package, place, tmp_path / "run", on_repair=told.append)
        return
    execute_package(package, place, tmp_path / "run", on_repair=told.append)
    assert [line.count("torn last line") for line in told] == [1]
    again = Ledger(place.world)
    assert [e.get("sequence") for e in again.entries] == [2, None, 3]
    assert not again.repaired


def test_an_old_ledger_that_is_damaged_in_the_middle_lets_nothing_run(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    (place.world / LEDGER).write_text(OLD + '{"mission": "M", "seq\n' + OLD)
    with pytest.raises(InvalidInputError, match="damaged at line 2; nothing may be executed"):
        execute_package(package, place, tmp_path / "run")


@pytest.mark.parametrize("name", [LEDGER, COPY])
def test_whatever_happens_to_one_file_is_mended_from_the_other(tmp_path: Path, name: str) -> None:
    whole = filled(tmp_path)
    harmed: list[bytes | None] = [None, whole + b"junk", whole + whole, b"\0" * len(whole), whole[::-1]]
    harmed += [whole[:cut] for cut in range(0, len(whole), 7)]
    harmed += [whole[:k] + bytes([whole[k] ^ 1]) + whole[k + 1 :] for k in range(0, len(whole), 3)]
    for content in harmed:
        (tmp_path / name).unlink()
        if content is not None:
            (tmp_path / name).write_bytes(content)
        mended = Ledger(tmp_path)
        assert [e["sequence"] for e in mended.entries] == [1, 2, 3], content
        assert (tmp_path / LEDGER).read_bytes() == (tmp_path / COPY).read_bytes() == whole


def test_damage_to_both_files_lets_nothing_run(tmp_path: Path) -> None:
    whole = filled(tmp_path)
    for name, place in ((LEDGER, 5), (COPY, 9)):
        (tmp_path / name).write_bytes(whole[:place] + b"?" + whole[place + 1 :])
    with pytest.raises(InvalidInputError, match="nothing may be executed"):
        Ledger(tmp_path)


def test_two_histories_let_nothing_run(tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    filled(tmp_path)
    ledger = Ledger(tmp_path / "other")
    ledger.append(entry(7))
    (tmp_path / COPY).write_bytes((tmp_path / "other" / LEDGER).read_bytes())
    with pytest.raises(InvalidInputError, match="tell different things"):
        Ledger(tmp_path)


def test_a_line_that_is_no_entry_is_damage(tmp_path: Path) -> None:
    for line in ("[]", "7", '{"mission": 1, "sequence": 2, "sha256": "x"}', '{"a": ' * 5000, "\ud800"):
        (tmp_path / LEDGER).write_bytes(line.encode("utf-8", "surrogatepass") + b"\n" + OLD.encode())
        with pytest.raises(InvalidInputError, match="damaged at line 1"):
            Ledger(tmp_path)


def test_a_place_that_cannot_hold_a_ledger_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="cannot be locked"), locked_ledger(tmp_path / "no", "it"):
        pass


# ---- the command


def execute(*words: object) -> subprocess.CompletedProcess[str]:
    command = [sys.executable, "-m", "ground.cli", "execute", *map(str, words)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_every_refusal_of_the_command_is_one_line_and_status_two(tmp_path: Path) -> None:
    package, place = small_site(tmp_path)
    given = {"--world": place.world, "--trust": place.trust, "--out": tmp_path / "run"}
    empty = tmp_path / "empty"
    empty.mkdir()
    (tmp_path / "file").write_text("x")
    broken = tmp_path / "broken"
    broken.mkdir()
    (broken / "world.json").write_text(json.dumps({"format": "world/1", "problem": {"targets": 7}}))
    wrong: list[tuple[object, dict[str, object]]] = [
        (tmp_path / "none.zip", {}),
        (tmp_path, {}),
        (package, {"--world": tmp_path / "none"}),
        (package, {"--world": empty}),
        (package, {"--world": broken}),
        (package, {"--trust": tmp_path / "none"}),
        (package, {"--trust": tmp_path / "keys" / "author.key"}),
        (package, {"--out": tmp_path / "file"}),
        (package, {"--out": tmp_path / "file" / "below"}),
        (package, {"--rover": "nobody"}),
    ]
    for source, other in wrong:
        words = [word for pair in {**given, **other}.items() for word in pair]
        done = execute(source, *words)
        assert done.returncode == 2, (other, done.stderr)
        assert done.stderr.startswith("outcrop: ")
        assert done.stderr.count("\n") == 1, done.stderr
    assert not (place.world / "run").exists()


def test_no_crash_point_loses_or_doubles_an_entry() -> None:
    from studies.crash_points import study

    found = study(2000, seed=20261122)
    assert found["points"] >= 2000
    assert {name: n for name, n in found.items() if name != "points"} == {}


def test_the_simulated_disk_tells_a_ledger_that_does_not_synchronise(monkeypatch: pytest.MonkeyPatch) -> None:
    """The check of crash points notices what it is for."""
    from studies.crash_points import study
    from tests.ground.crashing_disk import CrashingDisk

    monkeypatch.setattr(CrashingDisk, "sync", lambda _self, _path: None)
    found = study(300, seed=1)
    assert found["lost"] + found["does not open"] > 0
