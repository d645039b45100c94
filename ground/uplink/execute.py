"""Execute a package where the rover is: no database, no network, only the package, a key and a rover."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path

from ground.errors import AlreadyExecutedError, ArchiveError, InvalidInputError
from ground.flight import Flight, Sample, fly
from ground.uplink.keys import load_public
from ground.uplink.package import Package, read_package
from rover_iface.registry import find_rover

LEDGER = "executed.jsonl"
"""In the rover's world: one line for each package it began, so that none is carried out twice."""


def execute_package(
    package: Path,
    *,
    rover: str,
    world: Path,
    trust: Path,
    out: Path,
    seed: int | None = None,
    on_sample: Callable[[Sample], None] | None = None,
) -> tuple[Package, Flight]:
    """Return what came of a package; its folder `out` has the form `run/1`.

    Everything is checked before the first command: signature, digests, dictionary, sequence number, CRL.

    Raises
    ------
    ArchiveError
        If the package is damaged, foreign, or made for another dictionary.
    AlreadyExecutedError
        If the rover has begun this package, or one with a later number, before.
    InvalidInputError
        If the output folder is in use.
    """
    from executive.crl import CrlError, digest, parse
    from rover_iface.commands import COMMANDS

    checked = read_package(package, load_public(trust))
    manifest = checked.manifest
    wanted = manifest.get("dictionary", {})
    if (wanted.get("name"), wanted.get("version")) != (COMMANDS.name, COMMANDS.version):
        raise ArchiveError(
            f"the package is for the command dictionary {wanted.get('name')} {wanted.get('version')}; "
            f"this rover has {COMMANDS.name} {COMMANDS.version}"
        )
    try:
        found = digest(parse(checked.crl_text))
    except CrlError as err:
        raise ArchiveError(f"the plan of the package is no CRL: {err}") from err
    if found != manifest.get("crl_sha256"):
        raise ArchiveError("the plan of the package is not the one that was approved (SHA-256 differs)")
    _check_ledger(world / LEDGER, checked)
    if out.exists() and any(out.iterdir()):
        raise InvalidInputError(f"the folder {out} is not empty; give a new one as --out")
    out.mkdir(parents=True, exist_ok=True)
    machine = find_rover(rover)(world, out=out, **({} if seed is None else {"seed": seed}))
    _note(world / LEDGER, checked)
    about = {
        "kind": "execution",
        "rover": rover,
        "seed": seed if seed is not None else 0,
        "faults": [],
        "package_sha256": checked.sha256,
        "mission": manifest["mission"],
        "plan": manifest["plan"],
        "sequence": manifest["sequence"],
    }
    run_id = f"execution-{manifest['sequence']}"
    return checked, fly(checked.crl_text, machine, out, run_id=run_id, about=about, on_sample=on_sample)


def _check_ledger(path: Path, package: Package) -> None:
    mission, sequence = package.manifest["mission"], int(package.manifest["sequence"])
    for line in path.read_text(encoding="utf-8").splitlines() if path.exists() else []:
        entry = json.loads(line)
        if entry["sha256"] == package.sha256:
            raise AlreadyExecutedError(f"package {sequence} of {mission} was executed before")
        if entry["mission"] == mission and entry["sequence"] >= sequence:
            raise AlreadyExecutedError(
                f"package {sequence} of {mission} is older than package {entry['sequence']}, "
                "which was executed before"
            )


def _note(path: Path, package: Package) -> None:
    entry = {
        "mission": package.manifest["mission"],
        "sequence": int(package.manifest["sequence"]),
        "sha256": package.sha256,
    }
    with path.open("a", encoding="utf-8") as file:
        file.write(json.dumps(entry) + "\n")
