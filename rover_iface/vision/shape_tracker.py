"""Feature tracking on the way, shape registration at the end: the combined tracker of K9.

Deans, Kunz, Sargent and others 2005: the feature tracker carries targets through the traverse; at its end the
surface seen then is registered with one seen earlier, in which the target was designated, so that what the
features drifted does not matter, and a target that they lost is found again if dead reckoning is within half
a rock. The pair at the end may be another one (hazcams): then this is the hand-off by registration.

The surface of the first view is kept, and one more each time the range has come down by a third while the
target is tracked: at ten metres a stereo surface is too rough to register a centimetre.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import TrackerError
from rover_iface.frames import Transform
from rover_iface.vision.handoff import Handoff, Side
from rover_iface.vision.handoff_cascade import cascade
from rover_iface.vision.narrow_range import NarrowSight
from rover_iface.vision.shape import Registration
from rover_iface.vision.shape_draped import register_views
from rover_iface.vision.sift import SiftOptions, SiftTracker
from rover_iface.vision.surface import ShapeOptions
from rover_iface.vision.tracker import StereoView, TrackState, TrackUpdate

CLOSER = 1.5
RECALL_M, ASTRAY_M, LOST_M = 3.4, 0.10, 0.50
"""From how near the first narrow picture is asked; how far off it may have a tracked or a lost target."""
MOST_OPEN_M = 0.01
"""What a registration may leave open of the target's place: more is not a centimetre."""


@dataclass(frozen=True, eq=False)
class _Model:
    """A pair with the target in view, in the frame as it was believed then."""

    side: Side
    point: Array
    covariance: Array
    range_m: float


@dataclass(eq=False)
class _First:
    """The narrow pair of the first stop, the target's pixel in it, and where the track began.

    `recalled_m` is from how near it has been found again.
    """

    side: Side
    pixel: Array
    point: Array
    recalled_m: float = math.inf


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
        self._firsts: dict[str, _First] = {}

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
        narrow: NarrowSight | None = None,
    ) -> TrackUpdate:
        """Begin to follow a surface point, given as position (3,) or as pixel (2,) of the left image.

        `narrow` is the same point as a narrow pair sees it from here: it ranges better, and is what `recall`
        goes back to.

        Position in the frame of the view's cameras, m; pixels as (sample, line).
        """
        known = None if narrow is None else narrow.known
        update = self.features.start(target, position, view, pixel=pixel, known=known)
        self._models[target] = []
        self._firsts.pop(target, None)
        if narrow is not None:
            self._firsts[target] = _First(Side(narrow.view, 0.6), narrow.pixel, update.position)
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
        self._firsts.pop(target, None)

    def remembers(self, target: str) -> bool:
        """Return whether a first narrow picture of a target is kept."""
        return target in self._firsts

    def recall(self, target: str, view: StereoView) -> TrackUpdate | None:
        """Return the target as its first narrow picture has it in this view, None where that tells nothing.

        Features drift, and from ten metres a template of the target is mostly its rock's outline, which moves
        as the rover goes round. The narrow picture shows its surface as finely as the navcams do from a third
        of the distance: draped over what they range there, it finds the designated pixel itself, with the
        cascade's own tests. The track goes on from what it says. It is tried once the target is near enough,
        and again each time it has come nearer by a quarter.
        """
        first, before = self._firsts.get(target), self._latest.get(target)
        if first is None or before is None:
            return None
        away = float(np.linalg.norm(before.position - view.left_camera.C))
        if away > min(RECALL_M, 0.75 * first.recalled_m):
            return None
        guess = Transform(np.eye(3), before.position - first.point)
        scene = Side(view, 0.6)
        answer = cascade(Handoff(scene, first.side.moved(guess), first.pixel), "near")
        tracked = before.state is TrackState.TRACKED
        if not answer.accepted:
            return None
        if float(np.linalg.norm(answer.position - before.position)) > (ASTRAY_M if tracked else LOST_M):
            return None
        try:
            update = self.features.restart(target, view, answer.pixel, answer.position, answer.error_px)
        except TrackerError:
            return None
        first.recalled_m = away
        self._models[target] = []
        self._keep(update, view)
        self._latest[target] = update
        return update

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
            why = found.reasons
            if found.accepted and found.spread_m > MOST_OPEN_M:
                limit = 100 * MOST_OPEN_M
                why = (f"it leaves {100 * found.spread_m:.1f} cm open; {limit:g} cm is the limit",)
            if why:
                reasons += [f"registration with {model.range_m:.1f} m: {told}" for told in why]
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
