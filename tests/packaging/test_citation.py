"""CITATION.cff says what the package says, and names the project, no person."""

from __future__ import annotations

import tomllib
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
NEEDED = {"cff-version", "message", "title", "authors"}
"""What the schema of the Citation File Format 1.2.0 requires."""
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
CITATION = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))


def test_the_citation_has_what_its_format_requires() -> None:
    assert CITATION.keys() >= NEEDED
    assert CITATION["cff-version"] == "1.2.0"
    assert CITATION["type"] == "software"
    assert all(isinstance(CITATION[key], str) and CITATION[key] for key in NEEDED - {"authors"})


def test_the_citation_has_the_version_license_and_keywords_of_the_package() -> None:
    assert CITATION["title"].lower() == PROJECT["name"]
    assert CITATION["version"] == PROJECT["version"]
    assert CITATION["license"] == PROJECT["license"]
    assert CITATION["keywords"] == PROJECT["keywords"]


def test_the_author_is_the_project_as_an_entity() -> None:
    assert CITATION["authors"] == [{"name": "The Outcrop project"}]
