"""The pixels of each rock: labels of a stereo cloud carried to the image, and drawn to its edges.

A cloud ends where block matching ends: some pixels before or behind a rock's edge, and in shaded faces it
has holes. The image has the edge itself. So each rock of a `Segmentation` is cut out of its image anew: what
the heights say (over a plane fitted to the ground right round the rock, which follows it closer than the
ground of the whole cloud), what the brightness says, and labels that hang together except across a change of
brightness. Expectation and maximisation in turns as in GrabCut (Rother, Kolmogorov and Blake 2004), the cut
by mean field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import PlacementError
from rover_iface.placement.cloud import Array, SurfaceCloud
from rover_iface.placement.segmentation import GROUND, Segmentation

Index = npt.NDArray[np.int64]
Mask = npt.NDArray[np.bool_]
Image = npt.NDArray[np.floating]


@dataclass(frozen=True, slots=True)
class MaskOptions:
    """Parameters of the masks.

    Attributes
    ----------
    margin
        How far round the cloud's rock is looked, share of its width and height; at least `least_margin_px`.
    roughness_m
        Deviation of ground from the plane round the rock, at least.
    reaches_m
        Heights over the ground at which a point stops to count as ground, in the turns of its fit.
    patch
        So many neighbouring heights share one error: each counts as much less.
    steepness, ground_slope_rad, slope_px, most_steep
        How much the slope counts against heights; slope that is commonest on ground; distance in pixels over
        which it is taken; the most that it speaks for a rock.
    appearance
        How much brightness counts against heights.
    coupling, noise
        How much a neighbour's label counts where the brightness is even, in units of log-likelihood; a change
        of brightness of `noise` makes that less by a factor of 0.6.
    unmatched
        How much the height of what lies behind counts for a pixel without a match.
    neck
        What hangs on a rock by less than twice this share of its size (the root of its area) is another.
    beyond_px
        So far outside the cloud's rock a pixel is less likely its own by a factor of e.
    rounds
        Turns of expectation and maximisation.
    """

    margin: float = 0.4
    least_margin_px: int = 12
    roughness_m: float = 0.004
    reaches_m: tuple[float, ...] = (0.06, 0.03, 0.02, 0.012, 0.01, 0.01)
    patch: float = 3.0
    steepness: float = 1.0
    ground_slope_rad: float = math.radians(15.0)
    slope_px: int = 7
    most_steep: float = 0.4
    appearance: float = 0.25
    coupling: float = 2.5
    noise: float = 0.03
    unmatched: float = 0.5
    neck: float = 0.08
    beyond_px: float = 10.0
    rounds: int = 3

    def __post_init__(self) -> None:
        for name in ("roughness_m", "patch", "noise", "beyond_px"):
            if not getattr(self, name) > 0:
                raise PlacementError(f"rock masks: {name} is {getattr(self, name)}; it must be positive")
        if self.rounds < 1 or self.least_margin_px < 2:
            raise PlacementError(
                f"rock masks: {self.rounds} rounds, margin of {self.least_margin_px} px; at least 1 and 2"
            )


def rock_masks(
    image: Image, cloud: SurfaceCloud, found: Segmentation, options: MaskOptions | None = None
) -> Index:
    """Return (height, width) the rock of each pixel, an index into `found.rocks`, -1 for none.

    Parameters
    ----------
    image
        (height, width), 0..1, of the camera whose pixels the cloud has: `Cloud.camera` of dense stereo.
    cloud, found
        An organised cloud and its segmentation.

    Raises
    ------
    PlacementError
        If the cloud has no pixels, one lies outside the image, or the segmentation is of another cloud.
    """
    options = options or MaskOptions()
    if cloud.pixels is None:
        raise PlacementError("the cloud has no pixels; masks need an organised one")
    if len(found.labels) != len(cloud):
        raise PlacementError(f"the segmentation has {len(found.labels)} labels for {len(cloud)} points")
    x, y = cloud.pixels.T
    size = (image.shape[1], image.shape[0])
    if len(cloud) and (cloud.pixels.min() < 0 or (cloud.pixels.max(axis=0) >= size).any()):
        raise PlacementError(f"a pixel of the cloud lies outside the image of {size[0]} x {size[1]}")
    out = np.full(image.shape, GROUND, np.int64)
    if found.ground is None or not found.rocks:
        return out
    number = np.full(image.shape, -1, np.int64)
    number[y, x] = np.arange(len(cloud))
    grey = np.sqrt(np.clip(image, 0.0, 1.0)).astype(np.float64)
    first = np.where(number >= 0, found.labels[np.maximum(number, 0)], GROUND)
    # the farthest first: what is nearer lies before it
    for rock in reversed(found.rocks):
        window = _window(first == rock.label, options)
        if window is None:
            continue
        cut = _Cut(grey[window], number[window], first[window], rock.label, cloud, found, options)
        mask = cut.run()
        part = out[window]
        part[mask] = rock.label
    return out


def _window(own: Mask, options: MaskOptions) -> tuple[slice, slice] | None:
    """Return rows and columns of a rock and the ground round it."""
    rows, columns = np.flatnonzero(own.any(axis=1)), np.flatnonzero(own.any(axis=0))
    if not len(rows):
        return None
    slices = []
    for line, most in ((rows, own.shape[0]), (columns, own.shape[1])):
        margin = max(options.least_margin_px, int(options.margin * (line[-1] - line[0] + 1)))
        slices.append(slice(max(0, int(line[0]) - margin), min(most, int(line[-1]) + margin + 1)))
    return slices[0], slices[1]


class _Cut:
    """One rock being cut out of its window (h, w) of the image."""

    def __init__(
        self,
        grey: Array,
        number: Index,
        first: Index,
        label: int,
        cloud: SurfaceCloud,
        found: Segmentation,
        options: MaskOptions,
    ) -> None:
        self.grey, self.options = grey, options
        self.known = number >= 0
        self.start = _filled(first == label)
        self.other = (first >= 0) & (first != label)
        assert found.plane is not None
        members = number[self.known]
        local = found.plane.local(cloud.points[members])
        part = cloud.subset(members)
        self.height, self.spread = self._over_ground(local, part.sigma_along(found.plane.normal))
        self.slope = _slopes(
            self.known, np.column_stack((local[:, :2], self.height)), self.other, options.slope_px
        )
        eye = cloud.eye if cloud.eye is not None else found.plane.origin
        self.behind = _behind(self.known, np.linalg.norm(part.points - eye, axis=1))
        self.edges = _graph(grey, options)

    def _over_ground(self, local: Array, sigma: Array) -> tuple[Array, Array]:
        """Return heights of the known pixels over the ground round the rock, and their deviations.

        The ground is a surface of second order through what is low: points over it lose their weight.
        """
        use = ~self.other[self.known]
        x, y = (local[:, :2] - local[:, :2].mean(axis=0)).T
        design = np.column_stack((np.ones(len(x)), x, y, x * x, x * y, y * y))
        rough = self.options.roughness_m
        weight = use / (sigma**2 + rough**2)
        # a coarse fit to one point in a few is the same
        thin = np.arange(len(x)) % max(1, len(x) // 4000) == 0
        height = local[:, 2]
        for reach in self.options.reaches_m:
            root = np.sqrt(weight[thin])[:, None]
            fit = np.linalg.lstsq(design[thin] * root, local[thin, 2] * root[:, 0], rcond=None)[0]
            height = local[:, 2] - design @ fit
            trust = 1.0 / (1.0 + np.exp(np.clip((height - reach) / (0.3 * reach), -40.0, 40.0)))
            weight = use * trust / (sigma**2 + rough**2)
        low = use & ~self.start[self.known] & (np.abs(height) < 0.015)
        found = 1.4826 * float(np.median(np.abs(height[low]))) if low.sum() > 50 else 0.0
        return height, np.hypot(sigma, np.clip(found, rough, 2.5 * rough))

    def run(self) -> Mask:
        """Return the rock's pixels."""
        from rover_iface.placement.segmentation_kernels import mean_field

        mask = self.start & ~self.other
        chance = mask.astype(np.float64).ravel()
        tall = np.zeros(self.known.shape)
        tall[self.known] = self.height
        for _ in range(self.options.rounds):
            odds = self._place() + self._heights(mask, tall) + self._steepness() + self._brightness(mask)
            odds[self.other] = -20.0
            mean_field(odds.ravel(), *self.edges, chance, 6)
            after = self._whole(chance.reshape(mask.shape) > 0.5, tall)
            if not after.any():
                return self.start & ~self.other
            mask = after
        return mask

    def _place(self) -> Array:
        """Return log-odds by the distance from what the cloud gave."""
        from scipy.ndimage import distance_transform_edt

        away = np.asarray(distance_transform_edt(~self.start))
        return -away / self.options.beyond_px

    def _heights(self, mask: Mask, tall: Array) -> Array:
        """Return log-odds by height: uniform up to the rock's top against normal about the ground."""
        from scipy.special import ndtr

        own = tall[mask & self.known]
        top = max(0.03, float(np.quantile(own, 0.98))) if len(own) else 0.1
        h, s = self.height, self.spread
        rock = (ndtr((h + 0.003) / s) - ndtr((h - top) / s)) / top + 1e-3
        ground = 0.98 * np.exp(-0.5 * (h / s) ** 2) / (s * math.sqrt(2.0 * math.pi)) + 0.02 / 0.5
        odds = np.log(rock / ground) / self.options.patch
        out = np.zeros(mask.shape)
        out[self.known] = odds
        # what has no match is seen by one camera only: it is as what lies behind it
        guess = self.behind >= 0
        out[guess] = self.options.unmatched * odds[self.behind[guess]]
        return out

    def _steepness(self) -> Array:
        """Return log-odds by slope: faces of rocks have any, ground is gentle.

        Steep counts no more than so much, because beyond a rock's edge the cloud is steep as well.
        """
        gentle = self.options.ground_slope_rad
        s = np.maximum(self.slope, 0.3 * gentle)
        ground = s / gentle**2 * np.exp(-0.5 * (s / gentle) ** 2) + 0.02
        odds = self.options.steepness * np.log(2.0 / math.pi / ground)
        return np.where(np.isfinite(self.slope), np.minimum(odds, self.options.most_steep), 0.0)

    def _brightness(self, mask: Mask) -> Array:
        """Return log-odds by brightness, from histograms of the rock and of what is round it."""
        bins = 32
        shade = np.minimum((self.grey * bins).astype(np.int64), bins - 1)
        around = ~mask & ~self.other
        one, two = (_histogram(shade[part], bins) for part in (mask, around))
        return self.options.appearance * (np.log(one) - np.log(two))[shade]

    def _whole(self, mask: Mask, tall: Array) -> Mask:
        """Return the part of what the cloud gave that stands up most (heights summed), holes filled; what
        hangs on it by a neck is left out.
        """
        from scipy.ndimage import binary_dilation, binary_erosion, label

        neck = max(1, int(self.options.neck * math.sqrt(mask.sum())))
        core, count = label(binary_erosion(mask, iterations=neck))
        if not count:
            core, count = label(mask)
            neck = 0
        if not count:
            return mask
        own = self.start & mask
        shared = np.bincount(core[own], weights=np.maximum(tall[own], 1e-4), minlength=count + 1)
        shared[0] = 0
        kept = core == shared.argmax()
        if neck:
            kept = np.asarray(binary_dilation(kept, iterations=neck + 1, mask=mask))
        return _filled(kept) & ~self.other


