"""What a reader of the documentation may expect: answers near the index, short guides, plain words."""

from __future__ import annotations

import re
import runpy
from pathlib import Path

import pytest
import yaml

from tests.docs.texts import prose

ROOT = Path(__file__).resolve().parents[2]
DOCS = ROOT / "docs"
QUESTIONS = yaml.safe_load((Path(__file__).parent / "questions.yaml").read_text(encoding="utf-8"))
GUIDES = sorted(p for folder in ("learn", "how-to", "concepts") for p in (DOCS / folder).glob("*.md"))
LONGEST_WORDS = 1500
MOST_FIGURES = 3.0
"""Figures in a hundred words: beyond that a page reads as a table of results."""
FIGURE = re.compile(
    r"(?<![\w.,:-])\d[\d.,]*\s?(?:%|ms|s|min|h|mm|cm|px|kB|MB|J|kJ|W|Wh|degrees|times)(?![\w/-])"
)
MEASURED = re.compile(
    r"\b(median of|in the mean|mean of|on average|percentile|p95|worst of|area under"
    r"|were|ended|took|CPU|takes? (about )?\d)"
)
"""Words of what was once seen, beside a figure; what a program keeps to is said in the present."""
READ = [*GUIDES, ROOT / "README.md", ROOT / "CONTRIBUTING.md", DOCS / "index.md"]
READ += sorted((DOCS / "reference").glob("*.md"))


def links(page: Path) -> set[Path]:
    """Return the pages that a page leads to."""
    found = re.findall(r"\]\(([^)#\s]+\.md)", page.read_text(encoding="utf-8"))
    return {(page.parent / link).resolve() for link in found if "://" not in link}


def test_there_are_thirty_questions_of_a_newcomer() -> None:
    assert len({q["ask"] for q in QUESTIONS}) >= 30


@pytest.mark.parametrize("question", QUESTIONS, ids=lambda q: q["ask"])
def test_newcomer_finds_the_answer_two_pages_from_the_index(question: dict[str, str]) -> None:
    near = links(DOCS / "index.md")
    near |= {page for first in near for page in links(first)}
    answer = (DOCS / question["page"]).resolve()
    assert answer in near
    assert question["says"].lower() in answer.read_text(encoding="utf-8").lower()


def test_index_leads_to_each_page_in_at_most_two_clicks() -> None:
    near = links(DOCS / "index.md")
    near |= {page for first in near for page in links(first)}
    assert {p for p in DOCS.rglob("*.md") if p.name != "index.md"} - near == set()


@pytest.mark.parametrize("page", GUIDES, ids=lambda p: p.stem)
def test_guide_is_short_and_has_few_figures(page: Path) -> None:
    """Code is not counted: the rule is about reading, and a block of code is looked up or copied."""
    words = prose(page.read_text(encoding="utf-8")).split()
    figures = [w for w in words if re.match(r"[(\[]?\d", w) and not re.fullmatch(r"\d+\.", w)]
    assert len(words) <= LONGEST_WORDS
    assert 100 * len(figures) / max(len(words), 1) <= MOST_FIGURES, figures


@pytest.mark.parametrize("page", READ, ids=lambda p: p.stem)
def test_page_outside_the_results_states_no_measured_figures(page: Path) -> None:
    found = [
        line
        for line in prose(page.read_text(encoding="utf-8")).splitlines()
        if MEASURED.search(line) and FIGURE.search(line)
    ]
    assert found == []


def test_generated_pages_of_the_reference_are_up_to_date(tmp_path: Path) -> None:
    pages = runpy.run_path(str(ROOT / "scripts/docs_pages.py"))
    assert (DOCS / "reference/cli.md").read_text(encoding="utf-8") == pages["cli_page"]()
    assert (DOCS / "reference/formats.md").read_text(encoding="utf-8") == pages["formats_page"]()
