"""The `full` rover: everything in the loop, from rendered stereo to the tool on the rock.

It drives by a hazard map made of dense stereo of rendered navcam pairs, follows its targets by SIFT features
on full-resolution pairs round them, registers what it sees on arrival with what it saw before, hands the
target to the hazcams by the cascade that tests itself, judges by their cloud whether and where the tool may
touch, moves an arm of five joints there until its sensors report contact, and brings a close-up of the
microscopic imager. The sun moves, and the rover's own shadow is in its pictures. Body, slip, drift, power and
faults are those of the `subframe` rover.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rover_iface.simulator.arm_placing import ArmPlacing
from rover_iface.simulator.body import Body
from rover_iface.simulator.faults import Fault, FaultKind
from rover_iface.simulator.hazard_eyes import ArrivalTracker, HazardEyes
from rover_iface.simulator.mast_cameras import MastCameras
from rover_iface.simulator.placing import ReachPlacement
from rover_iface.simulator.stereo_sight import StereoSight
from rover_iface.simulator.subframe_rover import body_of
from rover_iface.simulator.terrain_rover import Parts, TerrainRover
from rover_iface.simulator.world import World, load_world
from rover_iface.terrain.terrain import Terrain
from rover_iface.vision.shape_tracker import CombinedTracker
from rover_iface.vision.sift import SiftOptions

WINDOW_PX = 400
"""Side of what the tracker gets of a navcam frame, at full resolution; a whole one costs five times that."""

RIGHT_MARGIN_PX = 24

CADENCE = 0.08
"""Share of its range after which a far target is looked at again; the paper's steps are a tenth."""


class FullRover(TerrainRover):
    """See the module. `placing.attempts` holds every placement, `eyes.answers` every hand-off."""

    def __init__(self, body: Body, **options: Any) -> None:
        cameras = MastCameras(body, window_px=WINDOW_PX, right_margin_px=RIGHT_MARGIN_PX)
        self.eyes = HazardEyes(body, cameras)
        odometry = body.profile.mobility.odometry_error
        combined = CombinedTracker(SiftOptions(odometry_share=max(0.05, odometry)))
        tracker = ArrivalTracker(
            combined, narrow=lambda point, t_s: cameras.stereo(point, t_s, "pancam").view
        )
        parts = Parts(
            cameras=cameras,
            sight=StereoSight(body, cameras),
            tracker=tracker,
            handoff=self.eyes,
            placement=ReachPlacement(body),
            cadence=CADENCE,
        )
        super().__init__(body, parts, **options)
        self.placing: ArmPlacing = ArmPlacing(self, body, cameras, self.follower, self.eyes, self.driving)

    def apply_fault(self, fault: Fault) -> None:
        """Bring a fault into effect now."""
        if fault.kind is FaultKind.LENS_DUST:
            self.eyes.dusty.add(fault.target)
            self.eyes.forget()
        else:
            super().apply_fault(fault)


def make_rover(
    world: World | Mapping[str, Any] | Path | str,
    *,
    out: Path | None = None,
    seed: int | None = None,
    faults: Sequence[Fault] = (),
    progress_s: float | None = None,
    terrain: Terrain | None = None,
    battery_j: float | None = None,
) -> FullRover:
    """Return a full rover; the entry point `full` of the group `outcrop.rovers`.

    Parameters and errors are those of the `subframe` rover's `make_rover`.
    """
    place = load_world(world)
    return FullRover(
        body_of(place, terrain, seed, own_shadow=True),
        out=out,
        faults=(*place.faults, *faults),
        progress_s=place.progress_s if progress_s is None else progress_s,
        battery_j=battery_j if battery_j is not None else place.battery_j,
    )
