"""Rock segmentation, safety, arm and base placement."""

from rover_iface.placement.base_placement import ObservationPoint, check_observation_point, place_base
from rover_iface.placement.cloud import SurfaceCloud, cloud_of_points, cloud_of_stereo
from rover_iface.placement.safety import plan_placement
from rover_iface.placement.safety_limits import SafetyLimits
from rover_iface.placement.segmentation import segment
from rover_iface.placement.verdict import Decision, PlacementVerdict, Reason

__all__ = [
    "Decision",
    "ObservationPoint",
    "PlacementVerdict",
    "Reason",
    "SafetyLimits",
    "SurfaceCloud",
    "check_observation_point",
    "cloud_of_points",
    "cloud_of_stereo",
    "place_base",
    "plan_placement",
    "segment",
]
