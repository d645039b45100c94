"""The browser UI; this Python side only says where the built files lie."""

from pathlib import Path

DIST = Path(__file__).parent / "dist"
"""Folder of the built UI; absent in a checkout whose UI was not built yet."""

__all__ = ["DIST"]
