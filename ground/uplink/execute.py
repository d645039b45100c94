"""Execute a package where the rover is: no database, no network, only the package, a key and a rover."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from executive.ports import Command, CommandId, CommandStatus, Event, Rover
from ground.errors import InvalidInputError
from ground.uplink.admission import Admitted, admitted, check_plan, utc_now
from ground.uplink.flight import Flight, Sample, fly
from ground.uplink.ledger import Ledger
from ground.uplink.link import Link
from ground.uplink.rehearsal import Sent, heard, write_ground_view
from ground.uplink.verify import Package
from rover_iface.registry import find_rover

INTERRUPTED = "interrupted"
"""In the folder of a run that was taken up again: what the process had written that died."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a package is executed: name of the rover, its world, its trust file, its seed if simulated."""

    rover: str
    world: Path
    trust: Path
    seed: int | None = None
    training: bool = False
    """The rover is a mission's training rover, and its run says so."""


def execute_package(
    package: Path,
    place: Place,
    out: Path,
    *,
    resume: bool = False,
    link: Link | None = None,
    commands: Sequence[Sent] = (),
    on_sample: Callable[[Sample], None] | None = None,
    on_repair: Callable[[str], None] = lambda _what: None,
    clock: Callable[[], datetime] = utc_now,
    prepare: Callable[[Ledger], None] = lambda _ledger: None,
) -> tuple[Package, Flight]:
    """Return what came of a package; its folder `out` has the form `run/1`.

    Everything is checked before the first command: the signatures of enough people by the trust file,
    digests, expiry, dictionary, counter, CRL. The ledger of the rover is held by one execution at a time, and
    is marked before the first command leaves: from then on the package is begun, for good.

    `resume` goes on with a run whose process died. A simulated rover died with it: it is made anew from its
    seed and led through the same commands; its journal has to repeat the interrupted one record by record.

    With a `link` the run is a rehearsal: `commands` reach the rover late and in passes, and `ground.json` in
    the folder says when each record and product is known on the ground. The executive does not notice.
    `on_repair` is told in a sentence when the ledger was damaged and could be mended. `prepare` writes trust
    file and world where they are made for this execution: the ledger is held by then.

    Raises
    ------
    ArchiveError
        If the package is damaged, foreign, expired, signed by too few, or made for another dictionary.
    AlreadyExecutedError
        If the rover has begun this package, or one with a later counter, before, or is busy.
    InvalidInputError
        If the output folder is in use, there is nothing to resume, or the journal of a run that was begun is
        gone.
    StateError
        If the rover does not repeat what the interrupted journal holds.
    """

    def check(opened: Package) -> None:
        from rover_iface.simulator.world import load_world

        language = load_world(place.world).profile.language
        check_plan(opened, (language.name, language.version, language.sha256))

    with admitted(
        package,
        place.world,
        place.trust,
        check=check,
        resume=resume,
        on_repair=on_repair,
        clock=clock,
        prepare=prepare,
    ) as given:
        if resume and given.earlier is None:
            raise InvalidInputError(f"{given.name} was not begun here: there is nothing to resume")
        return given.package, _run(given, place, out, link, commands, on_sample)


def _run(
    given: Admitted,
    place: Place,
    out: Path,
    link: Link | None,
    commands: Sequence[Sent],
    on_sample: Callable[[Sample], None] | None,
) -> Flight:
    package, earlier = given.package, given.earlier
    run_id = f"execution-{package.counter}"
    seed = place.seed if earlier is None else _same_rover(earlier, place)
    records: list[Any] = []
    if earlier is not None:
        records = _set_aside(out, run_id, str(package.manifest["crl_sha256"]))
    elif out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise InvalidInputError(f"{out} is a file or a folder in use; give a new one as --out")
    out.mkdir(parents=True, exist_ok=True)
    rover = find_rover(place.rover)(place.world, out=out, **({} if seed is None else {"seed": seed}))
    entry = given.entry(place.rover, place.seed)
    marking = _Marking(rover, (lambda: given.ledger.append(entry)) if earlier is None else None)
    about = {
        "kind": "execution",
        "rover": place.rover,
        "seed": seed if seed is not None else 0,
        "faults": [],
        "package_sha256": package.sha256,
        "mission": package.mission,
        "plan": package.manifest["plan"],
        "sequence": package.counter,
        "signers": {role: list(people) for role, people in package.signers.items()},
    }
    if place.training:
        about["training"] = True
    if records:
        about["resumed_after_records"] = len(records)
    reach = heard(link, commands)
    flight = fly(
        package.crl_text,
        marking,
        out,
        run_id=run_id,
        about=about,
        on_sample=on_sample,
        repeats=records,
        operator=[event for _, event in reach if event is not None],
    )
    marking.mark()  # a plan without a command was executed, too
    if link is not None:
        write_ground_view(out, link, flight, reach)
    return flight


class _Marking:
    """A rover before whose first command the ledger is marked."""

    def __init__(self, rover: Rover, mark: Callable[[], None] | None) -> None:
        self._rover, self._mark = rover, mark

    def mark(self) -> None:
        if self._mark is not None:
            self._mark()
            self._mark = None

    def send(self, command: Command) -> None:
        self.mark()
        self._rover.send(command)

    def abort(self, command: CommandId) -> None:
        self.mark()
        self._rover.abort(command)

    def status(self, command: CommandId) -> CommandStatus:
        return self._rover.status(command)

    def next_event(self, until_ms: int | None) -> Event | None:
        return self._rover.next_event(until_ms)


def _same_rover(begun: Mapping[str, Any], place: Place) -> int | None:
    """Return the seed the run was begun with; refuse to go on with another rover or seed."""
    seed: int | None = begun.get("seed")
    if begun.get("rover", place.rover) != place.rover or (place.seed is not None and place.seed != seed):
        raise InvalidInputError(
            f"the run was begun with the rover {begun.get('rover')!r} and the seed {seed}; "
            f"it cannot go on with {place.rover!r} and {place.seed}"
        )
    return seed


def _set_aside(out: Path, run_id: str, crl_sha256: str) -> list[Any]:
    """Move what the dead process left out of the way; return the records of its journal.

    The ledger was marked after the journal had its header, so a journal that is gone or empty is damage: what
    the rover was told is not known, and the run is not begun anew.
    """
    from executive.errors import JournalError
    from executive.runtime.journal import JournalFile

    if (out / "run.json").exists():
        raise InvalidInputError(f"the run in {out} came to its end; there is nothing to resume")
    aside = sorted(
        out.glob(f"{INTERRUPTED}/*/journal.jsonl")
    )  # a resumed run may have died while it repeated
    records: list[Any] = []
    complaint = (
        f"the run in {out} cannot be resumed: its journal is gone, and what the rover was told with it"
    )
    for path in [out / "journal.jsonl", *aside]:
        try:
            file = JournalFile(path)
            file.check_identity(run_id=run_id, plan_digest=crl_sha256)
            records = max(records, file.records, key=len)
        except JournalError as err:
            complaint = f"the run in {out} cannot be resumed: {err}" if path.exists() else complaint
    if not records:
        raise InvalidInputError(complaint)
    number = len(list((out / INTERRUPTED).iterdir())) if (out / INTERRUPTED).is_dir() else 0
    for path in [path for path in out.iterdir() if path.name != INTERRUPTED]:
        target = out / INTERRUPTED / str(number + 1)
        target.mkdir(parents=True, exist_ok=True)
        path.rename(target / path.name)
    return records
