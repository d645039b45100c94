"""XTCE 1.2 (OMG), as Yamcs and `yamcs-pymdb` write it, read as a `ForeignDictionary`.

Commands keep the arguments of those that they rest on, less the ones that are assigned. Names are the way of
space systems to the name, joined by points, without the root system. Containers and encodings are not asked
for: they say how a value is packed, not what it is.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from neighbours.flight.errors import FlightError, ForeignDictionaryError
from neighbours.flight.foreign import (
    Argument,
    Channel,
    Choice,
    Flag,
    ForeignCommand,
    ForeignDictionary,
    ForeignType,
    Group,
    Number,
    Series,
    Text,
    Unsaid,
)

if TYPE_CHECKING:
    from xml.etree.ElementTree import Element

_DEEPEST = 20
_LARGEST_BYTES = 64 * 1024 * 1024
_NO_SUCH = Unsaid("no type")


def read_xtce(path: Path) -> ForeignDictionary:
    """Return the dictionary in an XTCE file.

    Raises
    ------
    ForeignDictionaryError
        If the file cannot be read, declares entities or a document type (an XML bomb begins with one), or
        parts of it contradict each other: every one is named with its value.
    FlightError
        If the extra `flight` is not installed.
    """
    return _Reader(_parsed(path), str(path)).dictionary()


def _parsed(path: Path) -> Element:
    try:
        from defusedxml.common import DefusedXmlException
        from defusedxml.ElementTree import ParseError, fromstring
    except ImportError as err:
        raise FlightError("XTCE needs the package defusedxml: pip install 'outcrop[flight]'") from err
    where = str(path)
    try:
        size = path.stat().st_size
        if size > _LARGEST_BYTES:
            raise ForeignDictionaryError(where, (f"has {size} bytes; at most {_LARGEST_BYTES} are read",))
        root: Element = fromstring(path.read_bytes(), forbid_dtd=True)
    except OSError as err:
        raise ForeignDictionaryError(where, (err.strerror or str(err),)) from err
    except DefusedXmlException as err:
        told = f"is refused as an XML bomb might be: {type(err).__name__} ({err})"
        raise ForeignDictionaryError(where, (told,)) from err
    except (ParseError, ValueError, LookupError) as err:
        raise ForeignDictionaryError(where, (f"is not XML: {err}",)) from err
    if _tag(root) != "SpaceSystem":
        raise ForeignDictionaryError(where, (f"begins with <{_tag(root)}>; XTCE begins with <SpaceSystem>",))
    return root


@dataclass(frozen=True)
class _System:
    """A space system: its way from the root (without the root's name), and where it lies in the file."""

    way: tuple[str, ...]
    element: Element


class _Reader:
    """Reads one document and gathers what is wrong with it."""

    def __init__(self, root: Element, where: str) -> None:
        self.wrong: list[str] = []
        self.where, self.root = where, root
        self.systems: list[_System] = []
        self.types: dict[tuple[str, ...], Element] = {}
        self.made: dict[tuple[tuple[str, ...], int], ForeignType] = {}
        self.commands: dict[tuple[str, ...], Element] = {}
        waiting = [_System((), root)]
        while waiting:
            system = waiting.pop()
            self.systems.append(system)
            self.index(system)
            below = [_System((*system.way, _name(e)), e) for e in _all(system.element, "SpaceSystem")]
            waiting += reversed(below)

    def index(self, system: _System) -> None:
        """Note down types and commands of a system by their ways; one that is there twice is told."""
        for sort in ("ParameterTypeSet", "ArgumentTypeSet"):
            for found in _below(system.element, sort):
                for element in found:
                    self.note(self.types, (sort, *system.way, _name(element)), element, "type")
        for found in _below(system.element, "MetaCommandSet"):
            for element in _all(found, "MetaCommand"):
                self.note(self.commands, (*system.way, _name(element)), element, "command")

    def note(
        self, held: dict[tuple[str, ...], Element], way: tuple[str, ...], item: Element, what: str
    ) -> None:
        if way in held:
            self.wrong.append(f'{what} "{_name(item)}" is given 2 times')
        held[way] = item

    def dictionary(self) -> ForeignDictionary:
        commands = [
            self.command(way, element)
            for way, element in self.commands.items()
            if element.get("abstract", "false") != "true"
        ]
        channels = [
            self.channel(system, element)
            for system in self.systems
            for found in _below(system.element, "ParameterSet")
            for element in _all(found, "Parameter")
        ]
        for name, n in Counter(c.name for c in channels).items():
            if n > 1:
                self.wrong.append(f'parameter "{name}" is given {n} times')
        if self.wrong:
            raise ForeignDictionaryError(self.where, tuple(dict.fromkeys(self.wrong)))
        header = next(iter(_all(self.root, "Header")), None)
        version = "" if header is None else header.get("version", "")
        return ForeignDictionary(
            _name(self.root) or Path(self.where).stem,
            version or "1",
            "XTCE",
            tuple(commands),
            tuple(channels),
        )

    def command(self, way: tuple[str, ...], element: Element) -> ForeignCommand:
        name = ".".join(way)
        arguments: dict[str, Argument] = {}
        assigned: set[str] = set()
        at, here = way, element
        for _ in range(_DEEPEST):
            own = {a.name: a for a in self.arguments(at, here, name)}
            for twice in own.keys() & arguments.keys():
                self.wrong.append(f'command "{name}" has the argument "{twice}", as the one it rests on has')
            arguments = {**own, **arguments}
            base = next(iter(_all(here, "BaseMetaCommand")), None)
            if base is None:
                break
            assigned |= {a.get("argumentName", "") for a in base.iter() if _tag(a) == "ArgumentAssignment"}
            found = self.look_up(self.commands, (), at[:-1], base.get("metaCommandRef", ""))
            if found is None:
                told = base.get("metaCommandRef", "")
                self.wrong.append(f'command "{name}" rests on the command "{told}", which is not defined')
                break
            at, here = found, self.commands[found]
        else:
            self.wrong.append(f'command "{name}" rests on more than {_DEEPEST} commands')
        for unknown in sorted(assigned - arguments.keys()):
            self.wrong.append(f'command "{name}" assigns the argument "{unknown}", which it does not have')
        kept = tuple(a for label, a in arguments.items() if label not in assigned)
        level = next((e.get("consequenceLevel") for e in _all(element, "DefaultSignificance")), None)
        remarks = () if level in (None, "none", "normal") else (f"consequence level {level}",)
        return ForeignCommand(name, kept, _doc(element), remarks)

    def arguments(self, way: tuple[str, ...], element: Element, command: str) -> list[Argument]:
        found = []
        for entry in _all(element, "ArgumentList"):
            for item in _all(entry, "Argument"):
                label = _name(item)
                kind = self.type_of(
                    "ArgumentTypeSet", way[:-1], item.get("argumentTypeRef", ""), f"{command}.{label}"
                )
                initial = item.get("initialValue")
                remarks = () if initial is None else (f"initial value {initial}",)
                found.append(Argument(label, kind, _doc(item), remarks))
        names = Counter(a.name for a in found)
        self.wrong += [f'command "{command}" has the argument "{n}" twice' for n, k in names.items() if k > 1]
        return found

    def channel(self, system: _System, element: Element) -> Channel:
        name = ".".join((*system.way, _name(element)))
        reference = element.get("parameterTypeRef", "")
        kind = self.type_of("ParameterTypeSet", system.way, reference, name)
        way = self.look_up(self.types, ("ParameterTypeSet",), system.way, reference)
        alarms = way is not None and any(_tag(e).endswith("Alarm") for e in self.types[way])
        return Channel(name, kind, _doc(element), ("limits of alarms",) if alarms else ())

    def look_up(
        self,
        held: dict[tuple[str, ...], Element],
        sort: tuple[str, ...],
        way: tuple[str, ...],
        reference: str,
    ) -> tuple[str, ...] | None:
        """Return the way of what a reference names: absolute, or from the system outwards."""
        parts = [p for p in reference.split("/") if p not in ("", ".")]
        if not parts:
            return None
        if reference.startswith("/"):
            parts = parts[1:] if parts[0] == _name(self.root) else parts
            way = ()
        while parts and parts[0] == "..":
            parts, way = parts[1:], way[:-1]
        for length in range(len(way), -1, -1):
            found = (*sort, *way[:length], *parts)
            if found in held:
                return found
        return None

    def type_of(
        self, sort: str, way: tuple[str, ...], reference: str, where: str, depth: int = 0
    ) -> ForeignType:
        """Return a type by its name; one that is wrong is told and stands for nothing."""
        found = self.look_up(self.types, (sort,), way, reference)
        if found is None and sort == "ArgumentTypeSet":
            found = self.look_up(self.types, ("ParameterTypeSet",), way, reference)
        if found is None:
            self.wrong.append(f'{where} has the type "{reference}", which is not defined')
            return _NO_SUCH
        if depth > _DEEPEST:
            self.wrong.append(f'{where}: type "{reference}" lies more than {_DEEPEST} types deep')
            return _NO_SUCH
        if (found, depth) not in self.made:  # once at each depth: types of types would be many
            self.made[found, depth] = self.made_of(found, where, depth)
        return self.made[found, depth]

    def made_of(self, found: tuple[str, ...], where: str, depth: int) -> ForeignType:
        """Return the type of a way; `where` it was first asked for stands in what is told of it."""
        element = self.types[found]
        kind = _tag(element).removesuffix("ParameterType").removesuffix("ArgumentType")
        inside = (found[0], found[1:-1])
        match kind:
            case "Integer" | "Float":
                return self.number(element, kind == "Integer", where)
            case "Boolean":
                return Flag()
            case "String":
                return Text()
            case "Enumerated":
                return self.choice(element, where)
            case "Array":
                length = self.length(element, where)
                inner = self.type_of(*inside, element.get("arrayTypeRef", ""), where, depth + 1)
                return _NO_SUCH if length is None else Series(inner, length)
            case "Aggregate":
                members = tuple(
                    (_name(m), self.type_of(*inside, m.get("typeRef", ""), f"{where}.{_name(m)}", depth + 1))
                    for listed in _all(element, "MemberList")
                    for m in _all(listed, "Member")
                )
                if not members:
                    self.wrong.append(f'aggregate "{_name(element)}" has no members')
                return Group(members)
            case _:
                return Unsaid(kind.lower())

    def number(self, element: Element, whole: bool, where: str) -> ForeignType:
        limits: dict[str, float | None] = {"min": None, "max": None}
        for found in (e for e in element.iter() if _tag(e) == "ValidRange"):
            for side in limits:
                for member in (f"{side}Inclusive", f"{side}Exclusive"):
                    text = found.get(member)
                    limits[side] = limits[side] if text is None else self.float_of(text, f"{where} {member}")
        low, high = limits["min"], limits["max"]
        if low is not None and high is not None and low > high:
            self.wrong.append(f"{where} has the least value {low:g}, above its largest {high:g}")
        unit = " ".join(e.text.strip() for e in element.iter() if _tag(e) == "Unit" and e.text)
        return Number(low, high, unit, whole)

    def float_of(self, text: str, where: str) -> float | None:
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if value != value or value in (float("inf"), float("-inf")):
            self.wrong.append(f'{where} is "{text}", which is not a finite number')
            return None
        return value

    def choice(self, element: Element, where: str) -> ForeignType:
        entries = [e for e in element.iter() if _tag(e) == "Enumeration"]
        labels = [e.get("label", "") for e in entries]
        values = [e.get("value", "") for e in entries]
        if not labels:
            self.wrong.append(f'{where} has the enumeration "{_name(element)}", which has no labels')
        for what, names in (("label", labels), ("value", values)):
            twice = [n for n, k in Counter(names).items() if k > 1]
            self.wrong += [f'enumeration "{_name(element)}" has the {what} "{n}" twice' for n in twice]
        return Choice(tuple(labels))

    def length(self, element: Element, where: str) -> int | None:
        """Return the length of an array of one dimension with fixed ends; None where it has none."""
        dimensions = [e for e in element.iter() if _tag(e) == "Dimension"]
        ends = [e.text for d in dimensions for side in d for e in side if _tag(e) == "FixedValue"]
        if (
            len(dimensions) != 1
            or len(ends) != 2
            or not all((e or "").strip().lstrip("-").isdecimal() for e in ends)
        ):
            return None
        first, last = (int(e or 0) for e in ends)
        if last < first:
            self.wrong.append(f"{where} is an array from {first} to {last}, which has no values")
            return None
        return last - first + 1


def _tag(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]


def _name(element: Element) -> str:
    return element.get("name", "")


def _all(element: Element, tag: str) -> list[Element]:
    return [e for e in element if _tag(e) == tag]


def _below(system: Element, tag: str) -> list[Element]:
    """Return the sets of a system's own metadata that have a tag."""
    return [
        e
        for side in ("TelemetryMetaData", "CommandMetaData")
        for m in _all(system, side)
        for e in _all(m, tag)
    ]


def _doc(element: Element) -> str:
    long = next((e.text for e in _all(element, "LongDescription") if e.text), "")
    return element.get("shortDescription", "") or long.strip()
