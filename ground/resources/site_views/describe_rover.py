"""Tell what a view draws of a mission's rover: body, arm, mast, cameras, tracking cone, sun."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal

from ground.day.prepare import rover_parameters
from ground.day.rovers import profile_of
from ground.errors import InvalidInputError, OutsideTerrainError
from ground.gdr.geometry import Pose
from ground.gdr.repository import Repository
from ground.records.actor import Action, Actor
from ground.records.get_resource import get_resource
from ground.resources.missions.kind import MISSION
from ground.resources.missions.row import MissionRow
from ground.resources.missions.terrain import mission_terrain
from ground.resources.missions.value import Mission
from ground.resources.site_views.value import Camera, CameraView, RoverShape, SunPlace

if TYPE_CHECKING:
    from rover_iface.cameras.model import CameraModel

SUN_STEP_H = 0.25


def describe_rover(repo: Repository, actor: Actor, mission_id: str) -> RoverShape:
    """Return the shape of a mission's rover."""
    from mission import Sky
    from mission.soltime import SunClock
    from rover_iface.cameras.rig import rig_of

    mission: Mission = get_resource(repo, actor, MISSION, mission_id)
    profile = profile_of(mission.rover_profile)
    rig = rig_of(profile)
    sun = Sky()
    midnight = SunClock.at(sun.ls_deg, sun.latitude_deg, 0.0)
    hour_s = 88775.244 / 24.0
    places = [round(k * SUN_STEP_H, 2) for k in range(int(24 / SUN_STEP_H) + 1)]
    return RoverShape(
        profile=profile.name,
        version=profile.version,
        length_m=profile.body.length_m,
        width_m=profile.body.width_m,
        height_m=profile.body.height_m,
        clearance_m=profile.body.clearance_m,
        wheel_radius_m=profile.wheels.radius_m,
        wheel_width_m=profile.wheels.width_m,
        track_m=profile.wheels.track_m,
        axle_x_m=list(profile.wheels.axle_x_m),
        mast_pivot_m=list(rig.pivot_rover),
        pan_limit_rad=profile.mast.pan_limit_rad,
        tilt_limits_rad=list(profile.mast.tilt_limits_rad),
        shoulder_m=list(profile.arm.shoulder_m),
        arm_reach_m=profile.arm.reach_m,
        arm_min_reach_m=profile.arm.min_reach_m,
        arm_azimuth_limit_rad=profile.arm.azimuth_limit_rad,
        max_slope_rad=profile.mobility.max_slope_rad,
        max_tilt_rad=profile.mobility.max_tilt_rad,
        cone_half_angle_rad=rover_parameters(profile).cone_half_angle_rad,
        odometry_error=profile.mobility.odometry_error,
        heading_drift_rad_m=profile.mobility.heading_drift_rad_m,
        navigation_camera=profile.cameras.navigation,
        cameras=[
            camera_value(name, "mast" if mounted.mount == "mast" else "body", mounted.model)
            for name, mounted in rig.cameras.items()
            if mounted.mount != "tool"
        ],
        sun=[SunPlace(h, [float(c) for c in midnight.direction(h * hour_s)]) for h in places],
    )


def camera_value(name: str, mount: Literal["mast", "body", "site"], model: CameraModel) -> Camera:
    """Return a camera model as it is sent."""
    vectors = {letter: [float(c) for c in getattr(model, letter)] for letter in "CAHVORE"}
    return Camera(
        name=name,
        mount=mount,
        kind=model.kind.value,
        width=model.width,
        height=model.height,
        linearity=model.linearity,
        **vectors,
    )


def view_from(
    repo: Repository,
    actor: Actor,
    mission_id: str,
    pose: Pose,
    camera: str,
    *,
    pan_rad: float = 0.0,
    tilt_rad: float = 0.0,
    at: tuple[float, float] | None = None,
) -> CameraView:
    """Return a camera of the rover standing at a pose, in the site frame.

    With `at` the mast looks at the ground there, else it stands at `pan_rad`, `tilt_rad`.

    Raises
    ------
    InvalidInputError
        If the rover has no such camera or its mast does not turn so far.
    OutsideTerrainError
        If the ground under the rover or at the point is not known.
    """
    import math

    from rover_iface.cameras.rig import rig_of
    from rover_iface.errors import CameraError
    from rover_iface.errors import OutsideTerrainError as Outside
    from rover_iface.mobility import settled_pose

    actor.require(Action.READ, mission_id)
    get_resource(repo, actor, MISSION, mission_id)
    with repo.database.read() as session:
        profile = profile_of(session.get_one(MissionRow, mission_id).rover_profile)
        terrain = mission_terrain(repo, session, mission_id)
    stands = settled_pose(terrain, profile, pose.east_m, pose.north_m, pose.heading_rad)
    if math.isnan(stands.z):
        raise OutsideTerrainError(
            f"the ground under the rover at ({pose.east_m:.2f}, {pose.north_m:.2f}) is not known",
            pointer="/east_m",
        )
    rig = rig_of(profile)
    site_from_rover = stands.site_from_rover
    try:
        if at is not None and rig.mounted(camera).mount == "mast":
            point = (at[0], at[1], terrain.height_at(*at))
            pan_rad, tilt_rad = rig.point_at(site_from_rover.inverse().apply(point), camera)
        model = rig.camera(camera, pan_rad, tilt_rad).transformed(site_from_rover)
    except CameraError as err:
        raise InvalidInputError(str(err), pointer="/camera") from err
    except Outside as err:
        raise OutsideTerrainError(str(err), pointer="/at_east_m") from err
    return CameraView(
        camera=camera_value(camera, "site", model),
        pose=pose,
        up_m=stands.z,
        pitch_rad=stands.pitch,
        roll_rad=stands.roll,
        pan_rad=pan_rad,
        tilt_rad=tilt_rad,
    )
