"""Execute a package where the rover is: no database, no network, only the package, a key and a rover."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ground.errors import AlreadyExecutedError, ArchiveError, InvalidInputError
from ground.uplink.flight import Flight, Sample, fly
from ground.uplink.keys import load_public
from ground.uplink.link import Link
from ground.uplink.package import Package, read_package
from ground.uplink.rehearsal import Sent, heard, write_ground_view
from rover_iface.registry import find_rover

LEDGER = "executed.jsonl"
"""In the rover's world: one line for each package it began, so that none is carried out twice."""


INTERRUPTED = "interrupted"
"""In the folder of a run that was taken up again: what the process had written that died."""


@dataclass(frozen=True, slots=True)
class Place:
    """Where a package is executed: name of the rover, its world, the key it trusts, its seed if simulated."""

    rover: str
    world: Path
    trust: Path
    seed: int | None = None


def execute_package(
    package: Path,
    place: Place,
    out: Path,
    *,
    resume: bool = False,
    link: Link | None = None,
    commands: Sequence[Sent] = (),
    on_sample: Callable[[Sample], None] | None = None,
) -> tuple[Package, Flight]:
    """Return what came of a package; its folder `out` has the form `run/1`.

    Everything is checked before the first command: signature, digests, dictionary, sequence number, CRL.

    `resume` goes on with a run whose process died. A simulated rover died with it: it is made anew from its
    seed and led through the same commands; its journal has to repeat the interrupted one record by record.

    With a `link` the run is a rehearsal: `commands` reach the rover late and in passes, and `ground.json` in
    the folder says when each record and product is known on the ground. The executive does not notice.

    Raises
    ------
    ArchiveError
        If the package is damaged, foreign, or made for another dictionary.
    AlreadyExecutedError
        If the rover has begun this package, or one with a later number, before.
    InvalidInputError
        If the output folder is in use, or there is nothing to resume.
    StateError
        If the rover does not repeat what the interrupted journal holds.
    """
    checked = _checked(package, place)
    manifest = checked.manifest
    begun = _begun(place.world / LEDGER, checked)
    if begun is not None and not resume:
        raise AlreadyExecutedError(
            f"package {manifest['sequence']} of {manifest['mission']} was executed before"
        )
    run_id = f"execution-{manifest['sequence']}"
    seed = place.seed
    earlier: list[Any] = []
    if resume:
        if begun is None:
            raise InvalidInputError(
                f"package {manifest['sequence']} of {manifest['mission']} was not begun here: "
                "there is nothing to resume"
            )
        seed = _same_rover(begun, place)
        earlier = _set_aside(out, run_id, str(manifest["crl_sha256"]))
    elif out.exists() and any(out.iterdir()):
        raise InvalidInputError(f"the folder {out} is not empty; give a new one as --out")
    out.mkdir(parents=True, exist_ok=True)
    machine = find_rover(place.rover)(place.world, out=out, **({} if seed is None else {"seed": seed}))
    if begun is None:
        _note(place.world / LEDGER, checked, place)
    about = {
        "kind": "execution",
        "rover": place.rover,
        "seed": seed if seed is not None else 0,
        "faults": [],
        "package_sha256": checked.sha256,
        "mission": manifest["mission"],
        "plan": manifest["plan"],
        "sequence": manifest["sequence"],
    }
    if earlier:
        about["resumed_after_records"] = len(earlier)
    reach = heard(link, commands)
    flight = fly(
        checked.crl_text,
        machine,
        out,
        run_id=run_id,
        about=about,
        on_sample=on_sample,
        repeats=earlier,
        operator=[event for _, event in reach if event is not None],
    )
    if link is not None:
        write_ground_view(out, link, flight, reach)
    return checked, flight


def _checked(package: Path, place: Place) -> Package:
    from executive.crl import CrlError, digest, parse
    from rover_iface.simulator.world import load_world

    checked = read_package(package, load_public(place.trust))
    language = load_world(place.world).profile.language
    manifest = checked.manifest
    wanted = manifest.get("dictionary", {})
    if (wanted.get("name"), wanted.get("version")) != (language.name, language.version):
        raise ArchiveError(
            f"the package is for the command dictionary {wanted.get('name')} {wanted.get('version')}; "
            f"this rover has {language.name} {language.version}"
        )
    try:
        found = digest(parse(checked.crl_text))
    except CrlError as err:
        raise ArchiveError(f"the plan of the package is no CRL: {err}") from err
    if found != manifest.get("crl_sha256"):
        raise ArchiveError("the plan of the package is not the one that was approved (SHA-256 differs)")
    return checked


def _begun(path: Path, package: Package) -> dict[str, Any] | None:
    """Return what the ledger says of a package that was begun here; refuse one that is older than another."""
    mission, sequence = package.manifest["mission"], int(package.manifest["sequence"])
    begun: dict[str, Any] | None = None
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        entry = json.loads(line)
        if entry["sha256"] == package.sha256:
            begun = entry
        elif entry["mission"] == mission and entry["sequence"] >= sequence:
            raise AlreadyExecutedError(
                f"package {sequence} of {mission} is older than package {entry['sequence']}, "
                "which was executed before"
            )
    return begun


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
    """Move what the dead process left out of the way; return the records of its journal."""
    from executive.errors import JournalError
    from executive.runtime.journal import JournalFile

    if (out / "run.json").exists():
        raise InvalidInputError(f"the run in {out} came to its end; there is nothing to resume")
    left = [path for path in out.iterdir() if path.name != INTERRUPTED] if out.is_dir() else []
    journal = out / "journal.jsonl"
    records: list[Any] = []
    if journal.exists():
        try:
            file = JournalFile(journal)
            file.check_identity(run_id=run_id, plan_digest=crl_sha256)
            records = file.records
        except JournalError as err:
            if journal.stat().st_size:  # an empty one, or a torn header: nothing was ever sent
                raise InvalidInputError(f"the run in {out} cannot be resumed: {err}") from err
    number = len(list((out / INTERRUPTED).iterdir())) if (out / INTERRUPTED).is_dir() else 0
    for path in left:
        aside = out / INTERRUPTED / str(number + 1)
        aside.mkdir(parents=True, exist_ok=True)
        path.rename(aside / path.name)
    return records


def _note(path: Path, package: Package, place: Place) -> None:
    entry = {
        "mission": package.manifest["mission"],
        "sequence": int(package.manifest["sequence"]),
        "sha256": package.sha256,
        "rover": place.rover,
        "seed": place.seed,
    }
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")
        file.flush()
        os.fsync(file.fileno())
