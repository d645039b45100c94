"""The files of a rover made of a dictionary: its `dictionary/1` and the profile that names it."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Mapping
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

from executive.crl.dictionary import dictionary_document
from mission.instrument import Instrument
from neighbours.flight.errors import FlightError
from neighbours.flight.flight_map import FlightMap, MappedCommand
from neighbours.flight.import_dictionary import ImportedDictionary, action_name
from rover_iface.profile import RoverProfile, load_profile
from rover_iface.profile.load import PROFILES
from rover_iface.profile.parts import Activity
from rover_iface.profile.rover import ProfileFile


def write_rover(
    name: str, imported: ImportedDictionary, mapped: FlightMap, base: RoverProfile, folder: Path
) -> tuple[Path, Path]:
    """Write `NAME.toml` and `NAME.dictionary.json` into a folder; return their paths.

    Both are written beside each other in a place of their own, read back as a profile, and only then put in
    their place: what is refused leaves nothing behind, and older files as they were.

    Raises
    ------
    ProfileError
        If what was made contradicts itself: the message names the action and the value.
    FlightError
        If `name` is not a plain file name.
    """
    if Path(name).name != name or name.startswith(".") or not name:
        raise FlightError(f'the name of the rover is "{name}"; it must be a plain file name')
    dictionary = f"{name}.dictionary.json"
    profile = _profile(name, dictionary, imported, mapped, base)
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory(dir=folder, prefix=".making-") as scratch:
        made = Path(scratch)
        document = dictionary_document(imported.dictionary)
        (made / dictionary).write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        (made / f"{name}.toml").write_text(_toml(PROFILES.document(profile)), encoding="utf-8")
        load_profile(made / f"{name}.toml")
        for file in (dictionary, f"{name}.toml"):
            (made / file).replace(folder / file)
    return folder / f"{name}.toml", folder / dictionary


def _profile(
    name: str, dictionary: str, imported: ImportedDictionary, mapped: FlightMap, base: RoverProfile
) -> ProfileFile:
    members = {f.name: getattr(base, f.name) for f in fields(ProfileFile)}
    activities = dict(base.activities)
    by_action = {action_name(command): costs for command, costs in mapped.commands.items()}
    for action in imported.commands:
        cost = by_action.get(action, MappedCommand())
        time_s = mapped.default.time_s if cost.time_s is None else cost.time_s
        energy_j = mapped.default.energy_j if cost.energy_j is None else cost.energy_j
        activities[action] = Activity(fixed_s=time_s, fixed_j=energy_j)
    members |= {
        "name": name,
        "doc": f"{imported.dictionary.doc} Body and activities of {base.name}.",
        "dictionary": dictionary,
        "activities": activities,
        "instruments": {**base.instruments, **_instruments(mapped)},
        "cameras": replace(base.cameras, set=base.camera_set or base.cameras.set),
    }
    return ProfileFile(**members)


def _instruments(mapped: FlightMap) -> dict[str, Instrument]:
    return {
        name: replace(figures, action=action_name(figures.action))
        for name, figures in mapped.instruments.items()
    }


def _toml(document: Mapping[str, Any]) -> str:
    """Return a document of plain JSON types as TOML; members that are null are left out."""
    lines: list[str] = []
    _table(document, (), lines)
    return "\n".join(lines) + "\n"


def _table(table: Mapping[str, Any], way: tuple[str, ...], lines: list[str]) -> None:
    inner = {key: item for key, item in table.items() if isinstance(item, Mapping)}
    for key, item in table.items():
        if item is not None and key not in inner:
            lines.append(f"{json.dumps(key)} = {_value(item)}")
    for key, item in inner.items():
        lines += ["", f"[{'.'.join(json.dumps(part) for part in (*way, key))}]"]
        _table(item, (*way, key), lines)


def _value(item: Any) -> str:
    if isinstance(item, list):
        return f"[{', '.join(_value(part) for part in item)}]"
    return json.dumps(item, ensure_ascii=False)
