"""Commands and snippets of the guides, run against the program."""

from __future__ import annotations

import runpy
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SNIPPETS = runpy.run_path(str(ROOT / "scripts/docs_snippets.py"))
GUIDES = SNIPPETS["guide_pages"]()


def page(folder: Path, text: str) -> Path:
    """Return a page with this text."""
    made = folder / "page.md"
    made.write_text(text, encoding="utf-8")
    return made


@pytest.mark.parametrize("guide", GUIDES, ids=lambda p: p.stem)
def test_snippets_of_a_guide_fit_the_program(guide: Path) -> None:
    assert SNIPPETS["wrong_form"](guide) == []


@pytest.mark.parametrize("guide", GUIDES, ids=lambda p: p.stem)
def test_commands_of_a_guide_run_and_print_what_it_says(guide: Path) -> None:
    assert SNIPPETS["run_page"](guide, slow=False) == []


@pytest.mark.parametrize("guide", GUIDES, ids=lambda p: p.stem)
def test_what_is_not_run_has_a_reason(guide: Path) -> None:
    for block in SNIPPETS["blocks"](guide.read_text(encoding="utf-8")):
        if block.mark.startswith("form:"):
            assert len(block.mark.split()) >= 4, f"{guide.name}:{block.line}"
        else:
            assert not block.mark or block.mark in {"slow", "ros"} or block.mark.startswith("file: ")


def test_tutorials_run_almost_whole() -> None:
    for tutorial in sorted((ROOT / "docs/learn").glob("*.md")):
        marks = [b.mark for b in SNIPPETS["blocks"](tutorial.read_text(encoding="utf-8"))]
        assert not [m for m in marks if m.startswith("form:")], tutorial.name


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("```console\n$ outcrop plann problem.json\n```\n", "no such command or option: outcrop plann"),
        ("```console\n$ outcrop plan p.json --brunches 3\n```\n", "outcrop plan p.json --brunches"),
        ("```console\n$ true && outcrop terrain inform x | cat\n```\n", "outcrop terrain inform"),
        ("```python\nfrom planner.solve import salve\n```\n", "planner.solve.salve does not exist"),
        ("```python\nx = = 1\n```\n", "line 1"),
        ("```json\n{,}\n```\n", "Expecting"),
        ("```toml\na = = 1\n```\n", "page.md:1"),
    ],
)
def test_wrong_snippet_is_found(tmp_path: Path, text: str, fault: str) -> None:
    (found,) = SNIPPETS["wrong_form"](page(tmp_path, text))
    assert fault in found


@pytest.mark.parametrize(
    "line",
    [
        'outcrop feature list m targets --filter "S_INTERSECTS(geometry, BBOX(1, 2, 3, 4)) AND id > 3"',
        "outcrop target add m --lonlat -- -110.79 38.41",
        'X="$(outcrop mission list)"',
    ],
)
def test_quotes_and_the_end_of_options_are_read_as_a_shell_does(tmp_path: Path, line: str) -> None:
    assert SNIPPETS["wrong_form"](page(tmp_path, f"```console\n$ {line}\n```\n")) == []
    wrong = line.replace("outcrop ", "outcrop x", 1)
    assert len(SNIPPETS["wrong_form"](page(tmp_path, f"```console\n$ {wrong}\n```\n"))) == 1


@pytest.mark.parametrize(
    ("text", "fault"),
    [
        ("```console\n$ echo one\ntwo\n```\n", "did not print 'two'"),
        ("```console\n$ printf 'b\\na\\n'\na\nb\n```\n", "did not print 'b'"),
        ("```console\n$ true\n```\n\n```console\n$ false\n$ true\n```\n", "'false' ended with 1"),
    ],
)
def test_wrong_command_is_found(tmp_path: Path, text: str, fault: str) -> None:
    (found,) = SNIPPETS["run_page"](page(tmp_path, text), slow=False)
    assert fault in found


def test_files_marks_and_wildcards(tmp_path: Path) -> None:
    text = (
        "<!-- file: a/b.txt -->\n```toml\nx = 1\n```\n\n"
        "```console\n$ cat \\\n    a/b.txt\nx = ...\n$ echo 1 2 3\n1 ... 3\n```\n\n"
        "<!-- slow -->\n```console\n$ false\n```\n\n"
        "<!-- form: it would end the machine -->\n```console\n$ exit 3\n```\n"
    )
    made = page(tmp_path, text)
    assert SNIPPETS["run_page"](made, slow=False) == []
    assert len(SNIPPETS["run_page"](made, slow=True)) == 1
