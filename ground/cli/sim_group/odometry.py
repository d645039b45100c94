"""`outcrop sim odometry`: a drive over rendered ground, told by the wheels and by the pictures."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ground.cli.failure import refusals

if TYPE_CHECKING:
    from collections.abc import Iterator

    from rover_iface.frames import Transform
    from rover_iface.localization.visual_odometry import Step
    from rover_iface.terrain.terrain import Terrain

SCALE = 0.5
"""Of the navcam's resolution; whole frames take four times as long and tell little more."""


def odometry(
    steps: Annotated[int, typer.Option(help="how many", min=1)] = 8,
    length: Annotated[float, typer.Option(help="of a step, metres", min=0.05, max=2.0)] = 0.5,
    softer: Annotated[float, typer.Option(help="factor on the slip of the soil")] = 1.0,
    terrain: Annotated[Path | None, typer.Option(help="terrain folder; generated if absent")] = None,
    seed: Annotated[int, typer.Option(help="of the terrain and of all errors")] = 1,
    rover: Annotated[str, typer.Option(help="rover profile: its wheels, mast and cameras")] = "k9",
) -> None:
    """Drive straight on from the origin, and compare wheels, visual odometry and truth at each step."""
    import numpy as np

    from rover_iface.localization.visual_odometry import drive
    from rover_iface.terrain import generate_terrain, load_terrain

    with refusals():
        ground = load_terrain(terrain) if terrain else generate_terrain(seed, ortho=False)
        typer.echo("step   wheels m  pictures m  truth m  off mm  features  state  why")
        told = []
        for number, (step, wheels, true) in enumerate(
            _steps(ground, rover, steps, length, softer, seed), start=1
        ):
            told.append(step)
            lengths = (float(np.linalg.norm(t.translation)) for t in (wheels, step.old_from_new, true))
            off = 1000 * float(np.linalg.norm(step.old_from_new.translation - true.translation))
            columns = " ".join(f"{value:10.3f}" for value in lengths)
            typer.echo(f"{number:4d} {columns} {off:7.1f} {step.features:9d}  {step.state:<5}  {step.reason}")
    whole, covariance = drive(told)
    sigma = 1000 * float(np.sqrt(np.linalg.eigvalsh(covariance[3:, 3:]).max()))
    typer.echo(f"{np.linalg.norm(whole.translation):.3f} m by pictures, sigma {sigma:.1f} mm")


def _steps(
    ground: Terrain, rover: str, steps: int, length_m: float, softer: float, seed: int
) -> Iterator[tuple[Step, Transform, Transform]]:
    """Yield each step as the pictures tell it, with what the wheels say and what is true."""
    import numpy as np

    from mission import Sky
    from rover_iface.cameras.rig import rig_of
    from rover_iface.frames import Pose, Transform
    from rover_iface.localization.visual_odometry import VisualOdometer
    from rover_iface.navigation.navigator import Way
    from rover_iface.navigation.sensor import GroundRaster, StereoSensor
    from rover_iface.profile import load_profile
    from rover_iface.simulator.chassis import Chassis
    from rover_iface.simulator.render.from_terrain import scene_from_terrain
    from rover_iface.simulator.render.renderer import Renderer, Sun
    from rover_iface.vision.tracker import StereoView

    profile = load_profile(rover)
    rig = rig_of(profile)
    clock = Sky().clock()
    light = Sun(clock.direction(0.0))
    raster = GroundRaster.of(ground, 20.0)
    chassis = Chassis(raster, profile, Pose(0.0, 0.0), softer=softer, rng=np.random.default_rng(seed))
    renderer = Renderer(scene_from_terrain(ground, (0.0, 0.0), radius_m=20.0))
    tilt = StereoSensor(profile).tilt
    pair = tuple(rig.camera(f"navcam_{side}", 0.0, tilt).scaled(SCALE) for side in ("left", "right"))
    odometer = VisualOdometer()

    def view(number: int) -> StereoView:
        left, right = (
            renderer.render(camera, chassis.pose, light, seed=2 * number + k).unit
            for k, camera in enumerate(pair)
        )
        return StereoView(left, right, pair[0], pair[1])

    odometer.step(view(0), Transform.identity())
    for number in range(1, steps + 1):
        before = chassis.believed.site_from_rover, chassis.pose.site_from_rover
        chassis.follow(Way(0.0, 0.0, length_m))
        wheels = before[0].inverse() * chassis.believed.site_from_rover
        true = before[1].inverse() * chassis.pose.site_from_rover
        step = odometer.step(view(number), wheels)
        if step is not None:
            yield step, wheels, true
