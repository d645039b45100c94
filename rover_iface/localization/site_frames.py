"""Site frames and rover poses in the convention of the Mars rovers, with the history of every solution.

A *motion counter* is (site, drive, ...), up to five indices. `SITE_FRAME (n)` is named by the site alone,
`ROVER_FRAME (site, drive, ...)` by where the rover stood; site 0 is the landing site. Axes are north, east,
nadir (a rover's: forward, right, down), as in the mission's files; `SiteFrames.pose` answers in ours. A
solution places one frame in another; a frame may have many, and `SiteFrames.in_use` says which one counts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from rover_iface.errors import LocalizationError
from rover_iface.frames import Pose, Transform, rotation_from_quaternion, site_from_rover_flu

SITE, ROVER = "SITE_FRAME", "ROVER_FRAME"
MOST_INDICES = 5


@dataclass(frozen=True, slots=True)
class FrameId:
    """A frame by its name and motion counter: `FrameId("SITE_FRAME", (137,))`."""

    name: str
    counter: tuple[int, ...]

    def __post_init__(self) -> None:
        if not 1 <= len(self.counter) <= MOST_INDICES or min(self.counter) < 0:
            raise LocalizationError(
                f"{self.name} has motion counter {self.counter}; it takes 1 to {MOST_INDICES} indices from 0"
            )

    def __str__(self) -> str:
        return f"{self.name} {self.counter}"


def site(index: int) -> FrameId:
    """Return the id of a site frame."""
    return FrameId(SITE, (index,))


LANDING = site(0)


@dataclass(frozen=True, slots=True)
class FrameSolution:
    """One answer to where `frame` lies: its origin (metres) and attitude (s, v1, v2, v3) in `reference`.

    `solution_id` tells who found it (``telemetry``, ``adjusted``, ...).
    """

    solution_id: str
    frame: FrameId
    reference: FrameId
    offset_m: tuple[float, float, float]
    quaternion: tuple[float, float, float, float]
    added_utc: datetime

    def __post_init__(self) -> None:
        if not all(map(math.isfinite, (*self.offset_m, *self.quaternion))):
            raise LocalizationError(
                f"solution {self.solution_id} of {self.frame} has a value that is not finite"
            )
        if not 0.99 < math.hypot(*self.quaternion) < 1.01:
            raise LocalizationError(
                f"{self.frame} has a quaternion of length {math.hypot(*self.quaternion):.4f}, not 1 +- 0.01"
            )
        if self.added_utc.tzinfo is None:
            raise LocalizationError(
                f"solution {self.solution_id} of {self.frame} has a date without time zone"
            )

    @property
    def reference_from_frame(self) -> Transform:
        """Return the transform the solution states, both frames in the rovers' convention."""
        return Transform(rotation_from_quaternion(*self.quaternion), np.array(self.offset_m))


@dataclass(frozen=True, slots=True)
class Alias:
    """The motion counter `old` was given the new name `new`: where a new site was declared."""

    old: tuple[int, ...]
    new: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class FrameFile:
    """What one mission file (`.svf`: sites, `.rvf`: rover poses within a site) says, in its order."""

    mission: str
    variant: str
    counter: tuple[int, ...]
    priority: tuple[str, ...]
    records: tuple[FrameSolution | Alias, ...]

    @property
    def solutions(self) -> tuple[FrameSolution, ...]:
        """Return the solutions in the order of the file."""
        return tuple(record for record in self.records if isinstance(record, FrameSolution))

    @property
    def aliases(self) -> tuple[Alias, ...]:
        """Return the renamed motion counters in the order of the file."""
        return tuple(record for record in self.records if isinstance(record, Alias))


def _attribute(element: ElementTree.Element, name: str) -> str:
    value = element.get(name)
    if value is None:
        raise LocalizationError(f"<{element.tag}> has no attribute {name}")
    return value


def _child(element: ElementTree.Element, tag: str) -> ElementTree.Element:
    found = element.find(tag)
    if found is None:
        raise LocalizationError(f"<{element.tag}> has no <{tag}>")
    return found


def _number(element: ElementTree.Element, name: str) -> float:
    text = _attribute(element, name)
    try:
        return float(text)
    except ValueError as err:
        raise LocalizationError(f'<{element.tag}> has {name}="{text}", which is not a number') from err


