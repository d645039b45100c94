"""Packages that come with an extra: what to say when one is not installed."""

from __future__ import annotations

EXTRAS = {
    "authlib": "oidc",
    "cv2": "vision",
    "distributed": "cluster",
    "embreex": "vision",
    "foxglove": "mcap",
    "gtsam": "vision",
    "matplotlib": "plots",
    "mcap": "mcap",
    "mcp": "assistant",
    "mujoco": "mujoco",
    "opentelemetry": "otel",
    "psycopg": "postgres",
    "pyogrio": "geo",
    "pyproj": "geo",
    "rosbags": "mcap",
    "s3fs": "objects",
    "small_gicp": "vision",
    "spiceypy": "geo",
    "unified_planning": "formats",
    "yaml": "ros2",
}
"""By the name under which a package is imported."""


def missing_extra(error: ModuleNotFoundError) -> str | None:
    """Return what to say of a package that is missing; None if no extra holds it, a fault of ours."""
    package = (error.name or "").partition(".")[0]
    return f"this needs {how_to_get(package)}" if package in EXTRAS else None


def how_to_get(package: str) -> str:
    """Return a package of an extra and the command that installs it."""
    return f"the package {package}, which is not installed: pip install 'outcrop[{EXTRAS[package]}]'"
