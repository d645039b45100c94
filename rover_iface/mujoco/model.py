"""A rocker-bogie on a height field, as a model of MuJoCo, made from a rover profile and a terrain."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from rover_iface.mujoco.engine import import_mujoco
from rover_iface.mujoco.options import VehicleOptions
from rover_iface.profile import RoverProfile
from rover_iface.terrain.grid import Bounds
from rover_iface.terrain.terrain import Terrain

Array = npt.NDArray[np.floating]

MOST_POSTS = 7_000_000
"""128 m at 5 cm are 6.6 million posts: 0.5 s to make, some 270 MB. Wider ground gets posts further apart."""

FLOOR_M = 0.5
"""Thickness of the ground below its lowest post."""


@dataclass(frozen=True, eq=False)
class HeightField:
    """Heights [rows, columns] in metres, row 0 south, without holes; `known` [rows, columns] is where they
    are the terrain's. The first post lies at (west, south), site frame.
    """

    heights: npt.NDArray[np.float32]
    known: npt.NDArray[np.bool_]
    west: float
    south: float
    spacing: float

    @staticmethod
    def of(terrain: Terrain, box: Bounds, spacing_m: float) -> HeightField:
        """Return the terrain within a box, at its own spacing, but no finer than `spacing_m`.

        Unknown ground is as deep as the lowest known post.
        """
        west, south, east, north = terrain.bounds
        box = (max(west, box[0]), max(south, box[1]), min(east, box[2]), min(north, box[3]))
        area = (box[2] - box[0]) * (box[3] - box[1])
        spacing = max(spacing_m, terrain.spacing, math.sqrt(area / MOST_POSTS))
        grid = terrain.as_height_grid(spacing, box)
        known = np.isfinite(grid.heights_m)
        lowest = float(np.min(grid.heights_m, where=known, initial=np.inf))
        heights = np.where(known, grid.heights_m, lowest if math.isfinite(lowest) else 0.0)
        return HeightField(heights.astype(np.float32), known, grid.west_m, grid.south_m, grid.spacing_m)

    def knows(self, x: float, y: float) -> bool:
        """Return whether the ground at a point of the site is known."""
        rows, columns = self.known.shape
        column, row = round((x - self.west) / self.spacing), round((y - self.south) / self.spacing)
        return 0 <= row < rows and 0 <= column < columns and bool(self.known[row, column])

    def height(self, x: float, y: float) -> float:
        """Return the height, m, of the post nearest to a point of the site, m."""
        rows, columns = self.known.shape
        column, row = round((x - self.west) / self.spacing), round((y - self.south) / self.spacing)
        return float(self.heights[min(max(row, 0), rows - 1), min(max(column, 0), columns - 1)])


def wheel_places(profile: RoverProfile) -> Array:
    """Return x and y of the six wheels [6, 2], rover frame: left front, middle, rear, then right."""
    half = profile.wheels.track_m / 2
    return np.array([(x, y) for y in (half, -half) for x in profile.wheels.axle_x_m])


def make_model(profile: RoverProfile, field: HeightField, friction: float, options: VehicleOptions) -> Any:
    """Return the `mujoco.MjModel` of a rover on its ground.

    The site frame is the world's, but for the middle of the height field as its origin; see `middle_of`.
    Joints by name: `root`, `rocker_left`, `bogie_left`, `steer_0` and `wheel_0` (numbers as in
    `wheel_places`; middle wheels are not steered), and so on. Actuators bear the names of their
    joints; `wheel_K` take rad/s, `steer_K` rad.
    """
    mujoco = import_mujoco()
    model = mujoco.MjModel.from_xml_string(_xml(profile, field, friction, options))
    low, span = _range(field)
    model.hfield_data[:] = ((field.heights - low) / span).ravel()
    return model


def middle_of(field: HeightField) -> tuple[float, float]:
    """Return the point of the site, metres, that is the origin of the model's world."""
    rows, columns = field.heights.shape
    return (
        field.west + (columns - 1) * field.spacing / 2,
        field.south + (rows - 1) * field.spacing / 2,
    )


def torque_limit_nm(profile: RoverProfile, options: VehicleOptions) -> float:
    """Return the largest torque of a wheel's motor behind its gear."""
    pull = profile.body.mass_kg * options.gravity_m_s2 * math.sin(profile.mobility.max_slope_rad)
    return options.torque_reserve * pull * profile.wheels.radius_m / 6


def _range(field: HeightField) -> tuple[float, float]:
    low, high = float(field.heights.min()), float(field.heights.max())
    return low, max(high - low, 1e-3)


