"""Macros, bounded repetition and arithmetic over constants: a front end that leaves plain CRL behind.

Expansion works on the nested lists of the lexer and keeps the offset of each atom, so that whatever is found
wrong with the expanded plan points to the line of the macro it came from. Nothing of it is left in the plan:
canonical text, digest, approval, journal and executive know the expanded plan alone. The syntax stands in
`docs/reference/crl.md`. Every form of the front end begins with `!`, every reference with `?`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import NoReturn

from executive.crl.errors import CrlSyntaxError
from executive.crl.lexer import Atom, Form, Item, Kind, is_symbol
from executive.crl.nodes import NODE_KINDS
from executive.crl.reader import nearest
from executive.crl.values import LineTable

EXPANSION_LIMIT = 1_000_000
"""Items (atoms, lists, rounds of a repetition) of an expansion: ten for each of the 100,000 nodes of E090."""

NESTING_LIMIT = 300
"""Lists within lists in a source: three levels to a node, and half the depth of Python's stack."""

LETTERS = 16
"""Letters of a name that count as one item: no plan's memory may grow by names alone."""

TRUTHS = ("t", "true", "nil")


def _is(*kinds: Kind) -> Callable[[Item], bool]:
    return lambda item: isinstance(item, Atom) and item.kind in kinds


def _is_integer(item: Item) -> bool:
    return isinstance(item, Atom) and item.kind is Kind.NUMBER and float(item.value).is_integer()


def _is_truth(item: Item) -> bool:
    return isinstance(item, Atom) and item.kind is Kind.SYMBOL and item.value in TRUTHS


def _is_list(item: Item) -> bool:
    return isinstance(item, Form) and all(isinstance(entry, Form) for entry in item)


def _is_node(item: Item) -> bool:
    return isinstance(item, Form) and bool(item) and head_of(item) in NODE_KINDS


def _are_nodes(item: Item) -> bool:
    return isinstance(item, Form) and all(_is_node(entry) for entry in item)


TYPES: Mapping[str, Callable[[Item], bool]] = {
    "number": _is(Kind.NUMBER),
    "integer": _is_integer,
    "symbol": _is(Kind.SYMBOL),
    "string": _is(Kind.STRING),
    "keyword": _is(Kind.KEYWORD),
    "value": _is(Kind.NUMBER, Kind.SYMBOL, Kind.STRING, Kind.KEYWORD),
    "truth": _is_truth,
    "conditions": _is_list,
    "temporals": _is_list,
    "node": _is_node,
    "nodes": _are_nodes,
}
"""Types of parameters, each with the test of an argument."""

LISTS = ("conditions", "temporals", "nodes")
"""Types whose entries are put into the list in which the parameter stands."""


@dataclass(frozen=True, slots=True)
class Bound:
    """What a name stands for; `spliced` says that inside a list its entries stand for it."""

    item: Item
    spliced: bool = False


@dataclass(frozen=True, slots=True)
class Parameter:
    name: str
    type: str
    default: Item | None


@dataclass(frozen=True, slots=True)
class Macro:
    """A named body with typed parameters."""

    name: str
    parameters: Mapping[str, Parameter]
    body: list[Item]
    offset: int


Names = Mapping[str, Bound]


def head_of(form: Form) -> str:
    """Return the symbol with which a list begins, or nothing."""
    first = form[0] if form else None
    return str(first.value) if isinstance(first, Atom) and first.kind is Kind.SYMBOL else ""


def expand_items(items: list[Item], lines: LineTable, *, limit: int = EXPANSION_LIMIT) -> list[Item]:
    """Return what is left of the top-level items of a source: plain CRL, each atom with its old place.

    Raises
    ------
    CrlSyntaxError
        E200 to E207, at the place in the source.
    """
    expander = _Expander(lines, limit)
    try:
        rest = [item for item in items if not expander.define(item)]
        return expander.items(rest, expander.constants)
    except RecursionError:  # how deep the stack is depends on the caller
        place = expander.last if expander.last is not None else items[0]
        expander.fail("E206", "lists are nested too deep to be expanded", place)


