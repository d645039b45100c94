"""`outcrop crl check` and `outcrop crl format` as their users run them."""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from ground.cli.crl import crl_app

runner = CliRunner()

GOOD = "(block :id root :node-list ((task :id a :action image) (task :id b :action downlink)))"
BAD = """(block :id root :node-list
  ((task :id a :action image :retries two)
   (task :id b :action image :start-temporal-conditions ((aa end (0 10))))))
"""


@pytest.fixture
def write(tmp_path: Path) -> object:
    def make(content: str | bytes, name: str = "plan.crl") -> str:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return str(path)

    return make


def run(*arguments: str) -> tuple[int, str, str]:
    result = runner.invoke(crl_app, list(arguments))
    return result.exit_code, result.stdout, result.stderr


def test_check_prints_place_line_caret_and_hint(write) -> None:  # type: ignore[no-untyped-def]
    path = write(BAD)
    code, out, _ = run("check", path)
    assert code == 1
    assert out.splitlines() == [
        f'{path}:2:39: error E014: task a: ":retries" needs a non-negative integer, found "two"',
        "    2 |   ((task :id a :action image :retries two)",
        "      |                                       ^~~",
        f'{path}:3:58: error E020: task b: unknown node "aa" in :start-temporal-conditions',
        "    3 |    (task :id b :action image :start-temporal-conditions ((aa end (0 10))))))",
        "      |                                                          ^",
        '        hint: did you mean "a"?',
        f"{path}: 2 errors, 0 warnings",
    ]


def test_check_as_json_lists_findings(write) -> None:  # type: ignore[no-untyped-def]
    code, out, _ = run("check", "--json", write(BAD))
    findings = json.loads(out)
    assert code == 1
    assert [f["code"] for f in findings] == ["E014", "E020"]
    assert set(findings[0]) >= {"code", "severity", "message", "node", "line", "column"}


def test_a_good_plan_passes_and_warnings_do_not_fail_it(write) -> None:  # type: ignore[no-untyped-def]
    assert run("check", write(GOOD)) == (0, f"{write(GOOD)}: no findings\n", "")
    code, out, _ = run("check", write("(task :id a :action image :probability 0)"))
    assert code == 0
    assert "warning W081" in out
    assert run("check", "--json", write(GOOD))[:2] == (0, "[]\n")


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "the file is empty"),
        (b" \n ", "the file is empty"),
        (b"\x7fELF\x00\x00", "not a text (a zero byte at offset 4)"),
        (b'(task :name "\xff")', "not UTF-8 text (byte 0xff at offset 13)"),
    ],
)
@pytest.mark.parametrize("command", ["check", "format"])
def test_what_is_no_text_gives_one_line_and_exit_2(write, command, content, message) -> None:  # type: ignore[no-untyped-def]
    code, out, err = run(command, write(content))
    assert (code, out) == (2, "")
    assert err.endswith(f"{message}\n")
    assert err.count("\n") == 1


def test_missing_files_and_folders_give_one_line_and_exit_2(tmp_path: Path) -> None:
    assert run("check", str(tmp_path / "none"))[0::2] == (2, f"outcrop: {tmp_path / 'none'}: no such file\n")
    assert run("format", str(tmp_path))[0] == 2


def test_format_gives_four_forms_of_one_plan(write) -> None:  # type: ignore[no-untyped-def]
    path = write(GOOD)
    canonical = run("format", "--canonical", path)[1]
    assert canonical == f"(plan :node {GOOD})\n"
    assert run("format", "--digest", path)[1].strip() == hashlib.sha256(canonical[:-1].encode()).hexdigest()
    readable = run("format", path)[1]
    assert run("format", write(readable, "again.crl"))[1] == readable
    document = run("format", "--json-form", path)[1]
    as_json = write(document, "plan.json")
    assert run("format", "--canonical", as_json)[1] == canonical
    assert run("check", as_json)[0] == 0
    assert run("format", "--canonical", "--digest", path)[0] == 2


def test_format_of_a_broken_plan_shows_the_place(write) -> None:  # type: ignore[no-untyped-def]
    code, out, err = run("format", write("(task :id a"))
    assert (code, out) == (1, "")
    assert "1:1: error E001" in err


def test_dictionary_and_levels_are_options(write) -> None:  # type: ignore[no-untyped-def]
    path = write("(task :id a :action imagge)")
    assert run("check", path)[0] == 0
    code, out, _ = run("check", "--dictionary", "outcrop", path)
    assert code == 1
    assert "E050" in out
    assert run("check", "--dictionary", "other", path)[0] == 2
    day = write(
        "(plan :resources ((energy :consumable :key :soc :floor 10)) :node"
        " (task :id a :action x :expectations ((energy -5 0))))"
    )
    assert "W064" in run("check", "--level", "soc=12", day)[1]
    assert "W064" not in run("check", "--level", "soc=15", day)[1]
    assert run("check", "--level", "soc=much", day)[0] == 2


def test_a_long_line_is_shown_around_the_caret(write) -> None:  # type: ignore[no-untyped-def]
    tasks = " ".join(f"(task :id t{i} :action image)" for i in range(50))
    out = run(
        "check", write(f"(block :id root :node-list ({tasks} (task :id z :action image :retries two)))")
    )[1]
    line, caret = out.splitlines()[1:3]
    assert len(line) < 120
    assert line[caret.index("^") :].startswith("two")


def test_the_command_runs_from_any_folder(write, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    done = subprocess.run(
        [sys.executable, "-m", "ground.cli", "crl", "check", write(BAD)],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "E020" in done.stdout
    assert done.stderr == ""
