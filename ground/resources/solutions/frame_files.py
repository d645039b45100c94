"""Take in and give out the missions' frame files (.svf: sites, .rvf: rover poses within a site)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from sqlalchemy import select
from sqlalchemy.orm import Session

from ground.errors import InvalidInputError, NotFoundError, TooLargeError
from ground.gdr.ids import new_id
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.edit import insert, update
from ground.records.get_resource import find_row
from ground.resources.frames.create_frame import SITE, frame_row, next_position
from ground.resources.frames.kind import FRAME
from ground.resources.frames.row import FrameFileRow, FrameRow, SolutionRow
from ground.resources.frames.site_chain import key_of
from ground.resources.frames.value import Level
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.solutions.kind import FRAME_FILE, SOLUTION
from ground.resources.solutions.value import FrameFile as FrameFileValue
from ground.resources.uploads.row import UploadRow
from ground.resources.uploads.store_upload import uploaded_file

if TYPE_CHECKING:
    from rover_iface.localization.site_frames import FrameFile, FrameId, FrameSolution

MAX_BYTES = 32 * 2**20
CHOSEN = "chosen"
"""Solution id under which a choice goes out that the priority of the files would not make."""


def import_frames(repo: Repository, actor: Actor, mission_id: str, upload_id: str) -> FrameFileValue:
    """Return the record of an uploaded frame file: its frames and solutions are now the mission's.

    What is here already is not taken in twice, so that a file that grew can come again. A frame without a
    solution in use gets the one that the priority of the files names; one that has keeps it: an import moves
    nothing that is tied to a frame.

    Raises
    ------
    InvalidInputError
        If it is no such file, holds malformed values, or its frames refer to each other in a circle.
    """
    from rover_iface.errors import RoverError
    from rover_iface.localization.site_frames import parse_frame_file

    actor.require(Action.EDIT_MISSION, mission_id)
    path = uploaded_file(repo, actor, upload_id)
    if path.stat().st_size > MAX_BYTES:
        raise TooLargeError(f"the file has {path.stat().st_size} bytes; {MAX_BYTES} are allowed")
    try:
        file = parse_frame_file(path.read_bytes())
    except RoverError as err:
        raise InvalidInputError(str(err), pointer="/upload_id") from err
    _check_texts(file)
    with repo.database.write() as session:
        upload = session.get_one(UploadRow, upload_id)
        mission = find_row(session, MISSION, mission_id)
        row = _take_in(session, actor, mission, file, upload)
        return FRAME_FILE.show_one(session, row)


def _check_texts(file: FrameFile) -> None:
    for what, text, most in (
        ("mission", file.mission, 80),
        ("variant", file.variant, 80),
        *(("solution_id", s.solution_id, 80) for s in file.solutions),
        *(("name", frame.name, 80) for s in file.solutions for frame in (s.frame, s.reference)),
    ):
        if len(text) > most:
            raise InvalidInputError(
                f'{what} "{text[:40]}..." has {len(text)} characters; at most {most} are kept',
                pointer="/upload_id",
            )


def _take_in(
    session: Session, actor: Actor, mission: MissionRow, file: FrameFile, upload: UploadRow
) -> FrameFileRow:
    from rover_iface.localization.site_frames import FrameId, FrameSolution

    file_id = new_id("frf")
    frames = {
        row.key: row for row in session.scalars(select(FrameRow).where(FrameRow.mission_id == mission.id))
    }
    before = Counter(solution for _, solution in _solutions(session, mission.id))
    known_aliases = Counter(
        (tuple(a["old"]), tuple(a["new"])) for held in _files(session, mission.id) for a in held.aliases
    )
    start = next_position(session, mission.id)
    mentioned: list[FrameId] = []
    fresh: list[tuple[int, FrameSolution]] = []
    aliases: list[dict[str, Any]] = []
    known = 0
    for place, record in enumerate(file.records):
        if isinstance(record, FrameSolution):
            mentioned += [record.reference, record.frame]
            if before[record] > 0:
                before[record] -= 1
                known += 1
            else:
                fresh.append((start + place, record))
            continue
        if len(record.new) == 1:
            mentioned.append(FrameId(SITE, record.new))
        if known_aliases[(record.old, record.new)] > 0:
            known_aliases[(record.old, record.new)] -= 1
        else:
            aliases.append({"old": list(record.old), "new": list(record.new), "position": start + place})
    added = [frame for frame in dict.fromkeys(mentioned) if key_of(frame.name, frame.counter) not in frames]
    for frame in added:
        made = frame_row(actor, mission.id, frame.name, frame.counter)
        frames[made.key] = made
    rows = [
        (
            solution,
            SolutionRow(
                id=new_id("sln"),
                author=actor.name,
                mission_id=mission.id,
                frame_id=frames[key_of(solution.frame.name, solution.frame.counter)].id,
                reference_id=frames[key_of(solution.reference.name, solution.reference.counter)].id,
                file_id=file_id,
                label=solution.solution_id,
                offset_m=list(solution.offset_m),
                quaternion=list(solution.quaternion),
                covariance=None,
                added_utc=solution.added_utc,
                position=position,
                source={"kind": "file", "file_id": file_id, "file_name": upload.file_name},
            ),
        )
        for position, solution in fresh
    ]
    priority = priority_of([*_files(session, mission.id), file])
    chosen = _first_choices(priority, rows, {frame.id for frame in frames.values() if not frame.solution_id})
    for frame in added:
        made = frames[key_of(frame.name, frame.counter)]
        made.solution_id = chosen.pop(made.id, None)
        insert(session, actor, FRAME, made, reason="import")
    for _, solution_row in rows:
        insert(session, actor, SOLUTION, solution_row, reason="import")
    by_id = {frame.id: frame for frame in frames.values()}
    for frame_id, solution_id in chosen.items():
        update(session, actor, FRAME, by_id[frame_id], {"solution_id": solution_id})
    if mission.anchor_frame_id is None:
        sites = sorted(
            (frame for frame in frames.values() if frame.level == Level.SITE), key=lambda frame: frame.site
        )
        if sites:
            anchored = {"anchor_frame_id": sites[0].id}
            update(session, actor, MISSION, mission, anchored)
    row = FrameFileRow(
        id=file_id,
        author=actor.name,
        mission_id=mission.id,
        file_name=upload.file_name,
        sha256=upload.sha256,
        rover=file.mission,
        variant=file.variant,
        counter=list(file.counter),
        priority=list(file.priority),
        aliases=aliases,
        added=len(rows),
        known=known,
    )
    insert(session, actor, FRAME_FILE, row, reason="import")
    _refuse_circles(session, mission.id)
    return row


def _refuse_circles(session: Session, mission_id: str) -> None:
    """Raise if a frame refers back to itself by the solutions in use."""
    f_, s = FrameRow, SolutionRow
    query = select(f_.id, f_.key, s.reference_id).join(s, s.id == f_.solution_id)
    up = {row.id: row for row in session.execute(query.where(f_.mission_id == mission_id))}
    sound: set[str] = set()
    for start in up:
        way: list[str] = []
        at = start
        while at in up and at not in sound:
            if at in way:
                raise InvalidInputError(f"{up[at].key} refers back to itself", pointer="/upload_id")
            way.append(at)
            at = up[at].reference_id
        sound.update(way)


def _files(session: Session, mission_id: str) -> list[FrameFileRow]:
    rows = FrameFileRow
    return list(session.scalars(select(rows).where(rows.mission_id == mission_id).order_by(rows.id)))


def priority_of(files: Iterable[Any]) -> tuple[str, ...]:
    """Return the solution ids of several files, best first, each as early as it is first listed."""
    return tuple(dict.fromkeys(label for file in files for label in file.priority))


def _first_choices(
    priority: Sequence[str], rows: Sequence[tuple[FrameSolution, SolutionRow]], open_frames: set[str]
) -> dict[str, str]:
    """Return the solution that the rule of the files puts in use, for frames that have none in use."""
    best: dict[str, tuple[int, Any, str]] = {}
    rank = {label: k for k, label in enumerate(priority)}
    for solution, row in rows:
        if row.frame_id not in open_frames or solution.solution_id not in rank:
            continue
        order = (-rank[solution.solution_id], solution.added_utc)
        if row.frame_id not in best or order >= best[row.frame_id][:2]:
            best[row.frame_id] = (*order, row.id)
    return {frame_id: found[2] for frame_id, found in best.items()}


def _solutions(session: Session, mission_id: str) -> list[tuple[SolutionRow, FrameSolution]]:
    """Return the solutions of a mission in the order of arrival, also as the rover's room has them."""
    from rover_iface.localization.site_frames import FrameId, FrameSolution

    fr, s = FrameRow, SolutionRow
    frames = {
        row.id: FrameId(row.name, tuple(row.counter))
        for row in session.execute(select(fr.id, fr.name, fr.counter).where(fr.mission_id == mission_id))
    }
    rows = session.scalars(select(s).where(s.mission_id == mission_id).order_by(s.position, s.id))
    return [
        (
            row,
            FrameSolution(
                row.label,
                frames[row.frame_id],
                frames[row.reference_id],
                tuple(row.offset_m),
                tuple(row.quaternion),
                row.added_utc,
            ),
        )
        for row in rows
    ]


