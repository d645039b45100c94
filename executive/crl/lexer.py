"""Characters to nested lists of atoms: the lexical structure of section 1."""

from __future__ import annotations

import re
from enum import IntEnum

from executive.crl.errors import CrlSyntaxError
from executive.crl.values import LineTable


class Kind(IntEnum):
    """What an atom is; the value is the number of its group in the token pattern."""

    NUMBER = 3
    SYMBOL = 4
    KEYWORD = 5
    STRING = 6
    OPERATOR = 7


class Atom:
    """One token that is not a parenthesis. `value` is a number, or the characters that it denotes."""

    __slots__ = ("kind", "length", "offset", "value")

    def __init__(self, kind: Kind, value: str | float, offset: int, length: int) -> None:
        self.kind = kind
        self.value = value
        self.offset = offset
        self.length = length

    def __repr__(self) -> str:
        return f"Atom({self.kind.name}, {self.value!r})"


class Form(list["Atom | Form"]):
    """A parenthesised list; `offset` is that of its opening parenthesis."""

    __slots__ = ("length", "offset")

    def __init__(self, offset: int) -> None:
        super().__init__()
        self.offset = offset
        self.length = 1


Item = Atom | Form

NUMBER = r"[+-]?[0-9]+(?:\.[0-9]+)?(?:[eE][+-]?[0-9]+)?"
NAME = r"[A-Za-z0-9_.:*?!+-]"

_TOKEN = re.compile(
    rf"""(?:[ \t\r\n\f\v]+ | ;[^\n]*)+
    | (\() | (\))
    | ({NUMBER})(?!{NAME})
    | ((?!:){NAME}+)
    | (:{NAME}+)
    | ("(?:[^"\\]|\\.)*")
    | (/=|<=|>=|[=<>])""",
    re.VERBOSE | re.DOTALL,
)
_SYMBOL = re.compile(rf"(?!:){NAME}+")
_NUMBER = re.compile(NUMBER)
_ESCAPE = re.compile(r"\\(.)", re.DOTALL)


def is_symbol(text: str) -> bool:
    """Tell whether the characters, standing alone, are one symbol."""
    return _SYMBOL.fullmatch(text) is not None and _NUMBER.fullmatch(text) is None


def is_keyword_name(text: str) -> bool:
    """Tell whether a colon and the characters are one keyword."""
    return re.fullmatch(rf"{NAME}+", text) is not None


def read_number(text: str) -> float:
    """Return the number a token denotes: an int when it is whole and exact in binary64, else a float."""
    if "." not in text and "e" not in text and "E" not in text and len(text) < 16:
        return int(text)
    value = float(text)
    if value.is_integer() and abs(value) < 2**53:
        return int(value)
    return value


def read_forms(text: str, lines: LineTable) -> list[Item]:
    """Return the top-level items of a text.

    Raises
    ------
    CrlSyntaxError
        E001, E002, E003: parentheses, an unterminated string, an illegal token.
    """
    top: list[Item] = []
    current: list[Item] = top
    stack: list[list[Item]] = []
    opened: list[Form] = []
    match = _TOKEN.match
    at = 0
    end = len(text)
    symbol, keyword, number = Kind.SYMBOL, Kind.KEYWORD, Kind.NUMBER
    while at < end:
        token = match(text, at)
        if token is None:
            raise _illegal(text, at, lines)
        group = token.lastindex
        after = token.end()
        if group == 4:
            current.append(Atom(symbol, token.group(), at, after - at))
        elif group == 5:
            current.append(Atom(keyword, text[at + 1 : after], at, after - at))
        elif group == 1:
            form = Form(at)
            current.append(form)
            stack.append(current)
            opened.append(form)
            current = form
        elif group == 2:
            if not stack:
                raise _syntax('")" without "("', "E001", at, lines)
            closed = opened.pop()
            closed.length = after - closed.offset
            current = stack.pop()
        elif group == 3:
            current.append(Atom(number, read_number(token.group()), at, after - at))
        elif group == 6:
            current.append(Atom(Kind.STRING, _unescape(text[at + 1 : after - 1]), at, after - at))
        elif group == 7:
            current.append(Atom(Kind.OPERATOR, token.group(), at, after - at))
        at = after
    if opened:
        raise _unclosed(opened, lines)
    return top


def _unescape(body: str) -> str:
    return _ESCAPE.sub(r"\1", body) if "\\" in body else body


def _unclosed(opened: list[Form], lines: LineTable) -> CrlSyntaxError:
    innermost = opened[-1]
    line = lines.position(innermost.offset)[0]
    count = f" ({len(opened)} are missing at the end of the text)" if len(opened) > 1 else ""
    return _syntax(f'missing ")" for "(" at line {line}{count}', "E001", innermost.offset, lines)


def _illegal(text: str, at: int, lines: LineTable) -> CrlSyntaxError:
    character = text[at]
    if character == '"':
        line = lines.position(at)[0]
        return _syntax(f"the string that begins at line {line} does not end", "E002", at, lines)
    hint = ""
    if character == ":":
        message = 'illegal token ":": a keyword needs a name after the colon'
    else:
        message = (
            f"illegal token {character!r}" if character.isprintable() else f"illegal character {character!a}"
        )
        hint = {
            "'": 'strings stand in double quotes: "text"',
            "[": "lists stand in round parentheses",
            "{": "lists stand in round parentheses",
            ",": "items are separated by blanks",
            "#": 'a comment begins with ";"',
            "/": '"not equal" is written /=',
            "!": '"not equal" is written /=',
        }.get(character, "")
        if not character.isascii():
            hint = "characters outside ASCII may stand in strings and comments only"
    return _syntax(message, "E003", at, lines, hint)


def _syntax(message: str, code: str, at: int, lines: LineTable, hint: str = "") -> CrlSyntaxError:
    line, column = lines.position(at)
    return CrlSyntaxError(message, code=code, line=line, column=column, hint=hint)
