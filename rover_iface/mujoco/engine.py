"""MuJoCo itself, imported when it is needed."""

from __future__ import annotations

from typing import Any

from rover_iface.extras import require_packages


def import_mujoco() -> Any:
    """Return the module `mujoco`.

    Raises
    ------
    MissingExtraError
        If it is not installed.
    """
    require_packages("the rover mujoco", "mujoco", ("mujoco",))
    import mujoco

    return mujoco
