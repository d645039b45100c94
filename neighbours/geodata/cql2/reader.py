"""CQL2 text to a tree: OGC 21-065r2, annex B, by recursive descent."""

from __future__ import annotations

from collections.abc import Callable

from neighbours.geodata.cql2.errors import Cql2Error
from neighbours.geodata.cql2.expression import Call, Constant, Expression, Instant, Interval, Name, Shape
from neighbours.geodata.cql2.geometries import SHAPES, read_shape
from neighbours.geodata.cql2.times import instant
from neighbours.geodata.cql2.words import Word, words_of

SPATIAL = frozenset(
    f"s_{word}"
    for word in ("intersects", "contains", "crosses", "disjoint", "equals", "overlaps", "touches", "within")
)
TEMPORAL = frozenset(
    f"t_{word}"
    for word in (
        *("after", "before", "contains", "disjoint", "during", "equals", "finishedby", "finishes"),
        *("intersects", "meets", "metby", "overlappedby", "overlaps", "startedby", "starts"),
    )
)
COMPARISONS = frozenset({"=", "<>", "<", ">", "<=", ">="})
FOLDS = frozenset({"casei", "accenti"})
WORDS = frozenset({"and", "or", "not", "like", "between", "in", "is", "null", "true", "false", "div"})
DEEPEST = 50
"""Brackets and `not` within each other."""


def read_cql2(text: str) -> Expression:
    """Return the tree of a filter in CQL2 text.

    Raises
    ------
    Cql2Error
        If it is none; the message says what was expected, and where.
    """
    reader = _Reader(words_of(text))
    found = reader.either()
    reader.expect_end()
    return found


