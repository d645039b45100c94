"""Rock segmentation, safety, arm and base placement."""

from rover_iface.placement.base_placement import ObservationPoint, check_observation_point, place_base

__all__ = ["ObservationPoint", "check_observation_point", "place_base"]
