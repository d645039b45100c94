"""Profiles by name or from a file, with their dictionaries.

A name is looked for in the operator's own folder (the variable `OUTCROP_PROFILES`), then among installed
packages (entry point group `outcrop.profiles`, a path of a file), then among those of the program.
"""

from __future__ import annotations

import hashlib
import os
import tomllib
from dataclasses import fields
from functools import cache, lru_cache
from pathlib import Path

from executive.crl.dictionary import Dictionary
from executive.crl.errors import DictionaryError
from mission.codec import Codec, read_toml
from mission.errors import PluginError
from mission.plugins import Registry
from rover_iface import profiles
from rover_iface.errors import ProfileError
from rover_iface.profile.consistency import contradiction
from rover_iface.profile.dictionary import dictionary_file
from rover_iface.profile.old_versions import of_version_1
from rover_iface.profile.rover import ProfileFile, RoverProfile

PROFILES = Codec(
    ProfileFile,
    "profile/2",
    "rover profile",
    upgrades={"profile/1": ("profile/2", of_version_1)},
    error=ProfileError,
)
"""Reads the members of a profile; `load_profile` adds its dictionary."""

_NAMED = Registry(
    "rover profile",
    "outcrop.profiles",
    {path.stem: f"rover_iface.profiles:{path.stem}" for path in profiles.FOLDER.glob("*.toml")},
)


OWN_FOLDER = "OUTCROP_PROFILES"
"""Variable that names the operator's own folder of profiles; a process that does a job inherits it."""


def profile_names() -> list[str]:
    """Return the names of all profiles: the operator's own, those of installed packages and the program's.

    Raises
    ------
    ProfileError
        If the operator's own folder is none.
    """
    folder = _own_folder()
    own = () if folder is None else (path.stem for path in folder.glob("*.toml") if _claims_profile(path))
    return sorted({*_NAMED.names(), *own})


def _own_folder() -> Path | None:
    named = os.environ.get(OWN_FOLDER)
    if not named:
        return None
    folder = Path(named)
    if not folder.is_dir():
        raise ProfileError(f"{OWN_FOLDER} is {named}, which is not a folder; it holds rover profiles")
    return folder


def _claims_profile(path: Path) -> bool:
    """Return whether a TOML file is to be a profile; a broken one is, so that whoever asks for it is told."""
    try:
        document = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):
        return True
    return str(document.get("format")).startswith("profile/")


def load_profile(source: str | Path) -> RoverProfile:
    """Return a profile by name (`k9`, `mer`) or from a TOML file.

    Raises
    ------
    ProfileError
        If the name is unknown or its package cannot be imported, the file is not TOML, a member is missing,
        unknown or out of range, or profile and dictionary contradict each other.
    """
    if isinstance(source, str) and not source.endswith(".toml"):
        path = _own(source) or _named(source)
    else:
        path = Path(source)
    try:
        raw = path.read_bytes()
    except OSError as err:
        raise ProfileError(f"rover profile {path}: {err.strerror or err}") from err
    return _parse(raw, str(path))


def _own(name: str) -> Path | None:
    """Return the file of a profile in the operator's own folder, if it has one of that name."""
    folder = _own_folder()
    if folder is None or Path(name).name != name:
        return None
    path = folder / f"{name}.toml"
    return path.resolve() if path.is_file() else None


@cache
def _named(name: str) -> Path:
    """Return the file of a profile that has a name; looking through what is installed takes milliseconds."""
    try:
        found = _NAMED.load(name)
    except PluginError as err:
        known = f"; known are {', '.join(profile_names())}" if name not in _NAMED else ""
        raise ProfileError(str(err).partition("; known are")[0] + known) from err
    if not isinstance(found, str | Path):
        raise ProfileError(f'rover profile "{name}" is {found!r}; the path of a TOML file is needed')
    return Path(found)


def _parse(raw: bytes, path: str) -> RoverProfile:
    """Return a profile; its dictionary is read each time, as it may change without the profile."""
    read = _read(raw, path)
    try:
        language = dictionary_file(_beside(path, read.dictionary))
    except DictionaryError as err:
        raise ProfileError(f"rover profile {path}: dictionary is {read.dictionary!r}: {err}") from err
    return _whole(raw, path, language)


@lru_cache(maxsize=32)
def _read(raw: bytes, path: str) -> ProfileFile:
    where = f"rover profile {path}"
    return PROFILES.from_document(read_toml(raw, where, ProfileError), where)


@lru_cache(maxsize=32)
def _whole(raw: bytes, path: str, language: Dictionary) -> RoverProfile:
    read = _read(raw, path)
    wrong = contradiction(read, language)
    if wrong:
        raise ProfileError(f"rover profile {path}: dictionary {language.name} {language.version}: {wrong}")
    members = {f.name: getattr(read, f.name) for f in fields(read)}
    return RoverProfile(
        **members,
        sha256=hashlib.sha256(raw).hexdigest(),
        camera_set=_beside(path, read.cameras.set),
        language=language,
    )


def _beside(path: str, name: str) -> str:
    """Return a name as it is, a file's as it lies beside the profile."""
    return str(Path(path).parent / name) if name.endswith((".toml", ".json")) else name
