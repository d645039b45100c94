"""No word of the list stands in what people read: pages, browser, help, messages and docstrings."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

import pytest
import yaml

from tests.docs import texts

WORDS = yaml.safe_load((Path(__file__).parent / "words.yaml").read_text(encoding="utf-8"))


@cache
def read(surface: str) -> tuple[tuple[str, str], ...]:
    return tuple(texts.SURFACES[surface]())


@pytest.mark.parametrize("surface", texts.SURFACES)
@pytest.mark.parametrize("entry", WORDS, ids=lambda e: e["wrong"])
def test_words_of_the_list_stand_nowhere(entry: dict[str, str], surface: str) -> None:
    avoid = re.compile(entry["avoid"], re.I)
    found = [
        f"{where}: {text[max(0, hit.start() - 40) : hit.end() + 40]}"
        for where, text in read(surface)
        for hit in [avoid.search(text)]
        if hit
    ]
    assert found == [], f"say {entry['say']}"


@pytest.mark.parametrize("entry", WORDS, ids=lambda e: e["wrong"])
def test_each_entry_of_the_list_finds_what_it_is_for_and_passes_what_is_right(entry: dict[str, str]) -> None:
    avoid = re.compile(entry["avoid"], re.I)
    assert avoid.search(entry["wrong"])
    assert not avoid.search(entry["right"])


def test_every_surface_is_read() -> None:
    assert {where for where, _ in read("pages")} >= {"README.md", "CHANGELOG.md", "docs/learn/first-plan.md"}
    assert any("Change to 2D (2) and press O." in text for _, text in read("page of the browser"))
    assert "Estimate the probability of a rare failure" in dict(read("help"))["outcrop campaign rare"]
    assert any("obstacles close every path between them" in text for _, text in read("program"))


def test_messages_are_read_across_lines_and_pieces() -> None:
    said = '"""Say.\n\n    price\n        Of one.\n    """\n'
    source = f'def f(x):\n    {said}    raise E(f"{{x!r}} is "\n f"no {{x}} of ours")\n'
    assert list(texts.spoken(source)) == [(2, "Say."), (2, "Of one."), (7, "X is no X of ours")]
