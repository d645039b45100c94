"""What the API takes for who looks at a mission."""

from __future__ import annotations

from typing import Literal

from ground.records.forms import Body, Id
from ground.records.lookers import Selected


class SelectedBody(Body):
    kind: Literal["target", "observation_request", "keep_out", "product", "plan", "run"]
    id: Id


class PresenceBody(Body):
    """Somebody looks at the mission, and has this selected there."""

    selected: SelectedBody | None = None

    def value(self) -> Selected | None:
        """Return what is selected."""
        return None if self.selected is None else Selected(self.selected.kind, self.selected.id)
