"""Profiles of older versions, brought up to date."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from rover_iface.profile.dictionary import standard_dictionary

_CAMERAS = Path(__file__).parents[1] / "cameras" / "data"

_LEG_MODEL_OF_1 = {
    "source": "Kim et al. 2009, Table II; outside and occluded rates and the angle gain assumed",
    "turn_factor": 1.0,
    "slope_gain": 1.0,
    "energy_factor": 1.0,
    "inside_per_m": 0.0048,
    "outside_per_m": 0.05,
    "occluded_per_m": 0.15,
    "angle_gain_per_rad": 1.0,
}


def of_version_1(members: dict[str, Any]) -> dict[str, Any]:
    """Bring a `profile/1` document up to date.

    There an instrument's use was its `kind`, the repository called `mi` and `scicam` of any rover by the
    names below, what the arm placed looked through the camera `mi`, a rover without a camera set of its name
    had K9's, every rover had the leg model below, and an activity that was not listed took no time.
    """
    known_as = {"mi": "microscopic_imager", "scicam": "science_camera"}
    tables = members.get("instruments")
    if isinstance(tables, dict):
        members["instruments"] = {name: _instrument_of_1(table) for name, table in tables.items()}
        for name, alias in known_as.items():
            if isinstance(members["instruments"].get(name), dict):
                members["instruments"][name].setdefault("alias", alias)
    cameras = members.get("cameras")
    if isinstance(cameras, dict):
        name = str(members.get("name"))
        cameras.setdefault("set", name if (_CAMERAS / f"{name}.toml").is_file() else "k9")
    members.setdefault("leg_model", dict(_LEG_MODEL_OF_1))
    if isinstance(members.get("activities"), dict):
        for action in standard_dictionary().commands.actions.values():
            if action.activity:
                members["activities"].setdefault(action.activity, {})
    return members


def _instrument_of_1(table: Any) -> Any:
    if not isinstance(table, dict) or "kind" not in table:
        return table
    use = {"use": table["kind"], **{name: item for name, item in table.items() if name != "kind"}}
    return {"camera": "mi", **use} if table["kind"] == "contact" else use