def _counter(element: ElementTree.Element) -> tuple[int, ...]:
    texts = [element.get(f"index{k}") for k in range(1, MOST_INDICES + 1)]
    known = [text for text in texts if text is not None]
    if texts[: len(known)] != known or not all(text.isascii() and text.isdigit() for text in known):
        raise LocalizationError(
            f"<{element.tag}> has motion counter {texts}; indices are whole and without gap"
        )
    return tuple(int(text) for text in known)


def _date(element: ElementTree.Element) -> datetime:
    text = _attribute(element, "add_date")
    try:
        return datetime.strptime(text, "%Y-%m-%dT%H:%M:%SZ").replace(tzinfo=UTC)
    except ValueError as err:
        raise LocalizationError(f'<solution> has add_date="{text}"; it takes 2009-04-06T14:26:38Z') from err


def _solution(element: ElementTree.Element) -> FrameSolution:
    reference, offset, turn = (_child(element, tag) for tag in ("reference_frame", "offset", "orientation"))
    x, y, z = (_number(offset, name) for name in "xyz")
    s, v1, v2, v3 = (_number(turn, name) for name in ("s", "v1", "v2", "v3"))
    return FrameSolution(
        _attribute(element, "solution_id"),
        FrameId(_attribute(element, "name"), _counter(element)),
        FrameId(_attribute(reference, "name"), _counter(reference)),
        (x, y, z),
        (s, v1, v2, v3),
        _date(element),
    )


def parse_frame_file(text: bytes) -> FrameFile:
    """Return the content of a mission frame file (XML, root ``rmc_file``).

    Raises
    ------
    LocalizationError
        If the text is no such file, or a value in it is missing or malformed.
    """
    if b"<!DOCTYPE" in text:
        raise LocalizationError("a frame file holds no document type declaration")
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as err:
        raise LocalizationError(f"not a frame file: {err}") from err
    if root.tag != "rmc_file":
        raise LocalizationError(f"not a frame file: its root is <{root.tag}>, not <rmc_file>")
    priority: tuple[str, ...] = ()
    records: list[FrameSolution | Alias] = []
    for element in root:
        match element.tag:
            case "priority":
                priority = tuple(_attribute(entry, "solution_id") for entry in element)
            case "solution":
                records.append(_solution(element))
            case "alias":
                records.append(Alias(_counter(_child(element, "old")), _counter(_child(element, "new"))))
            case tag:
                raise LocalizationError(f"<rmc_file> holds <{tag}>; known are priority, solution, alias")
    return FrameFile(
        _attribute(root, "mission"), _attribute(root, "variant"), _counter(root), priority, tuple(records)
    )


def read_frame_file(path: Path) -> FrameFile:
    """Return the content of a `.svf` or `.rvf` file; see `parse_frame_file`."""
    return parse_frame_file(path.read_bytes())


def _indices(counter: tuple[int, ...]) -> dict[str, str]:
    return {f"index{k}": str(index) for k, index in enumerate(counter, 1)}


def print_frame_file(file: FrameFile) -> str:
    """Return the file as XML: element for element what was read, so that parsing it gives `file` again."""
    root = ElementTree.Element(
        "rmc_file", {"mission": file.mission, "variant": file.variant, **_indices(file.counter)}
    )
    priority = ElementTree.SubElement(root, "priority")
    for solution_id in file.priority:
        ElementTree.SubElement(priority, "entry", {"solution_id": solution_id})
    for record in file.records:
        if isinstance(record, Alias):
            alias = ElementTree.SubElement(root, "alias")
            ElementTree.SubElement(alias, "old", _indices(record.old))
            ElementTree.SubElement(alias, "new", _indices(record.new))
            continue
        about = {
            "solution_id": record.solution_id,
            "name": record.frame.name,
            "add_date": record.added_utc.astimezone(UTC).strftime("%Y-%m-%dT%H:%M:%SZ"),
        }
        solution = ElementTree.SubElement(root, "solution", about | _indices(record.frame.counter))
        reference = {"name": record.reference.name, **_indices(record.reference.counter)}
        ElementTree.SubElement(solution, "reference_frame", reference)
        offset = dict(zip("xyz", map(repr, record.offset_m), strict=True))
        ElementTree.SubElement(solution, "offset", offset)
        turn = dict(zip(("s", "v1", "v2", "v3"), map(repr, record.quaternion), strict=True))
        ElementTree.SubElement(solution, "orientation", turn)
    ElementTree.indent(root)
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n"