@dataclass(slots=True)
class _Expander:
    lines: LineTable
    limit: int
    constants: dict[str, Bound] = field(default_factory=dict)
    macros: dict[str, Macro] = field(default_factory=dict)
    using: list[str] = field(default_factory=list)
    """Macros that are being expanded, the outermost first."""
    count: int = 0
    depth: int = 0
    """Lists around the item that is being expanded, in what is made of it."""
    last: Item | None = None
    """The item that was looked at last."""

    # --- definitions ----------------------------------------------------------------

    def define(self, item: Item) -> bool:
        """Take a definition; tell whether the item is one."""
        head = head_of(item) if isinstance(item, Form) else ""
        if not isinstance(item, Form) or head not in ("!constant", "!macro"):
            return False
        if len(item) < 3:
            self.fail("E200", f'"{head}" needs a name and what it stands for', item)
        name = self.name(item[1], f"the name after {head}")
        if name in self.constants or name in self.macros:
            self.fail("E200", f'"{name}" is defined twice', item[1])
        if head == "!constant":
            if len(item) != 3:
                self.fail("E200", f'constant "{name}" needs one value', item)
            self.constants[name] = Bound(self.one(item[2], self.constants, f'constant "{name}"'))
            return True
        if not isinstance(item[2], Form) or len(item) < 4:
            self.fail("E200", f'macro "{name}" needs a list of parameters and a body', item)
        parameters = [self.parameter(name, entry) for entry in item[2]]
        if len({p.name for p in parameters}) < len(parameters):
            self.fail("E200", f'macro "{name}" has two parameters of one name', item[2])
        self.macros[name] = Macro(name, {p.name: p for p in parameters}, item[3:], item.offset)
        return True

    def parameter(self, macro: str, item: Item) -> Parameter:
        if not isinstance(item, Form) or not 2 <= len(item) <= 3:
            self.fail("E200", f'macro "{macro}": a parameter is (name type) or (name type default)', item)
        name = self.name(item[0], f'macro "{macro}": the name of a parameter')
        kind = self.name(item[1], f'macro "{macro}": the type of "{name}"')
        if kind not in TYPES:
            self.fail(
                "E200", f'macro "{macro}": "{kind}" is not a type', item[1], f"types: {', '.join(TYPES)}"
            )
        default = None
        if len(item) == 3:
            default = self.one(item[2], self.constants, f'the default of "{name}"')
            self.hold(macro, Parameter(name, kind, None), default)
        return Parameter(name, kind, default)

    def name(self, item: Item, what: str) -> str:
        if not isinstance(item, Atom) or item.kind is not Kind.SYMBOL or str(item.value)[0] in "!?":
            self.fail("E200", f"{what} has to be a plain symbol", item)
        return str(item.value)

    # --- expansion --------------------------------------------------------------------

    def items(self, items: list[Item], names: Names) -> list[Item]:
        """Return the entries of a list, expanded."""
        out: list[Item] = []
        after = ""
        for item in items:
            made = list(self.made(item, names, whole=bool(after)))
            if after and len(made) != 1:
                self.fail("E200", f'":{after}" takes one item, this gives {len(made)}', item)
            out += made
            keyword = isinstance(item, Atom) and item.kind is Kind.KEYWORD and not after
            after = str(item.value) if keyword and isinstance(item, Atom) else ""
        return out

    def one(self, item: Item, names: Names, what: str) -> Item:
        """Return what has to be exactly one item."""
        made = list(self.made(item, names, whole=True))
        if len(made) != 1:
            self.fail("E200", f"{what} has to be one item, this gives {len(made)}", item)
        return made[0]

    def made(self, item: Item, names: Names, *, whole: bool) -> Iterator[Item]:
        """Yield what stands for an item; with `whole` a list stands for itself, not for its entries."""
        self.charge(item)
        if isinstance(item, Atom):
            if item.kind is Kind.SYMBOL and str(item.value).startswith("?"):
                bound = self.bound(item, names)
                spliced = bound.spliced and not whole and isinstance(bound.item, Form)
                for entry in bound.item if spliced and isinstance(bound.item, Form) else (bound.item,):
                    yield self.copy(entry, self.depth)
            else:
                yield item
            return
        self.depth = self.deeper(self.depth, item)
        head = head_of(item)
        if not head.startswith("!"):
            form = Form(item.offset)
            form.length = item.length
            form.extend(self.items(item, names))
            yield form
        elif head == "!use":
            yield from self.use(item, names)
        elif head in ("!repeat", "!each"):
            yield from self.repeat(item, names)
        elif head == "!name":
            parts = [self.one(part, names, "a part of !name") for part in item[1:]]
            text = "-".join(self.part(part) for part in parts)
            self.charge(item, len(text) // LETTERS)
            if not is_symbol(text):
                self.fail("E200", f'"{text}" is not a symbol', item)
            yield Atom(Kind.SYMBOL, text, item.offset, item.length)
        elif head in ARITHMETIC:
            value = self.number(item, names)
            yield Atom(Kind.NUMBER, int(value) if value.is_integer() else value, item.offset, item.length)
        else:
            if head in ("!macro", "!constant"):
                self.fail("E200", f'"{head}" stands before the plan, not in it', item)
            self.fail("E201", f'unknown form "{head}"', item, nearest(head, FORMS))
        self.depth -= 1

    def use(self, form: Form, names: Names) -> Iterator[Item]:
        if len(form) < 2:
            self.fail("E200", '"!use" needs the name of a macro', form)
        name = self.name(form[1], "the name after !use")
        macro = self.macros.get(name)
        if macro is None:
            self.fail("E201", f'unknown macro "{name}"', form[1], nearest(name, self.macros))
        if name in self.using:
            circle = " -> ".join([*self.using[self.using.index(name) :], name])
            self.fail(
                "E204", f"a macro uses itself: {circle}", form, "a repetition has bounds: (!repeat ...)"
            )
        own: dict[str, Bound] = dict(self.constants)
        given: set[str] = set()
        for place in range(2, len(form), 2):
            word = form[place]
            if not isinstance(word, Atom) or word.kind is not Kind.KEYWORD or place + 1 >= len(form):
                self.fail("E202", f'macro "{name}": arguments are :parameter value', word)
            parameter = macro.parameters.get(str(word.value))
            if parameter is None:
                hint = nearest(str(word.value), macro.parameters)
                self.fail("E202", f'macro "{name}" has no parameter "{word.value}"', word, hint)
            if parameter.name in given:
                self.fail("E202", f'macro "{name}": "{parameter.name}" is given twice', word)
            given.add(parameter.name)
            argument = self.one(form[place + 1], names, f'"{parameter.name}"')
            own[parameter.name] = self.hold(name, parameter, argument)
        for parameter in macro.parameters.values():
            if parameter.name not in given:
                if parameter.default is None:
                    self.fail("E202", f'macro "{name}": "{parameter.name}" is missing', form)
                own[parameter.name] = self.hold(name, parameter, parameter.default)
        self.using.append(name)
        yield from self.items(macro.body, own)
        self.using.pop()

    def hold(self, macro: str, parameter: Parameter, item: Item) -> Bound:
        """Return the argument of a parameter if it is of its type."""
        spliced = parameter.type in LISTS
        if spliced and isinstance(item, Atom) and item.kind is Kind.SYMBOL and item.value == "nil":
            item = Form(item.offset)
        if not TYPES[parameter.type](item):
            found = "a list" if isinstance(item, Form) else f'"{item.value}"'
            self.fail(
                "E203", f'macro "{macro}": "{parameter.name}" needs {parameter.type}, found {found}', item
            )
        return Bound(item, spliced)

    def repeat(self, form: Form, names: Names) -> Iterator[Item]:
        head, control = head_of(form), form[1] if len(form) > 1 else None
        if not isinstance(control, Form) or not control or len(form) < 3:
            self.fail("E200", f'"{head}" is ({head} (name ...) body)', form)
        name = self.name(control[0], f"the name after {head}")
        rounds = self.each(control, names) if head == "!each" else self.counted(control, names)
        for item in rounds:
            self.charge(control)
            yield from self.items(form[2:], {**names, name: Bound(item)})

    def each(self, control: Form, names: Names) -> Iterator[Item]:
        yield from self.items(control[1:], names)

    def counted(self, control: Form, names: Names) -> Iterator[Item]:
        bounds = []
        for entry in control[1:]:
            made = self.one(entry, names, "a bound of !repeat")
            if not _is_integer(made):
                hint = "a repetition has a first and a last number"
                self.fail("E205", "the bounds of a repetition are whole numbers", entry, hint)
            assert isinstance(made, Atom)
            bounds.append(int(made.value))
        if len(bounds) not in (2, 3) or (len(bounds) == 3 and bounds[2] == 0):
            self.fail("E205", "a repetition is (name first last) or (name first last step)", control)
        first, last, step = (*bounds, 1)[:3]
        for number in range(first, last + (1 if step > 0 else -1), step):
            yield Atom(Kind.NUMBER, number, control.offset, control.length)

    # --- values -------------------------------------------------------------------------

    def number(self, form: Form, names: Names) -> float:
        operands = []
        for entry in form[1:]:
            made = self.one(entry, names, "an operand")
            if not isinstance(made, Atom) or made.kind is not Kind.NUMBER:
                self.fail("E207", f'"{head_of(form)}" needs numbers', entry)
            operands.append(float(made.value))
        try:
            value = float(ARITHMETIC[head_of(form)](operands))
        except (ArithmeticError, ValueError, TypeError, IndexError):
            value = math.nan
        if not math.isfinite(value):
            shown = " ".join(f"{operand:g}" for operand in operands)
            self.fail("E207", f"({head_of(form)} {shown}) has no value", form)
        return value

    def part(self, item: Item) -> str:
        if not isinstance(item, Atom) or item.kind is Kind.OPERATOR:
            self.fail("E200", "a name is made of symbols, strings and numbers", item)
        if item.kind is Kind.NUMBER:
            return f"{item.value:g}" if isinstance(item.value, float) else str(item.value)
        return str(item.value)

    def bound(self, atom: Atom, names: Names) -> Bound:
        name = str(atom.value)[1:]
        found = names.get(name)
        if found is None:
            self.fail("E201", f'"?{name}" stands for nothing here', atom, nearest(name, names))
        return found

    def copy(self, item: Item, depth: int) -> Item:
        """Return an item anew, to stand at a depth: no list may stand in two places of the tree."""
        self.charge(item)
        if isinstance(item, Atom):
            return item
        inside = self.deeper(depth, item)
        form = Form(item.offset)
        form.length = item.length
        form.extend(self.copy(entry, inside) for entry in item)
        return form

    def deeper(self, depth: int, item: Item) -> int:
        """Return the depth of what stands in a list at a depth."""
        if depth >= NESTING_LIMIT:
            self.fail("E206", f"lists are nested deeper than {NESTING_LIMIT}", item)
        return depth + 1

    def charge(self, item: Item, count: int = 1) -> None:
        self.last = item
        self.count += count
        if self.count > self.limit:
            self.fail("E206", f"the expansion has more than {self.limit:,} items", item)

    def fail(self, code: str, message: str, item: Item, hint: str = "") -> NoReturn:
        line, column = self.lines.position(item.offset)
        if self.using:
            using = self.using if len(self.using) <= 6 else [*self.using[:3], "...", *self.using[-3:]]
            message += f" (in macro {' -> '.join(using)})"
        raise CrlSyntaxError(message, code=code, line=line, column=column, hint=hint)


def _difference(numbers: list[float]) -> float:
    return -numbers[0] if len(numbers) == 1 else numbers[0] - sum(numbers[1:])


def _only(work: Callable[..., float], count: int) -> Callable[[list[float]], float]:
    def checked(numbers: list[float]) -> float:
        if len(numbers) != count:
            raise ValueError(f"needs {count} operands")
        return work(*numbers)

    return checked


ARITHMETIC: Mapping[str, Callable[[list[float]], float]] = {
    "!+": math.fsum,
    "!-": _difference,
    "!*": math.prod,
    "!div": _only(lambda a, b: a / b, 2),
    "!mod": _only(lambda a, b: a % b, 2),
    "!min": min,
    "!max": max,
    "!round": _only(lambda a: math.floor(a + 0.5), 1),
}
"""Arithmetic over constants, by the heads of its forms."""

FORMS = ("!use", "!repeat", "!each", "!name", "!constant", "!macro", *ARITHMETIC)