def _slopes(known: Mask, local: Array, apart: Mask, over_px: int) -> Array:
    """Return (h, w) the slope of the surface, NaN where too little of it is known; points (n, 3) of the known
    pixels, their third coordinate the height. Pixels of `apart` are left out.
    """
    import cv2

    use = known & ~apart
    share = cv2.blur(use.astype(np.float64), (over_px, over_px))
    smooth = np.full((*known.shape, 3), np.nan)
    raster = np.zeros(known.shape)
    for k in range(3):
        raster[known] = local[:, k]
        mean = cv2.blur(np.where(use, raster, 0.0), (over_px, over_px))
        smooth[..., k] = np.where(share > 0.5, mean / np.maximum(share, 1e-9), np.nan)
    half = over_px // 2
    out = np.full(known.shape, np.nan)
    if min(known.shape) <= 2 * half:
        return out
    across = smooth[half:-half, 2 * half :] - smooth[half:-half, : -2 * half]
    down = smooth[2 * half :, half:-half] - smooth[: -2 * half, half:-half]
    normal = np.cross(across, down)
    flat = np.hypot(normal[..., 0], normal[..., 1])
    out[half:-half, half:-half] = np.arctan2(flat, np.abs(normal[..., 2]))
    return out


def _behind(known: Mask, far: Array) -> Index:
    """Return for each pixel (h, w) without a match the known one, by number, that ends its gap along the row
    farther away; -1 where the gap has no end, and for known pixels.
    """
    number = np.full(known.shape, -1, np.int64)
    number[known] = np.arange(int(known.sum()))
    ends = np.stack((_carried(number), _carried(number[:, ::-1])[:, ::-1]))
    range_m = np.where(ends >= 0, far[np.maximum(ends, 0)], -1.0)
    out = np.take_along_axis(ends, range_m.argmax(axis=0)[None], axis=0)[0]
    return np.where(known, -1, out)


