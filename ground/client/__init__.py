"""A client of the REST interface: what the command line and scripts use."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from ground.client.rest import ApiError, Client, ServerUnreachableError

__all__ = ["ApiError", "Client", "ServerUnreachableError"]


def __getattr__(name: str) -> Any:
    """Return a name of `rest` when it is first asked for: commands without a server need no HTTP."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from ground.client import rest

    return getattr(rest, name)
