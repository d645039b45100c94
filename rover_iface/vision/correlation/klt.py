"""A tracker by optical flow of the corners round a target: Lucas-Kanade pyramids, checked there and back.

Corners round the target in the picture of the last stop are followed into the new one and back again. Those
that do not return to where they began are left out (Kalal, Mikolajczyk and Matas 2010, "Forward-backward
error"); of the others a similarity is taken by RANSAC, and it carries the target's own pixel over. Start,
ranging by stereo, the limits of range and position, and what a loss is are those of the correlation tracker.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.cameras.model import Array
from rover_iface.errors import TrackerError
from rover_iface.vision.correlation.judging import Followed, Judgement
from rover_iface.vision.correlation.ncc import Drift, NccTracker
from rover_iface.vision.template import NccOptions, grown_drift, template_scale
from rover_iface.vision.tracker import Image, StereoView

_Spots = npt.NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class FlowOptions:
    """Parameters of the flow, pixels: the best of five sets on nine approaches (generated terrain, seeds
    901, 902 and 904).

    Attributes
    ----------
    radius_px
        Half side of the square round the target in which corners are taken; of a far rock no more.
    corners, apart_px, quality
        How many at most, how far from each other, and their least strength as a share of the strongest.
    window_px, levels
        Of the flow, and how often the picture is halved: together what the prediction may be off.
    back_px
        A corner that comes back farther from where it began is not believed.
    fit_px
        A corner farther than this from what the similarity says moved by itself.
    least, least_share
        Corners that must be left, and their share of those that were found.
    """

    radius_px: int = 24
    corners: int = 80
    apart_px: float = 4.0
    quality: float = 0.01
    window_px: int = 21
    levels: int = 4
    back_px: float = 1.0
    fit_px: float = 1.5
    least: int = 6
    least_share: float = 0.25

    def __post_init__(self) -> None:
        if self.radius_px < 8 or self.window_px < 5:
            raise TrackerError(
                f"corners are taken within {self.radius_px} px and followed in windows of "
                f"{self.window_px} px; at least 8 and 5 are needed"
            )
        if not (4 <= self.least <= self.corners and 0.0 < self.least_share < 1.0):
            raise TrackerError(
                f"of {self.corners} corners {self.least} and a share of {self.least_share} must be left; at "
                "least 4 and no more than there are, and a share between 0 and 1, are needed"
            )


class KltTracker(NccTracker):
    """Follows targets by optical flow (a `Tracker`).

    The confidence is the least margin of share of corners left, fit, stereo score and range, through the
    logistic curve of the correlation tracker: 0.5 is the limit of a loss. It is not calibrated: it is not
    a probability, and no table says how often a target of confidence 0.9 is right.
    """

    def __init__(self, options: NccOptions | None = None, flow: FlowOptions | None = None) -> None:
        super().__init__(options)
        self.flow = flow or FlowOptions()

    looks_twice = False
    looks_round = False

    def _match(
        self, track: Followed, view: StereoView, judged: Judgement, *, by_ranges: bool = False
    ) -> tuple[Array, Drift] | None:
        """Return the target's pixel by the flow round it, and what it has drifted."""
        del by_ranges
        import cv2

        flow, last, camera = self.flow, track.last, view.left_camera
        prediction = camera.project(last.point)
        if not np.isfinite(prediction).all() or not view.shows(prediction, flow.window_px):
            judged.limit(-1.0, "target is outside the image")
            return None
        scale = template_scale(last.range_m, float(np.linalg.norm(last.point - camera.C)))
        judged.scores["scale"] = scale
        before, now = _alike_in_size(_grey(last.image), _grey(view.left))
        spots = self._corners(before, last.pixel)
        judged.scores["corners"] = float(len(spots))
        if len(spots) < flow.least:
            judged.limit(-1.0, f"{len(spots)} corners round the target; {flow.least} are needed")
            return None
        shift = (prediction - scale * last.pixel).astype(np.float32)
        ahead, seen = self._follow(before, now, spots, np.float32(scale) * spots + shift)
        back, seen_back = self._follow(now, before, ahead, (ahead - shift) / np.float32(scale))
        good = seen & seen_back & (np.linalg.norm(back - spots, axis=1) < flow.back_px)
        if int(good.sum()) < flow.least:
            judged.limit(-1.0, f"{int(good.sum())} corners come back; {flow.least} are needed")
            return None
        similar, inside = cv2.estimateAffinePartial2D(
            spots[good], ahead[good], method=cv2.RANSAC, ransacReprojThreshold=flow.fit_px
        )
        kept = 0 if similar is None else int(inside.sum())
        share = kept / len(spots)
        judged.scores["share"] = share
        judged.limit(
            (share - flow.least_share) / (1.0 - flow.least_share),
            f"{100 * share:.0f} % of the corners moved together, below {100 * flow.least_share:.0f} %",
        )
        if kept < flow.least:
            judged.limit(-1.0, f"{kept} corners moved together; {flow.least} are needed")
            return None
        chosen = inside.ravel().astype(bool)
        off = spots[good][chosen] @ similar[:, :2].T + similar[:, 2] - ahead[good][chosen]
        rms = float(np.sqrt((off**2).sum() / (2 * kept - 4)))
        judged.scores["fit_px"] = rms
        at = similar[:, :2] @ last.pixel + similar[:, 2]
        judged.alike = (share - flow.least_share) / (1.0 - flow.least_share)
        spread = (rms**2 + self.options.least_px**2) * np.eye(2)
        return np.asarray(at), grown_drift(last, camera, last.point, last.normal, spread)

    def _corners(self, image: npt.NDArray[np.uint8], pixel: Array) -> _Spots:
        """Return corners (n, 2) within reach of a pixel."""
        import cv2

        flow = self.flow
        mask = np.zeros_like(image)
        x, y = (round(float(v)) for v in pixel)
        left, top = max(0, x - flow.radius_px), max(0, y - flow.radius_px)
        mask[top : y + flow.radius_px + 1, left : x + flow.radius_px + 1] = 255
        found = cv2.goodFeaturesToTrack(image, flow.corners, flow.quality, flow.apart_px, mask=mask)
        return np.zeros((0, 2), np.float32) if found is None else found.reshape(-1, 2)

    def _follow(
        self, first: npt.NDArray[np.uint8], second: npt.NDArray[np.uint8], spots: _Spots, guess: _Spots
    ) -> tuple[_Spots, npt.NDArray[np.bool_]]:
        """Return where corners (n, 2) of the first picture are in the second, and which were found."""
        import cv2

        moved, found, _ = cv2.calcOpticalFlowPyrLK(
            first,
            second,
            spots,
            guess.astype(np.float32),
            winSize=(self.flow.window_px, self.flow.window_px),
            maxLevel=self.flow.levels,
            flags=cv2.OPTFLOW_USE_INITIAL_FLOW,
        )
        return moved, found.ravel().astype(bool)


def _alike_in_size(
    one: npt.NDArray[np.uint8], other: npt.NDArray[np.uint8]
) -> tuple[npt.NDArray[np.uint8], npt.NDArray[np.uint8]]:
    """Return both pictures with rows and columns added at their ends: OpenCV's flow wants one size."""
    rows, columns = max(one.shape[0], other.shape[0]), max(one.shape[1], other.shape[1])
    padded = [
        np.pad(image, ((0, rows - image.shape[0]), (0, columns - image.shape[1])), mode="edge")
        for image in (one, other)
    ]
    return padded[0], padded[1]


def _grey(image: Image) -> npt.NDArray[np.uint8]:
    return np.asarray(np.round(255.0 * np.clip(np.nan_to_num(image), 0.0, 1.0)), dtype=np.uint8)
