"""Feature tracking on the way, shape registration at the end: the combined tracker of K9.

Deans, Kunz, Sargent and others 2005: the feature tracker carries targets through the traverse; at its end the
surface seen then is registered with one seen earlier, in which the target was designated, so that what the
features drifted does not matter, and a target that they lost is found again if dead reckoning is within half
a rock. The pair at the end may be another one (hazcams): then this is the hand-off by registration.

The surface of the first view is kept, and one more each time the range has come down by a third while the
target is tracked: at ten metres a stereo surface is too rough to register a centimetre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.handoff import Side
from rover_iface.vision.shape import Registration, ShapeOptions
from rover_iface.vision.shape_draped import register_views
from rover_iface.vision.sift import SiftOptions, SiftTracker
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate

CLOSER = 1.5


@dataclass(frozen=True, eq=False)
class _Model:
    """A pair with the target in view, in the frame as it was believed then."""

    side: Side
    point: Array
    covariance: Array
    range_m: float


class CombinedTracker:
    """A `Tracker` whose `settle` registers the last view with earlier ones.

    Until then it answers as the feature tracker does. `settle` answers with the better known of the tracked
    and the registered position; its confidence is 0.9 for an accepted registration that agrees with the
    features or has none to agree with, 0.4 (lost) where the two contradict each other.
    """

    def __init__(self, options: SiftOptions | None = None, shape: ShapeOptions | None = None) -> None:
        self.features = SiftTracker(options)
        self.shape = shape or ShapeOptions()
        self._models: dict[str, list[_Model]] = {}
        self._latest: dict[str, TrackUpdate] = {}

    @property
    def targets(self) -> tuple[str, ...]:
        """Return what is followed."""
        return self.features.targets

    def start(
        self,
        target: str,
        position: npt.ArrayLike | None,
        view: StereoView,
        *,
        pixel: npt.ArrayLike | None = None,
    ) -> TrackUpdate:
        """Begin to follow a surface point, given as position (3,) or as pixel (2,) of the left image."""
        update = self.features.start(target, position, view, pixel=pixel)
        self._models[target] = []
        self._keep(update, view)
        self._latest[target] = update
        return update

    def update(self, target: str, view: StereoView) -> TrackUpdate:
        """Find the target again after a move, by features."""
        update = self.features.update(target, view)
        if update.state is TrackState.TRACKED:
            models = self._models[target]
            distance = float(np.linalg.norm(update.position - view.left_camera.C))
            if not models or distance < models[-1].range_m / CLOSER:
                self._keep(update, view)
        self._latest[target] = update
        return update

    def predicted(self, target: str) -> Array:
        """Return where the target is believed to be (3,)."""
        return self.features.predicted(target)

    def clear(self, target: str) -> None:
        """Forget a target."""
        self.features.clear(target)
        del self._models[target], self._latest[target]

    def settle(
        self, target: str, view: StereoView, *, nearest_m: float = 0.3
    ) -> tuple[TrackUpdate, Registration | None]:
        """Return the target in a last view by registration, and the registration that was believed.

        The nearest model is tried first, then those before it. Without an accepted one the answer is the
        features' last, with the reasons of the refusals.

        Raises
        ------
        TrackerError
            If the target is not followed.
        """
        if target not in self._latest:
            raise TrackerError(
                f'target "{target}" is not followed; followed: {", ".join(self.targets) or "none"}'
            )
        before = self._latest[target]
        scene = Side(view, nearest_m)
        reasons: list[str] = []
        if scene.surface is None:
            return replace(before, reasons=(*before.reasons, "the pair gives no surface")), None
        for model in reversed(self._models[target]):
            # dead reckoning says that nothing moves in the site frame; the features may know better
            guess = Transform(np.eye(3), before.position - model.point)
            found = register_views(model.side, scene, guess, model.point, self.shape)
            if not found.accepted:
                reasons += [f"registration with {model.range_m:.1f} m: {why}" for why in found.reasons]
                continue
            return self._joined(before, model, found, view), found
        return replace(before, reasons=(*before.reasons, *reasons)), None

    def _joined(
        self, before: TrackUpdate, model: _Model, found: Registration, view: StereoView
    ) -> TrackUpdate:
        motion = found.scene_from_model
        position = np.asarray(motion.apply(model.point), dtype=np.float64)
        covariance = np.asarray(motion.covariance(model.covariance) + found.covariance(), dtype=np.float64)
        confidence, reasons = 0.9, ()
        if before.state is TrackState.TRACKED:
            gap = position - before.position
            sigma = float(np.sqrt(gap @ np.linalg.solve(covariance + before.covariance, gap)))
            if sigma > 5.0:
                far = 100 * float(np.linalg.norm(gap))
                return replace(
                    before,
                    state=TrackState.LOST,
                    confidence=0.4,
                    reasons=(f"registration and features are {far:.1f} cm apart, {sigma:.1f} sigma",),
                )
            if np.trace(before.covariance) < np.trace(covariance):
                position, covariance = before.position, before.covariance
        return TrackUpdate(
            target=before.target,
            state=TrackState.TRACKED,
            position=position,
            covariance=covariance,
            confidence=confidence,
            pixel=np.asarray(view.left_camera.project(position)),
            reasons=reasons,
            scores={"overlap": found.overlap, "deviation_m": found.deviation_m, "spread_m": found.spread_m},
        )

    def _keep(self, update: TrackUpdate, view: StereoView) -> None:
        distance = float(np.linalg.norm(update.position - view.left_camera.C))
        self._models[update.target].append(
            _Model(Side(view, 0.6), update.position, update.covariance, distance)
        )
