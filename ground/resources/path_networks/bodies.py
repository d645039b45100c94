"""What the API takes for path networks."""

from __future__ import annotations

from ground.records.forms import Body, Id


class PathNetworkCreate(Body):
    """Compute the path network from the mission as it stands."""

    sol_id: Id | None = None
