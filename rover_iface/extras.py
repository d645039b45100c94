"""Packages of an extra, asked for before a rover that cannot do without them begins its day."""

from __future__ import annotations

from importlib.util import find_spec

from rover_iface.errors import MissingExtraError

VISION = ("cv2", "embreex", "small_gicp")


def require_packages(who: str, extra: str, packages: tuple[str, ...]) -> None:
    """Raise unless the packages of an extra are installed.

    Raises
    ------
    MissingExtraError
        If one is not; the message says how to get it.
    """
    for package in packages:
        if find_spec(package) is None:
            raise MissingExtraError(f"{who} needs the package {package}: pip install 'outcrop[{extra}]'")
