"""The profiles that come with the program, by name: `rover_iface.profiles.k9` is the path of its file."""

from __future__ import annotations

from pathlib import Path

FOLDER = Path(__file__).parent


def __getattr__(name: str) -> Path:
    path = FOLDER / f"{name}.toml"
    if not path.is_file():
        raise AttributeError(f"there is no profile {name}")
    return path
