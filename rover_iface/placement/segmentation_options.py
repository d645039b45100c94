"""Parameters of the segmentation."""

from __future__ import annotations

from dataclasses import dataclass, field

from rover_iface.errors import PlacementError
from rover_iface.placement.ground_plane import GroundOptions


@dataclass(frozen=True, slots=True)
class SegmentationOptions:
    """Parameters of the segmentation.

    Attributes
    ----------
    ground
        Of plane and surface.
    roughness_m
        Deviation of natural ground from the smooth surface, at the start; the fit goes on from there.
    least_height_m, least_points
        A first region must stand this high over the ground somewhere, and have this many points.
    start_sigma
        Points higher over the ground than this many deviations begin as rock.
    rock_share
        Chance of a point to be rock, before anything is known of its height.
    coupling
        How much a neighbour's label counts, in units of log-likelihood; less where the brightness changes.
    appearance
        How much the brightness of a rock and of the ground round it counts against the heights.
    jump
        Neighbours whose depths differ by more than this many spacings do not touch (beside what stereo errs).
    patch_px
        Side of the patch that shares one error, pixels, because stereo matches patches; one of its points
        counts.
    least_steepness
        Lower than this share of its width is a rise of the ground and no rock.
    saddle_m, saddle_share
        Two summits are two rocks when the lower stands this high, and this share of its height, over the
        saddle.
    rounds
        Turns of expectation and maximisation at most.
    thinning
        Of an organised cloud only every so many columns and rows are worked on; the points between take the
        label of the nearest that was. Costs a border of half as many pixels, wins the square of it in time.
    """

    ground: GroundOptions = field(default_factory=GroundOptions)
    roughness_m: float = 0.012
    least_height_m: float = 0.03
    least_points: int = 25
    start_sigma: float = 2.0
    rock_share: float = 0.15
    coupling: float = 2.0
    appearance: float = 0.8
    jump: float = 6.0
    patch_px: float = 9.0
    least_steepness: float = 0.2
    saddle_m: float = 0.05
    saddle_share: float = 0.5
    rounds: int = 6
    thinning: int = 1

    def __post_init__(self) -> None:
        if not (self.roughness_m > 0 and self.least_height_m > 0 and self.rounds >= 1):
            raise PlacementError(
                f"segmentation: roughness {self.roughness_m} m, least height {self.least_height_m} m, "
                f"{self.rounds} rounds; all must be positive"
            )
        if self.thinning < 1:
            raise PlacementError(f"segmentation: thinning is {self.thinning}; it must be at least 1")
        if not 0 < self.rock_share < 1:
            raise PlacementError(f"segmentation: rock share is {self.rock_share}; 0 to 1, both excluded")
