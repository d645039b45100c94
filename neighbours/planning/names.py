"""Names of targets and observations as identifiers of PDDL and ANML, and back.

PDDL does not tell capitals from small letters, and keeps words for itself. So a capital becomes `_` and the
small letter, any other character than a-z and 0-9 becomes `_0`, its code point in hexadecimal, and `z`. No
word made so holds two underscores in a row or ends in one: `__` separates a head and the words behind it.
"""

from __future__ import annotations

import re
from string import ascii_lowercase, digits

from neighbours.planning.errors import PlanningFormatError

SEPARATOR = "__"
_PLAIN = frozenset(ascii_lowercase + digits)
_ESCAPE = re.compile("_0([0-9a-f]+)z|_([a-z])")
_WORD = re.compile("(?:[a-z0-9]|_[a-z]|_0[0-9a-f]+z)+")


def word(name: str) -> str:
    """Return a name as a word; two names never share one."""
    return "".join(map(_letter, name))


def name_of(text: str) -> str:
    """Return the name that `word` made into this.

    Raises
    ------
    PlanningFormatError
        If it is no such word.
    """
    if _WORD.fullmatch(text) is None:
        raise PlanningFormatError(f'"{text}" is not a word of an exported name')
    return _ESCAPE.sub(lambda m: chr(int(m[1], 16)) if m[1] else m[2].upper(), text)


def identifier(head: str, *names: str) -> str:
    """Return an identifier: what it stands for, and the names it is about."""
    return SEPARATOR.join((head, *map(word, names)))


def _letter(letter: str) -> str:
    if letter in _PLAIN:
        return letter
    return f"_{letter.lower()}" if "A" <= letter <= "Z" else f"_0{ord(letter):x}z"
