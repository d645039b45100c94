"""Straight segments round obstacles, tracking regions, consolidation (PathGen).

```python
import math
from planner.path_network import (
    KeepOut, NetworkRequest, ObservationPoint, Pose, Target, build_network,
)

request = NetworkRequest(
    start=Pose(0.0, 0.0, heading_rad=0.0),
    targets=(Target("T1", 6.0, 1.0), Target("T2", 8.0, -2.0, tracked=False)),
    observation_points=(
        ObservationPoint("OP1", "T1", Pose(5.2, 0.9, math.atan2(0.1, 0.8))),
        ObservationPoint("OP2", "T2", Pose(7.3, -1.7, -0.4)),
    ),
    keep_outs=(KeepOut("K1", [(2.0, -1.0), (3.0, -1.0), (3.0, 1.0), (2.0, 1.0)]),),
    terrain=None,  # or mission.TerrainGrid, heights with the north-west cell first
)
network = build_network(request)
drive = network.route("start", "OP1")
drive.points, drive.length_m, drive.duration_mean_s, drive.energy_mean_j, drive.p_lose["T1"]
network.best_points()      # {"T1": "OP1", "T2": "OP2"}: one observation point for each target
network.unreachable        # observation points that cannot be driven to, with the reason
network.segments, network.regions, network.margins, network.hazards   # for the map
```

Units are metres, seconds, joules and radians in the site frame; energies are drive energies without the
hotel load (`energy used = hotel_w * elapsed + sum of drive energies`), durations are without the overhead
of `track_overhead_s` per tracked target and leg, which the planner adds. Start is the place `"start"`.
"""

from mission import KeepOut, Pose
from planner.path_network.activity_fit import TRACK_START, ActivityFit, fit_activity
from planner.path_network.build import build_network
from planner.path_network.calibration import (
    K9_CALIBRATION,
    Calibration,
    RegressionFit,
    fit_calibration,
    fit_mean,
)
from planner.path_network.calibration_document import CALIBRATIONS, calibration_document
from planner.path_network.intraday_correlation import IntradayCorrelation, fit_intraday_correlation
from planner.path_network.rate_fit import LossFit, fit_failures, fit_loss
from planner.path_network.values import (
    START,
    DriveRule,
    MissingRoute,
    NetworkOptions,
    NetworkRequest,
    ObservationPoint,
    PathNetwork,
    Route,
    RoverParameters,
    Segment,
    Target,
    TrackingRegion,
    UnreachablePoint,
)

__all__ = [
    "CALIBRATIONS",
    "K9_CALIBRATION",
    "START",
    "TRACK_START",
    "ActivityFit",
    "Calibration",
    "DriveRule",
    "IntradayCorrelation",
    "KeepOut",
    "LossFit",
    "MissingRoute",
    "NetworkOptions",
    "NetworkRequest",
    "ObservationPoint",
    "PathNetwork",
    "Pose",
    "RegressionFit",
    "Route",
    "RoverParameters",
    "Segment",
    "Target",
    "TrackingRegion",
    "UnreachablePoint",
    "build_network",
    "calibration_document",
    "fit_activity",
    "fit_calibration",
    "fit_failures",
    "fit_intraday_correlation",
    "fit_loss",
    "fit_mean",
]