def _xml(profile: RoverProfile, field: HeightField, friction: float, options: VehicleOptions) -> str:
    body = profile.body
    rows, columns = field.heights.shape
    low, span = _range(field)
    half_x, half_y = (columns - 1) * field.spacing / 2, (rows - 1) * field.spacing / 2
    torque = torque_limit_nm(profile, options)
    carried = 1.0 - 6 * options.wheel_share - 2 * (options.rocker_share + options.bogie_share)
    thick = 0.3 * body.height_m
    deck = body.clearance_m + thick / 2
    mass_z = body.clearance_m + options.mass_height * body.height_m
    box = (body.belly_length_m / 2, body.belly_width_m / 2, thick / 2)
    inertia = _box_inertia(carried * body.mass_kg, body.length_m, body.belly_width_m, thick)
    sides = "".join(
        _side(profile, options, name, sign, k) for name, sign, k in (("left", 1, 0), ("right", -1, 3))
    )
    drives = "".join(
        f'<velocity name="wheel_{k}" joint="wheel_{k}" kv="{8 * torque:.6g}"'
        f' forcerange="{-torque:.6g} {torque:.6g}"/>'
        for k in range(6)
    )
    steers = "".join(
        f'<position name="steer_{k}" joint="steer_{k}" kp="{20 * torque:.6g}" dampratio="1"/>'
        for k in (0, 2, 3, 5)
    )
    return f"""
<mujoco model="rover">
  <compiler angle="radian"/>
  <option timestep="{options.step_s}" gravity="0 0 {-options.gravity_m_s2}" integrator="implicitfast"
    cone="elliptic" iterations="20" ls_iterations="10"/>
  <asset>
    <hfield name="ground" nrow="{rows}" ncol="{columns}"
      size="{half_x:.9g} {half_y:.9g} {span:.9g} {FLOOR_M}"/>
  </asset>
  <default>
    <geom condim="3" friction="{friction:.6g} 0.005 0.0001"/>
  </default>
  <worldbody>
    <geom name="ground" type="hfield" hfield="ground" pos="0 0 {low:.9g}" contype="1" conaffinity="2"/>
    <body name="rover">
      <freejoint name="root"/>
      <inertial pos="0 0 {mass_z:.6g}" mass="{carried * body.mass_kg:.6g}" diaginertia="{inertia}"/>
      <geom name="belly" type="box" pos="0 0 {deck:.6g}" size="{box[0]:.6g} {box[1]:.6g} {box[2]:.6g}"
        contype="2" conaffinity="1"/>{sides}
    </body>
  </worldbody>
  <equality>
    <joint joint1="rocker_left" joint2="rocker_right" polycoef="0 -1 0 0 0"/>
  </equality>
  <actuator>{drives}{steers}</actuator>
</mujoco>"""


def _side(profile: RoverProfile, options: VehicleOptions, name: str, sign: int, first: int) -> str:
    """Return the rocker of a side with its front wheel and bogie; its first wheel has the number `first`."""
    wheels, mass = profile.wheels, profile.body.mass_kg
    y = sign * wheels.track_m / 2
    pivot_z, bogie_z = profile.body.clearance_m + wheels.radius_m / 2, 1.5 * wheels.radius_m
    rocker, bogie = options.rocker_share * mass, options.bogie_share * mass
    front, middle, rear = wheels.axle_x_m
    bogie_x = wheels.bogie_pivot_x_m
    beam = _box_inertia(rocker, math.hypot(front - bogie_x, pivot_z - bogie_z), 0.05, 0.05)
    bar = _box_inertia(bogie, middle - rear, 0.05, 0.05)
    return f"""
      <body name="rocker_{name}" pos="{wheels.rocker_pivot_x_m:.6g} {y:.6g} {pivot_z:.6g}">
        <joint name="rocker_{name}" axis="0 1 0" range="-0.7 0.7" limited="true" damping="1"/>
        <inertial pos="0 0 0" mass="{rocker:.6g}" diaginertia="{beam}"/>
        {_wheel(profile, options, first, front - wheels.rocker_pivot_x_m, -pivot_z, steered=True)}
        <body name="bogie_{name}" pos="{bogie_x - wheels.rocker_pivot_x_m:.6g} 0 {bogie_z - pivot_z:.6g}">
          <joint name="bogie_{name}" axis="0 1 0" range="-0.8 0.8" limited="true" damping="1"/>
          <inertial pos="0 0 0" mass="{bogie:.6g}" diaginertia="{bar}"/>
          {_wheel(profile, options, first + 1, middle - bogie_x, -bogie_z, steered=False)}
          {_wheel(profile, options, first + 2, rear - bogie_x, -bogie_z, steered=True)}
        </body>
      </body>"""


def _wheel(
    profile: RoverProfile, options: VehicleOptions, number: int, x: float, ground_z: float, *, steered: bool
) -> str:
    """Return a wheel with its axle above `ground_z` of its parent's frame."""
    radius, width = profile.wheels.radius_m, max(profile.wheels.width_m, 0.02)
    mass = options.wheel_share * profile.body.mass_kg
    across, along = mass * (3 * radius**2 + width**2) / 12, mass * radius**2 / 2
    load = profile.body.mass_kg * options.gravity_m_s2 / 6
    rolling = options.rolling_resistance * load * radius
    ball = f"{across:.4g} {across:.4g} {across:.4g}"
    held = f'<inertial pos="0 0 0" mass="{0.2 * mass:.6g}" diaginertia="{ball}"/>'
    steer = f'<joint name="steer_{number}" axis="0 0 1" damping="2"/>{held}' if steered else ""
    turning = f"""<body pos="0 0 0">
            <joint name="wheel_{number}" axis="0 1 0" armature="0.02" frictionloss="{rolling:.6g}"/>
            <inertial pos="0 0 0" mass="{mass * (0.8 if steered else 1.0):.6g}"
              diaginertia="{across:.4g} {along:.4g} {across:.4g}"/>
            <geom name="wheel_{number}" type="ellipsoid" size="{radius:.6g} {width / 2:.6g} {radius:.6g}"
              contype="2" conaffinity="1" priority="1"/>
          </body>"""
    place = f"{x:.6g} 0 {ground_z + radius:.6g}"
    if not steered:
        return turning.replace('<body pos="0 0 0">', f'<body name="hub_{number}" pos="{place}">', 1)
    return f'<body name="hub_{number}" pos="{place}">{steer}{turning}</body>'


def _box_inertia(mass: float, x: float, y: float, z: float) -> str:
    return " ".join(f"{mass * (a * a + b * b) / 12:.5g}" for a, b in ((y, z), (x, z), (x, y)))
