"""The words of a filter: names, texts, numbers and signs, each with its place."""

from __future__ import annotations

import re
from dataclasses import dataclass

from neighbours.geodata.cql2.errors import Cql2Error

MAX_TEXT = 20_000
"""Characters of a filter. An outline of a thousand corners fits; more is not a filter but a file."""
_WORD = re.compile(
    r"""\s*(?:
    (?P<text>'(?:''|\\'|[^'])*')
  | (?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?(?![\w.]))
  | (?P<quoted>"[^"]+")
  | (?P<name>[^\W\d][\w:.]*)
  | (?P<sign><>|<=|>=|[=<>(),])
    )""",
    re.VERBOSE,
)


@dataclass(frozen=True, slots=True)
class Word:
    """A word; `kind` is text, number, quoted, name, sign or end."""

    kind: str
    text: str
    position: int

    @property
    def key(self) -> str:
        """The word as the grammar knows it; what is quoted is not a word of the grammar."""
        return self.text.lower() if self.kind in {"name", "sign"} else ""


def words_of(text: str) -> list[Word]:
    """Return the words of a filter, with one at the end that stands for it.

    Raises
    ------
    Cql2Error
        If it is too long, or there is a character that begins no word.
    """
    if len(text) > MAX_TEXT:
        raise Cql2Error(f"the filter has {len(text)} characters; {MAX_TEXT} are allowed")
    found, at = [], 0
    end = len(text.rstrip())
    while at < end:
        match = _WORD.match(text, at)
        if match is None:
            rest = text[at:].lstrip()
            why = "a text is not closed" if rest.startswith(("'", '"')) else f"{rest[:12]!r} is not a word"
            raise Cql2Error(why, len(text) - len(rest) + 1)
        kind = match.lastgroup or ""
        found.append(Word(kind, match[kind], match.start(kind) + 1))
        at = match.end()
    return [*found, Word("end", "the end of the filter", end + 1)]
