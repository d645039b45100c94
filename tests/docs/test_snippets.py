"""Commands and snippets of the guides, run against the program."""

from __future__ import annotations

from pathlib import Path

import pytest

from tests.shared import script

ROOT = Path(__file__).resolve().parents[2]
SNIPPETS = vars(script("docs_snippets"))
GUIDES = SNIPPETS["guide_pages"]()


def served(guide: Path) -> bool:
    """Return whether a page needs the service, which each process of the suite makes for itself."""
    found = SNIPPETS["blocks"](guide.read_text(encoding="utf-8"))
    return any("served" in block.marks for block in found)


TO_RUN = [
    pytest.param(guide, id=guide.stem, marks=[pytest.mark.xdist_group("served pages")] * served(guide))
    for guide in GUIDES
]
"""The pages; those that need the service come to one process."""


def page(folder: Path, text: str) -> Path:
    """Return a page with this text."""
    made = folder / "page.md"
    made.write_text(text, encoding="utf-8")
    return made


@pytest.mark.parametrize("guide", GUIDES, ids=lambda p: p.stem)
def test_snippets_of_a_guide_fit_the_program(guide: Path) -> None:
    assert SNIPPETS["wrong_form"](guide) == []


@pytest.mark.parametrize("guide", TO_RUN)
def test_commands_of_a_guide_run_and_print_what_it_says(guide: Path) -> None:
    assert SNIPPETS["run_page"](guide, slow=False) == []


@pytest.mark.parametrize("guide", GUIDES, ids=lambda p: p.stem)
def test_marks_of_blocks_are_known(guide: Path) -> None:
    for block in SNIPPETS["blocks"](guide.read_text(encoding="utf-8")):
        assert block.marks <= {"slow", "ros", "served", "serves", "installs"}, f"{guide.name}:{block.line}"
        assert not block.mark or block.marks or block.mark.startswith("file: "), f"{guide.name}:{block.line}"


@pytest.mark.parametrize("guide", GUIDES, ids=lambda p: p.stem)
def test_what_runs_until_it_is_interrupted_prints_something_first(guide: Path) -> None:
    for block in SNIPPETS["blocks"](guide.read_text(encoding="utf-8")):
        if "serves" in block.marks:
            assert SNIPPETS["steps"](block)[-1][1], f"{guide.name}:{block.line}"


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
        "<!-- slow -->\n```console\n$ false\n```\n"
    )
    made = page(tmp_path, text)
    assert SNIPPETS["run_page"](made, slow=False) == []
    assert len(SNIPPETS["run_page"](made, slow=True)) == 1


def test_a_status_that_the_page_tells_is_held(tmp_path: Path) -> None:
    made = page(tmp_path, "```console\n$ (exit 3)   # exit status 3: there is none\n$ true\n```\n")
    assert SNIPPETS["run_page"](made, slow=False) == []
    made = page(tmp_path, "```console\n$ true   # exit status 3\n```\n")
    (found,) = SNIPPETS["run_page"](made, slow=False)
    assert found.startswith("page.md:1: 'true   # exit status 3' ended with 0")


SERVER = "$ python -c 'import time; print(\"at 80\", flush=True); time.sleep(600)'"


def test_what_serves_is_interrupted_when_it_has_printed_its_lines(tmp_path: Path) -> None:
    made = page(
        tmp_path,
        f"<!-- serves -->\n```console\n$ X=1\n$ trap 'echo ended' EXIT; {SERVER[2:]}\nat ...\n```\n\n"
        "```console\n$ echo $X\n1\n```\n",
    )
    assert SNIPPETS["run_page"](made, slow=False) == []


@pytest.mark.parametrize(
    ("command", "fault"), [("echo at 80; false", "ended with 1"), ("sleep 600", "(not within 1 s)")]
)
def test_what_serves_has_to_go_on_and_to_print(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, fault: str
) -> None:
    monkeypatch.setitem(SNIPPETS, "SERVES_S", 1.0)
    made = page(tmp_path, f"<!-- serves -->\n```console\n$ {command}\nat 443\n```\n")
    (found,) = SNIPPETS["run_page"](made, slow=False)
    assert found.startswith("page.md:2: ")
    assert fault in found


SERVED = "text\n\n<!-- served -->\n```console\n$ {}\n```\n"


@pytest.mark.xdist_group("served pages")
def test_a_placeholder_without_an_entry_is_named(tmp_path: Path) -> None:
    for command, name in (
        ("echo HOUSE", "HOUSE"),
        ("echo dft-...", "dft-..."),
        ("echo msn-OTHER", "msn-OTHER"),
    ):
        (found,) = SNIPPETS["run_page"](page(tmp_path, SERVED.format(command)), slow=False)
        assert found == f"page.md:4: {command!r}: nothing stands for the placeholder {name!r}"


@pytest.mark.xdist_group("served pages")
def test_a_wrong_command_beside_the_service_is_found(tmp_path: Path) -> None:
    (found,) = SNIPPETS["run_page"](
        page(tmp_path, SERVED.format("outcrop mission show msn-none")), slow=False
    )
    assert found.startswith("page.md:4: 'outcrop mission show msn-none' ended with 2:")


@pytest.mark.xdist_group("served pages")
def test_names_that_were_printed_stand_for_later_ones(tmp_path: Path) -> None:
    later = "$ echo 'GET or PLAN:' dft-...  # dft-...\nGET or PLAN: dft-1qep8e5zsqmg5"
    text = SERVED.format(f"echo 'dft-1qep8e5zsqmg5 is open'\n{later}")
    assert SNIPPETS["run_page"](page(tmp_path, text), slow=False) == []
