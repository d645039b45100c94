"""`dictionary/1`: the strict reader, its schema, and what it says of files that are wrong."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from executive.crl import CrlValidationError
from executive.crl.dictionary import (
    SCHEMA,
    Dictionary,
    dictionary_document,
    load_dictionary,
    read_dictionary,
)
from executive.crl.errors import DictionaryError
from executive.runtime.loading import load_plan

ROOT = Path(__file__).parents[2]
STANDARD = ROOT / "rover_iface" / "dictionaries" / "outcrop-rover.toml"


def document(**members: Any) -> dict[str, Any]:
    """Return a small dictionary with some members set."""
    drill = {
        "doc": "Drill.",
        "instrument": "instrument",
        "one_of": [["target"]],
        "parameters": {"target": {"type": "string"}, "instrument": {"type": "string"}},
        "results": {"depth_m": {"type": "number", "unit": "m", "minimum": 0}},
    }
    whole = {"format": "dictionary/1", "name": "small", "version": "2", "actions": {"drill": drill}}
    return {**whole, **members}


def changed(path: str, value: object) -> dict[str, Any]:
    """Return the small dictionary with one member of the action `drill` set."""
    whole = document()
    node = whole["actions"]["drill"]
    *way, last = path.split(".")
    for step in way:
        node = node.setdefault(step, {})
    node[last] = value
    return whole


def test_a_dictionary_comes_back_as_it_was_written_in_toml_and_json(tmp_path: Path) -> None:
    read = load_dictionary(STANDARD)
    assert read_dictionary(dictionary_document(read)) == read
    (tmp_path / "d.json").write_text(json.dumps(dictionary_document(read)))
    again = load_dictionary(tmp_path / "d.json")
    assert again == read
    assert again.sha256 == read.sha256


def test_comments_do_not_change_the_digest_and_content_does(tmp_path: Path) -> None:
    text = STANDARD.read_text()
    (tmp_path / "a.toml").write_text("# one more\n" + text)
    (tmp_path / "b.toml").write_text(text.replace("maximum = 100,", "maximum = 101,"))
    whole = load_dictionary(STANDARD).sha256
    assert load_dictionary(tmp_path / "a.toml").sha256 == whole
    assert load_dictionary(tmp_path / "b.toml").sha256 != whole


def test_the_published_schema_is_the_readers_own_and_takes_what_it_takes() -> None:
    published = json.loads((ROOT / "docs/formats/dictionary-1.schema.json").read_text())
    assert published == SCHEMA
    jsonschema = pytest.importorskip("jsonschema")
    jsonschema.validate(dictionary_document(load_dictionary(STANDARD)), published)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate(changed("activty", "drill"), published)


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        (document(format="dictionary/2"), '"dictionary/2", newer than this program; it reads dictionary/1'),
        (document(format="profile/1"), 'the format "profile/1"; it must be "dictionary/1"'),
        ({"format": "dictionary/1", "name": "x", "version": "1"}, "actions is missing"),
        (document(name=""), "name is empty"),
        (document(extra=1), "extra is not a known member; known are format, name"),
        (changed("activty", "drill"), "actions.drill.activty is not a known member"),
        (changed("parameters.target", {"type": "text"}), 'target.type is "text"; it must be one of number,'),
        (changed("parameters.depth", {"type": "number", "minimum": "0"}), "depth.minimum must be a number"),
        (changed("parameters.depth", {"type": "number", "minimum": True}), "must be a number, found true"),
        (
            changed("parameters.depth", {"type": "number", "minimum": 2, "maximum": 1}),
            "depth.minimum is 2; it must be at most its maximum 1",
        ),
        (changed("parameters.name", {"type": "string", "maximum": 1}), "a string has no maximum"),
        (changed("one_of", [["place"]]), 'one_of[0] names the unknown parameter "place"; it has target, ins'),
        (changed("instrument", "tool"), 'instrument names the unknown parameter "tool"'),
        (changed("duration", "target"), 'duration names "target", a string; it must be a number'),
        ([1], "it must be a table, found [1]"),
    ],
)
def test_what_is_wrong_is_said_with_member_value_and_limit(wrong: object, words: str) -> None:
    with pytest.raises(DictionaryError) as caught:
        read_dictionary(wrong, "small.toml")
    assert words in str(caught.value)
    assert "small.toml" in str(caught.value)


def test_a_file_that_is_none_is_named(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text("[actions")
    with pytest.raises(DictionaryError, match=r"a\.toml: is not TOML"):
        load_dictionary(tmp_path / "a.toml")
    (tmp_path / "a.json").write_text('{"minimum": ')
    with pytest.raises(DictionaryError, match=r"a\.json: is not JSON"):
        load_dictionary(tmp_path / "a.json")
    with pytest.raises(DictionaryError, match="No such file"):
        load_dictionary(tmp_path / "none.toml")


def test_a_plan_is_held_to_a_dictionary_before_it_runs() -> None:
    small: Dictionary = read_dictionary(document())
    text = '(task :id a :action drill :parameters (target = "T1"))'
    assert load_plan(text, dictionary=small).root.id == "a"
    with pytest.raises(CrlValidationError, match='unknown action "dig"'):
        load_plan(text.replace("drill", "dig"), dictionary=small)