def _carried(number: Index) -> Index:
    """Return the raster with each gap filled by the last number to its left."""
    at = np.where(number >= 0, np.arange(number.shape[1]), 0)
    return np.take_along_axis(number, np.maximum.accumulate(at, axis=1), axis=1)


def _filled(mask: Mask) -> Mask:
    from scipy.ndimage import binary_fill_holes

    return np.asarray(binary_fill_holes(mask), dtype=bool)


def _histogram(values: Index, bins: int) -> Array:
    """Return shares (bins,), smoothed over neighbours, none of them zero."""
    count = np.bincount(values, minlength=bins).astype(np.float64)
    smooth = np.convolve(count, (0.1, 0.2, 0.4, 0.2, 0.1), mode="same") + 0.1 * count.sum() / bins + 1e-3
    return np.asarray(smooth / smooth.sum())


def _graph(grey: Array, options: MaskOptions) -> tuple[Index, Index, Array]:
    """Return the eight neighbours of each pixel and how much they pull, as `mean_field` takes them."""
    rows, columns = grey.shape
    cells = np.arange(rows * columns).reshape(rows, columns)
    one, two, weight = [], [], []
    pairs = (
        (np.s_[:, :-1], np.s_[:, 1:], 1.0),
        (np.s_[:-1, :], np.s_[1:, :], 1.0),
        (np.s_[:-1, :-1], np.s_[1:, 1:], math.sqrt(0.5)),
        (np.s_[:-1, 1:], np.s_[1:, :-1], math.sqrt(0.5)),
    )
    for a, b, near in pairs:
        change = (grey[a] - grey[b]).ravel()
        pull = options.coupling / 2.0 * near * np.exp(-0.5 * (change / options.noise) ** 2)
        one.append(cells[a].ravel())
        two.append(cells[b].ravel())
        weight.append(pull)
    first, second, pull = (np.concatenate(v) for v in (one, two, weight))
    start, end, both = np.r_[first, second], np.r_[second, first], np.r_[pull, pull]
    order = np.argsort(start, kind="stable")
    starts = np.concatenate(([0], np.cumsum(np.bincount(start, minlength=rows * columns))))
    return starts.astype(np.int64), end[order].astype(np.int64), both[order]