@dataclass(frozen=True)
class SiteFrames:
    """All frames known, every solution of each, and the one in use. Never changed: an update is a new value.

    Parameters
    ----------
    priority
        Solution ids, best first. Of the solutions of a frame the one whose id comes first is in use, of
        several with that id the latest added. A solution whose id is not listed is kept and not used.
    """

    priority: tuple[str, ...]
    solutions: tuple[FrameSolution, ...] = ()
    aliases: tuple[Alias, ...] = ()

    @staticmethod
    def of(files: Iterable[FrameFile]) -> SiteFrames:
        """Return the frames of several files together; ids keep the order in which they are first listed."""
        listed = tuple(files)
        return SiteFrames(
            tuple(dict.fromkeys(name for file in listed for name in file.priority)),
            tuple(solution for file in listed for solution in file.solutions),
            tuple(alias for file in listed for alias in file.aliases),
        )

    @cached_property
    def _histories(self) -> dict[FrameId, tuple[FrameSolution, ...]]:
        grouped: dict[FrameId, list[FrameSolution]] = {}
        for solution in self.solutions:
            grouped.setdefault(solution.frame, []).append(solution)
        return {frame: tuple(sorted(found, key=lambda s: s.added_utc)) for frame, found in grouped.items()}

    @property
    def frames(self) -> tuple[FrameId, ...]:
        """Return every frame that has a solution, in the order of arrival."""
        return tuple(self._histories)

    def history(self, frame: FrameId) -> tuple[FrameSolution, ...]:
        """Return every solution of a frame, oldest first."""
        return self._histories.get(frame, ())

    def in_use(self, frame: FrameId) -> FrameSolution:
        """Return the solution of a frame that counts.

        Raises
        ------
        LocalizationError
            If the frame has no solution with an id of `priority`.
        """
        for solution_id in self.priority:
            found = [solution for solution in self.history(frame) if solution.solution_id == solution_id]
            if found:
                return found[-1]
        raise LocalizationError(f"{frame} has no solution by any of {', '.join(self.priority) or 'nobody'}")

    def landing_from(self, frame: FrameId) -> Transform:
        """Return the transform from a frame to the landing site's, by the solutions in use.

        Raises
        ------
        LocalizationError
            If a frame on the way has no solution in use, or the frames refer to each other in a circle.
        """
        moved, seen = Transform.identity(), {frame}
        while frame != LANDING:
            solution = self.in_use(frame)
            moved = solution.reference_from_frame * moved
            frame = solution.reference
            if frame in seen:
                raise LocalizationError(f"{frame} refers back to itself")
            seen.add(frame)
        return moved

    def transform(self, into: FrameId, of: FrameId) -> Transform:
        """Return `into_from_of`: `transform(into, of).apply(target)` is a target of frame `of` in `into`."""
        return self.landing_from(into).inverse() * self.landing_from(of)

    def pose(self, rover: FrameId, into: FrameId) -> Pose:
        """Return where a rover frame lies in a site, east-north-up, as the rest of this room has poses."""
        return Pose.from_transform(site_from_rover_flu(self.transform(into, rover)))

    def renamed(self, counter: tuple[int, ...]) -> FrameId | None:
        """Return the site declared where the rover had this motion counter, or None."""
        return next((FrameId(SITE, alias.new) for alias in self.aliases if alias.old == counter), None)

    def with_solution(self, solution: FrameSolution, *, preferred: bool = True) -> SiteFrames:
        """Return the frames with one more solution; with `preferred` its id goes to the head of the priority.

        The old solutions stay in the history. With an id that is listed already, `preferred` moves it, which
        also brings it into use for other frames that have it.
        """
        if not preferred:
            return replace(self, solutions=(*self.solutions, solution))
        others = tuple(name for name in self.priority if name != solution.solution_id)
        return replace(self, priority=(solution.solution_id, *others), solutions=(*self.solutions, solution))


def carry(before: SiteFrames, after: SiteFrames, frame: FrameId) -> Transform:
    """Return the motion, in the landing site's axes, of all seen from `frame` when it is re-localised.

    Targets kept in the frame's own coordinates need no change; maps and targets kept in the landing site's go
    to ``carry(before, after, frame).apply(points)``.
    """
    return after.landing_from(frame) * before.landing_from(frame).inverse()