class _Reader:
    def __init__(self, words: list[Word]) -> None:
        self._words = words
        self._at = 0
        self._depth = 0

    # ---- words

    @property
    def word(self) -> Word:
        """The next word."""
        return self._words[self._at]

    def next(self) -> Word:
        """Return the next word and go on."""
        word = self.word
        self._at += word.kind != "end"
        return word

    def take(self, *keys: str) -> str | None:
        """Return the next word of the grammar and go on, if it is one of these."""
        if self.word.key in keys:
            return self.next().key
        return None

    def expect(self, key: str, where: str) -> None:
        """Go on over a word that has to be there."""
        if self.take(key) is None:
            raise self.wrong(f"{key!r} expected {where}")

    def expect_end(self) -> None:
        """Raise unless all is read."""
        if self.word.kind != "end":
            raise self.wrong("'and', 'or' or the end of the filter expected")

    def wrong(self, expected: str) -> Cql2Error:
        """Return the error that something else was expected."""
        return Cql2Error(f"{expected}, not {self.word.text[:40]!r}", self.word.position)

    # ---- conditions

    def either(self) -> Expression:
        """Read conditions joined by `or`."""
        return self._joined("or", self._both)

    def _both(self) -> Expression:
        return self._joined("and", self._factor)

    def _joined(self, word: str, part: Callable[[], Expression]) -> Expression:
        found = [part()]
        while self.take(word):
            found.append(part())
        return found[0] if len(found) == 1 else Call(word, tuple(found))

    def _factor(self) -> Expression:
        if self._depth >= DEEPEST:
            raise Cql2Error(f"more than {DEEPEST} brackets within each other", self.word.position)
        self._depth += 1
        try:
            if self.take("not"):
                return Call("not", (self._factor(),))
            if self.take("("):
                inner = self.either()
                self.expect(")", "behind the condition in brackets")
                return inner
            return self._condition()
        finally:
            self._depth -= 1

    def _condition(self) -> Expression:
        word = self.word
        if word.key in SPATIAL | TEMPORAL:
            return self._function(self.next().key)
        left = self._operand()
        sign = self.take(*COMPARISONS)
        if sign is not None:
            return Call(sign, (left, self._operand()))
        if self.take("is"):
            inverse = self.take("not")
            self.expect("null", "behind 'is'")
            return _inverse(inverse, Call("isnull", (left,)))
        inverse = self.take("not")
        match self.take("like", "between", "in"):
            case "like":
                return _inverse(inverse, Call("like", (left, self._pattern())))
            case "between":
                low = self._operand()
                self.expect("and", "between the two bounds")
                return _inverse(inverse, Call("between", (left, low, self._operand())))
            case "in":
                return _inverse(inverse, Call("in", (left, *self._listed())))
        if isinstance(left, Constant) and isinstance(left.value, bool) and not inverse:
            return left
        raise self.wrong("a comparison, 'like', 'between', 'in' or 'is null' expected")

    def _pattern(self) -> Expression:
        found = self._operand()
        inner = found
        while isinstance(inner, Call):
            (inner,) = inner.arguments
        if not (isinstance(inner, Constant) and isinstance(inner.value, str)):
            raise self.wrong("a text expected behind 'like'")
        return found

    def _listed(self) -> list[Expression]:
        self.expect("(", "behind 'in'")
        found = [self._operand()]
        while self.take(","):
            found.append(self._operand())
        self.expect(")", "behind the list")
        return found

    def _function(self, name: str) -> Expression:
        argument = self._shape if name in SPATIAL else self._time
        self.expect("(", f"behind {name}")
        one = argument(name)
        self.expect(",", f"between the two arguments of {name}")
        other = argument(name)
        self.expect(")", f"behind the two arguments of {name}")
        return Call(name, (one, other))

    # ---- operands

    def _operand(self) -> Expression:
        word = self.word
        if word.kind == "text":
            self.next()
            return Constant(_unquoted(word.text))
        if word.kind == "number":
            self.next()
            return Constant(float(word.text))
        if word.key in {"true", "false"}:
            return Constant(self.next().key == "true")
        if word.key in FOLDS:
            self.next()
            self.expect("(", f"behind {word.key}")
            inner = self._operand()
            self.expect(")", f"behind the text of {word.key}")
            return Call(word.key, (inner,))
        if word.key in {"date", "timestamp"} and self._called():
            return self._instant()
        return self._name("a property, text, number, date or timestamp expected")

    def _name(self, expected: str) -> Name:
        word = self.word
        if word.kind not in {"name", "quoted"} or word.key in WORDS:
            raise self.wrong(expected)
        if word.kind == "name" and self._called():
            raise Cql2Error(f"there is no function {word.text[:40]!r} here", word.position)
        self.next()
        return Name(word.text.strip('"'))

    def _called(self) -> bool:
        """Return whether a bracket opens behind the next word."""
        return self._words[min(self._at + 1, len(self._words) - 1)].key == "("

    def _shape(self, function: str) -> Expression:
        if self.word.key in SHAPES and self.word.kind == "name":
            return Shape(read_shape(self))
        return self._name(f"a geometry or the property that holds it expected in {function}")

    def _time(self, function: str) -> Expression:
        if self.word.key in {"date", "timestamp"} and self._called():
            return self._instant()
        if self.word.key == "interval" and self._called():
            self.next()
            self.expect("(", "behind interval")
            start = self._bound()
            self.expect(",", "between the ends of the interval")
            end = self._bound()
            self.expect(")", "behind the ends of the interval")
            if isinstance(start, Instant) and isinstance(end, Instant) and end.at < start.at:
                raise Cql2Error("the interval ends before it begins", self.word.position)
            return Interval(start, end)
        return self._name(f"a date, timestamp, interval or property expected in {function}")

    def _bound(self) -> Instant | Name | None:
        word = self.word
        if word.kind == "text":
            self.next()
            said = _unquoted(word.text)
            return None if said == ".." else instant(said, word.position, day="T" not in said.upper())
        if word.key in {"date", "timestamp"} and self._called():
            return self._instant()
        return self._name("an end of an interval expected: a text, '..' or a property")

    def _instant(self) -> Instant:
        kind = self.next().key
        self.expect("(", f"behind {kind}")
        word = self.next()
        if word.kind != "text":
            raise Cql2Error(f"{kind} takes a text, not {word.text[:40]!r}", word.position)
        self.expect(")", f"behind the text of {kind}")
        return instant(_unquoted(word.text), word.position, day=kind == "date")


def _inverse(inverse: str | None, condition: Expression) -> Expression:
    return Call("not", (condition,)) if inverse else condition


def _unquoted(text: str) -> str:
    return text[1:-1].replace("''", "'").replace("\\'", "'")
