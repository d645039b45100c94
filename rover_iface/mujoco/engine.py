"""MuJoCo itself, imported when it is needed."""

from __future__ import annotations

from typing import Any

from rover_iface.errors import RoverError


def import_mujoco() -> Any:
    """Return the module `mujoco`.

    Raises
    ------
    RoverError
        If it is not installed.
    """
    try:
        import mujoco
    except ImportError:
        raise RoverError("the rover mujoco needs the package mujoco: pip install 'outcrop[mujoco]'") from None
    return mujoco
