"""Dictionaries by name or from a file: what rovers can be told, and what they tell."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from executive.crl.dictionary import Dictionary, load_dictionary
from executive.crl.errors import DictionaryError

STANDARD_DICTIONARY = "outcrop-rover"
"""Dictionary of a profile that names none: that of the simulated rovers."""

_FOLDER = Path(__file__).parents[1] / "dictionaries"


def dictionary_file(name: str) -> Dictionary:
    """Return a dictionary by name, or from a file that ends in `.toml` or `.json`.

    Raises
    ------
    DictionaryError
        If there is none of that name, or the file cannot be read as one.
    """
    if name.endswith((".toml", ".json")):
        return load_dictionary(Path(name))
    return _of_the_program(name)


@cache
def _of_the_program(name: str) -> Dictionary:
    path = _FOLDER / f"{name}.toml"
    if not path.is_file():
        known = ", ".join(sorted(p.stem for p in _FOLDER.glob("*.toml")))
        raise DictionaryError(f'unknown dictionary "{name}"; known are {known}, or a file')
    return load_dictionary(path)


def standard_dictionary() -> Dictionary:
    """Return the dictionary of the rovers that come with the program."""
    return dictionary_file(STANDARD_DICTIONARY)
