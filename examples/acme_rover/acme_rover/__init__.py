"""A stranger's rover: a profile and a dictionary as data, one tracker, one constraint, one rover."""

from __future__ import annotations

from pathlib import Path

PROFILE = Path(__file__).with_name("acme.toml")
