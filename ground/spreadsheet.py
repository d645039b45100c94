"""Text in a table that a person may open with a spreadsheet: it is shown, never carried out.

A spreadsheet takes a cell that begins with one of a few characters for a formula, and one that splits lines
at another separator than ours begins cells in the middle of a text. Such a place gets an apostrophe, the
spreadsheets' own mark for text; `shown` takes exactly those away again.
"""

from __future__ import annotations

import re

_START = r"(^|[;,\t\r\n|\"])([ ]*)('*)"
_SIGN = r"(?=[=+\-@\t\r＝＋－＠])"
_NUMBERS = re.compile(r"[-+0-9.eE;, ]*", re.ASCII)
"""Numbers and lists of them: there is nothing in them to carry out."""
_OPEN = re.compile(f"{_START}{_SIGN}")
_MARKED = re.compile(f"{_START[:-3]}'+){_SIGN}")


def inert(text: str) -> str:
    """Return a text as it can stand in a table."""
    if _NUMBERS.fullmatch(text):
        return text
    return _OPEN.sub(r"\1\2\3'", text)


def shown(cell: str) -> str:
    """Return the text that `inert` was given."""
    if _NUMBERS.fullmatch(cell):
        return cell
    return _MARKED.sub(lambda found: found[1] + found[2] + found[3][:-1], cell)
