"""Where every frame lies as seen from one of them, by the solutions in use, and how well that is known.

Each frame but the first has one link: where it lies in its reference, with a covariance where one is known.
From the frame that is held, the anchor, all others follow, up its own references and down to the rest. An
uncertainty is that of a small motion (turn, shift) in the frame's own axes, as in `bundle_adjustment`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import LocalizationError
from rover_iface.frames import Transform
from rover_iface.localization.bundle_adjustment import adjoint
from rover_iface.localization.site_frames import FrameId

Array = npt.NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Link:
    """Where a frame lies in its reference; `covariance` [6, 6] or None where nobody said."""

    reference: FrameId
    reference_from_frame: Transform
    covariance: Array | None = None

    def __post_init__(self) -> None:
        if self.covariance is None:
            return
        given = np.asarray(self.covariance, dtype=float)
        if given.shape != (6, 6) or not np.isfinite(given).all() or np.abs(given - given.T).max() > 1e-9:
            raise LocalizationError(
                f"the covariance of a link to {self.reference} is not a symmetric finite matrix [6, 6]"
            )
        if np.linalg.eigvalsh(given)[0] < -1e-9:
            raise LocalizationError(f"the covariance of a link to {self.reference} has a negative variance")
        object.__setattr__(self, "covariance", given)


@dataclass(frozen=True, eq=False, slots=True)
class Placed:
    """A frame as seen from the anchor.

    Attributes
    ----------
    anchor_from_frame, covariance
        The transform, and [6, 6] of a small motion in the frame's axes.
    unknown
        How many links on the way have no covariance; they count as exact.
    """

    anchor_from_frame: Transform
    covariance: Array
    unknown: int

    def point(
        self, point_frame: npt.ArrayLike, covariance: npt.ArrayLike | None = None
    ) -> tuple[Array, Array]:
        """Return a point [3], m, of the frame and its covariance [3, 3], m^2, in the anchor's axes.

        `covariance` is the point's own in the frame; the frame's comes on top.
        """
        p = np.asarray(point_frame, dtype=float)
        cross = np.array([[0.0, -p[2], p[1]], [p[2], 0.0, -p[0]], [-p[1], p[0], 0.0]])
        jacobian = np.hstack((-cross, np.eye(3)))
        spread = jacobian @ self.covariance @ jacobian.T
        if covariance is not None:
            spread = spread + np.asarray(covariance, dtype=float)
        moved = self.anchor_from_frame
        return np.asarray(moved.apply(p)), np.asarray(moved.covariance(0.5 * (spread + spread.T)))


class AnchoredChain:
    """All frames that hang together with an anchor.

    Parameters
    ----------
    links
        Of each frame; the frame at the head has none.
    anchor
        The frame that is held.

    Raises
    ------
    LocalizationError
        If frames refer to each other in a circle.
    """

    def __init__(self, links: Mapping[FrameId, Link], anchor: FrameId) -> None:
        self.anchor = anchor
        self._links = dict(links)
        self._placed = {anchor: Placed(Transform.identity(), np.zeros((6, 6)), 0)}
        frame = anchor
        while (link := self._links.get(frame)) is not None:
            if link.reference in self._placed:
                raise LocalizationError(f"{link.reference} refers back to itself")
            here = self._placed[frame]
            # (r_from_f exp(d))^-1 = f_from_r exp(-Ad(r_from_f) d)
            turn = adjoint(link.reference_from_frame)
            spread = here.covariance if link.covariance is None else here.covariance + link.covariance
            self._placed[link.reference] = Placed(
                here.anchor_from_frame * link.reference_from_frame.inverse(),
                turn @ spread @ turn.T,
                here.unknown + (link.covariance is None),
            )
            frame = link.reference

    def placed(self, frame: FrameId) -> Placed:
        """Return where a frame lies as seen from the anchor.

        Raises
        ------
        LocalizationError
            If no solution in use ties it to the anchor, or it refers back to itself.
        """
        way: list[FrameId] = []
        at = frame
        while at not in self._placed:
            if at in way:
                raise LocalizationError(f"{at} refers back to itself")
            way.append(at)
            link = self._links.get(at)
            if link is None:
                raise LocalizationError(f"no solution in use ties {frame} to {self.anchor}: {at} has none")
            at = link.reference
        for at in reversed(way):
            link = self._links[at]
            above = self._placed[link.reference]
            back = adjoint(link.reference_from_frame.inverse())
            spread = back @ above.covariance @ back.T
            if link.covariance is not None:
                spread = spread + link.covariance
            self._placed[at] = Placed(
                above.anchor_from_frame * link.reference_from_frame,
                spread,
                above.unknown + (link.covariance is None),
            )
        return self._placed[frame]