def export_frames(
    repo: Repository, actor: Actor, mission_id: str, *, site: int | None = None
) -> tuple[str, bytes]:
    """Return name and content of a frame file: all sites, or the rover poses within one.

    What was imported goes out element for element as it came in. A choice that the priority would not make
    goes out as one more solution, called `chosen`, at the head of the priority.
    """
    from rover_iface.localization.site_frames import Alias, FrameFile, SiteFrames, print_frame_file

    actor.require(Action.READ, mission_id)
    counter = () if site is None else (site,)
    with repo.database.read() as session:
        mission = find_row(session, MISSION, mission_id)
        every = _files(session, mission_id)
        files = [file for file in every if tuple(file.counter) == counter]
        counters = {file.id: tuple(file.counter) for file in every}
        frames = {
            row.id: row for row in session.scalars(select(FrameRow).where(FrameRow.mission_id == mission_id))
        }
        found = [
            (row, solution)
            for row, solution in _solutions(session, mission_id)
            if counters.get(row.file_id or "", _home(frames[row.frame_id])) == counter
        ]
    if not found and not files:
        what = "sites" if site is None else f"rover poses in site {site}"
        raise NotFoundError(f"mission {mission_id} has no {what}")
    records: list[tuple[int, FrameSolution | Alias]] = [(row.position, solution) for row, solution in found]
    records += [
        (alias["position"], Alias(tuple(alias["old"]), tuple(alias["new"])))
        for file in files
        for alias in file.aliases
    ]
    records.sort(key=lambda record: record[0])
    priority = priority_of(files)
    rule = SiteFrames(priority, tuple(solution for _, solution in found))
    extra = []
    for row, solution in found:
        frame = frames[row.frame_id]
        if frame.solution_id != row.id:
            continue
        listed = [s for s in rule.history(solution.frame) if s.solution_id in priority]
        if not listed or rule.in_use(solution.frame) != solution:
            when = (frame.chosen_utc or solution.added_utc).replace(microsecond=0)
            extra.append(replace(solution, solution_id=CHOSEN, added_utc=when))
    if extra:
        priority = (CHOSEN, *(label for label in priority if label != CHOSEN))
    last = files[-1] if files else None
    out = FrameFile(
        last.rover if last is not None else mission.name[:80],
        last.variant if last is not None else ("Master_SVF" if site is None else "Master_RVF"),
        counter,
        priority,
        (*(record for _, record in records), *extra),
    )
    name = f"{out.mission}_master.svf" if site is None else f"{out.mission}_site_{site}_master.rvf"
    return name.replace(" ", "_").lower(), print_frame_file(out).encode()


def _home(frame: FrameRow) -> tuple[int, ...]:
    """Return the counter of the file that a frame's own solutions go into."""
    return () if frame.level == Level.SITE else (frame.site,)
