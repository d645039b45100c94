"""Commands that look at the simulated world: render, panorama, track."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ground.cli.failure import refusals
from ground.cli.geo_group.sky import sky
from ground.cli.sim_group.drive import drive
from ground.cli.sim_group.odometry import odometry

if TYPE_CHECKING:
    from rover_iface.cameras.rig import CameraRig
    from rover_iface.frames import Pose
    from rover_iface.simulator.render.renderer import Renderer, Sun
    from rover_iface.terrain.terrain import Terrain

sim = typer.Typer(
    name="sim", help="Look at the simulated world through the rover's cameras.", no_args_is_help=True
)

TerrainOption = Annotated[Path | None, typer.Option("--terrain", help="folder of form terrain/1")]
SeedOption = Annotated[
    int, typer.Option(help="of the generated terrain (without --terrain), texture and noise")
]
RoverOption = Annotated[str, typer.Option(help="rover profile: its mast and cameras")]
XOption = Annotated[float, typer.Option("--x", help="rover, metres east")]
YOption = Annotated[float, typer.Option("--y", help="rover, metres north")]
HeadingOption = Annotated[float, typer.Option(help="degrees counter-clockwise from east")]
AzimuthOption = Annotated[float | None, typer.Option(help="of the sun, degrees clockwise from north")]
ElevationOption = Annotated[float | None, typer.Option(help="of the sun, degrees")]
LmstOption = Annotated[float, typer.Option(help="local mean solar time, hours; without --sun-azimuth")]
SeasonOption = Annotated[float, typer.Option("--ls", help="solar longitude, degrees")]
LatitudeOption = Annotated[float, typer.Option(help="degrees north")]


def register(app: typer.Typer) -> None:
    """Add the group to the program."""
    sim.command("drive")(drive)
    sim.command("odometry")(odometry)
    app.add_typer(sim)
    app.command("sky")(sky)


def _world(terrain: Path | None, seed: int, rover: str) -> tuple[Terrain, CameraRig]:
    from rover_iface.cameras.rig import rig_of
    from rover_iface.profile import load_profile
    from rover_iface.terrain import generate_terrain, load_terrain

    profile = load_profile(rover)
    return load_terrain(terrain) if terrain else generate_terrain(seed, ortho=False), rig_of(profile)


def _renderer(ground: Terrain, seed: int, x: float, y: float) -> Renderer:
    from rover_iface.simulator.render.from_terrain import scene_from_terrain
    from rover_iface.simulator.render.renderer import Renderer

    return Renderer(scene_from_terrain(ground, (x, y), seed=seed))


def _sun(azimuth: float | None, elevation: float | None, lmst: float, ls: float, latitude: float) -> Sun:
    import math

    from mission.soltime import SunClock
    from rover_iface.errors import RenderError
    from rover_iface.simulator.render.renderer import Sun

    if (azimuth is None) != (elevation is None):
        raise RenderError("--sun-azimuth and --sun-elevation go together")
    if azimuth is not None and elevation is not None:
        return Sun.from_angles(math.radians(azimuth), math.radians(elevation))
    return Sun(SunClock.at(ls, latitude, lmst).direction(0.0))


def _with_rover(renderer: Renderer, rover: str, pose: Pose) -> Renderer:
    from rover_iface.profile import load_profile
    from rover_iface.simulator.render.renderer import Renderer
    from rover_iface.simulator.rover_in_view import RoverInView

    return Renderer(RoverInView(renderer.scene, load_profile(rover), pose.site_from_rover))


def _pose(ground: Terrain, x: float, y: float, heading: float) -> Pose:
    import math

    from rover_iface.frames import Pose

    return Pose(x, y, ground.height_at(x, y, "rover"), math.radians(heading))


@sim.command()
def render(
    out: Annotated[Path, typer.Option(help="PNG to write; its label goes beside it as .json")],
    terrain: TerrainOption = None,
    seed: SeedOption = 1,
    rover: RoverOption = "k9",
    camera: Annotated[str, typer.Option(help="navcam_left, pancam_right, hazcam_left, ...")] = "navcam_left",
    x: XOption = 0.0,
    y: YOption = 0.0,
    heading: HeadingOption = 0.0,
    pan: Annotated[float, typer.Option(help="degrees to the left")] = 0.0,
    tilt: Annotated[float, typer.Option(help="degrees upwards")] = -15.0,
    sun_azimuth: AzimuthOption = None,
    sun_elevation: ElevationOption = None,
    lmst: LmstOption = 10.5,
    ls: SeasonOption = 0.0,
    latitude: LatitudeOption = -4.6,
    samples: Annotated[int, typer.Option(min=1, max=4, help="rays per pixel along each axis")] = 1,
    truth: Annotated[bool, typer.Option(help="write ranges beside the image as .npz")] = False,
    rover_in_view: Annotated[bool, typer.Option(help="with deck, mast, wheels and their shadow")] = False,
) -> None:
    """Render one image from where the rover stands."""
    import json
    import math

    from rover_iface.cameras.panorama import camera_document

    with refusals():
        light = _sun(sun_azimuth, sun_elevation, lmst, ls, latitude)
        ground, rig = _world(terrain, seed, rover)
        rig.mounted(camera)
        pose = _pose(ground, x, y, heading)
        renderer = _renderer(ground, seed, x, y)
        if rover_in_view:
            renderer = _with_rover(renderer, rover, pose)
        frame = renderer.render(
            rig.camera(camera, math.radians(pan), math.radians(tilt)),
            pose,
            light,
            sensor=rig.mounted(camera).sensor,
            seed=seed,
            samples=samples,
        )
    _write_png(out, frame.image8)
    label: dict[str, Any] = {
        "format": "image/1",
        "camera": camera,
        "camera_model": camera_document(frame.camera),
        "frame": "site",
        "pose": {"x": pose.x, "y": pose.y, "z": pose.z, "heading": pose.heading},
        "sun_direction": list(light.direction),
        "exposure": frame.exposure,
        "terrain": ground.name,
        "seed": seed,
    }
    out.with_suffix(".json").write_text(json.dumps(label, indent=1) + "\n")
    if truth:
        import numpy as np

        np.savez_compressed(
            out.with_suffix(".npz"),
            range_m=frame.truth.range_m,
            object_index=frame.truth.object_index,
            ids=np.array(frame.truth.ids),
        )
    typer.echo(
        f"{out}: {frame.image.shape[1]} x {frame.image.shape[0]}, {ground.name or 'generated terrain'}"
    )


@sim.command()
def panorama(
    out: Annotated[Path, typer.Option(help="folder to write (form panorama/1), with mosaic.png")],
    terrain: TerrainOption = None,
    seed: SeedOption = 1,
    rover: RoverOption = "k9",
    x: XOption = 0.0,
    y: YOption = 0.0,
    heading: HeadingOption = 0.0,
    span: Annotated[float, typer.Option(help="degrees, in the middle the rover's front")] = 360.0,
    sun_azimuth: AzimuthOption = None,
    sun_elevation: ElevationOption = None,
    lmst: LmstOption = 10.5,
    ls: SeasonOption = 0.0,
    latitude: LatitudeOption = -4.6,
) -> None:
    """Render a stereo panorama in which targets can be picked."""
    import math

    from rover_iface.simulator.render.panorama import take_panorama

    with refusals():
        light = _sun(sun_azimuth, sun_elevation, lmst, ls, latitude)
        ground, rig = _world(terrain, seed, rover)
        pose = _pose(ground, x, y, heading)
        taken = take_panorama(
            _renderer(ground, seed, x, y),
            rig,
            pose,
            light,
            from_azimuth_rad=math.radians(span / 2),
            span_rad=math.radians(span),
            name=ground.name,
            seed=seed,
        )
    taken.save(out)
    _write_png(out / "mosaic.png", taken.mosaic(4096)[0])
    typer.echo(f"{out}: {len(taken.wedges)} stereo wedges")


@sim.command()
def track(
    terrain: TerrainOption = None,
    seed: SeedOption = 1,
    rover: RoverOption = "k9",
    target: Annotated[
        str, typer.Option(help="rock id; default: the largest rock within 4 m of the origin")
    ] = "",
    start: Annotated[float, typer.Option(help="range to start from, metres")] = 10.0,
    step: Annotated[float, typer.Option(help="step, share of the range")] = 0.10,
    odometry: Annotated[float, typer.Option(help="odometry error, share of the distance")] = 0.05,
    sun_azimuth: AzimuthOption = None,
    sun_elevation: ElevationOption = None,
    lmst: LmstOption = 10.5,
    ls: SeasonOption = 0.0,
    latitude: LatitudeOption = -4.6,
    out: Annotated[Path | None, typer.Option(help="folder for the left subframes and track.json")] = None,
) -> None:
    """Approach a rock with the tracker in the loop and print what it knew at each stop."""
    import dataclasses
    import json

    import numpy as np

    from rover_iface.errors import TerrainFormatError
    from rover_iface.frames import Pose
    from rover_iface.simulator.approach import ApproachOptions, approach
    from rover_iface.streams import stream

    with refusals():
        light = _sun(sun_azimuth, sun_elevation, lmst, ls, latitude)
        ground, rig = _world(terrain, seed, rover)
        near = sorted(ground.rocks_near(0.0, 0.0, 4.0), key=lambda r: -r.diameter)
        rocks = [r for r in ground.rocks if r.id == target] if target else near[:1]
        if not rocks:
            what = f'rock "{target}"' if target else "rock within 4 m of the origin"
            raise TerrainFormatError(f'terrain "{ground.name}" has no {what}')
        rock = rocks[0]
        renderer = _renderer(ground, seed, 0.0, 0.0)
        # come from the sun's side: shadowed faces are not targets
        bearing = float(np.arctan2(light.direction[1], light.direction[0]))
        x, y = rock.x + start * np.cos(bearing), rock.y + start * np.sin(bearing)
        pose = Pose(float(x), float(y), ground.height_at(float(x), float(y), "rover"), bearing + np.pi)
        eye = pose.site_from_rover.apply(np.array(rig.pivot_rover))
        ray = np.array([rock.x, rock.y, rock.z + 0.6 * rock.height]) - eye
        ray /= np.linalg.norm(ray)
        point = eye + float(renderer.scene.ranges(eye, ray[None])[0]) * ray
        stops = approach(
            renderer,
            ground,
            rig,
            pose,
            point,
            light,
            rng=stream("approach", seed),
            options=ApproachOptions(step_share=step, odometry_error=odometry),
        )
    typer.echo("stop  range m  state    conf.  ncc   stereo  sigma cm  error cm  why")
    rows = []
    for number, stop in enumerate(stops):
        update = stop.update
        away = float(np.linalg.norm(point - stop.frame.camera.C))
        sigma = 100 * float(np.sqrt(np.linalg.eigvalsh(update.covariance).max()))
        row = {
            "stop": number,
            "range_m": away,
            "state": str(update.state),
            "confidence": update.confidence,
            "ncc": update.scores.get("ncc"),
            "stereo": update.scores.get("stereo"),
            "sigma_cm": sigma,
            "error_cm": 100 * stop.error_m if np.isfinite(stop.error_m) else None,
            "reasons": list(update.reasons),
            "pose": dataclasses.asdict(stop.pose),
        }
        rows.append(row)
        typer.echo(
            f"{number:4d}  {away:7.2f}  {update.state!s:8} {update.confidence:5.2f}  "
            f"{update.scores.get('ncc', 0):.2f}  {update.scores.get('stereo', 0):6.2f}  {sigma:8.1f}  "
            f"{100 * stop.error_m:8.1f}  {'; '.join(update.reasons)}"
        )
        if out is not None:
            _write_png(out / f"stop{number:02d}.png", stop.frame.image8)
    if out is not None:
        (out / "track.json").write_text(
            json.dumps({"format": "track/1", "rock": rock.id, "stops": rows}, indent=1)
        )


def _write_png(path: Path, image: Any) -> None:
    from PIL import Image

    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(image).save(path)
