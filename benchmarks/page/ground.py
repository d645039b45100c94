"""The ground: its bytes on the wire, when it is drawn and sharp at 10 Mbit/s, and how the 3D view turns."""

from __future__ import annotations

import io
import math
import statistics
import zipfile
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.error import HTTPError

import numpy as np
from playwright.sync_api import Browser, CDPSession

from benchmarks.common.browser import busy_s, page_of
from benchmarks.common.figure import Figure
from tests.web.conftest import Server
from tests.web.missions import ask, uploaded

FIRST_LOAD_MOST_KB, FIRST_GROUND_MOST_KB = 300.0, 300.0
DRAWN_MOST_S, SHARP_MOST_S = 1.0, 3.0
FRAMES_LEAST, SHARE_LEAST = 20.0, 0.5
HEAP_MOST_MB = 150.0
MBIT = 10.0
LATENCY_MS = 20.0
"""Of the emulated link, each way and back."""
ORBIT_S = 5.0
TARGETS = 200
SHARED = Path(__file__).resolve().parents[3] / "shared" / "data" / "terrain" / "msl_onsight" / "murray_buttes"


OPENED = """async ([rest, element]) => {
  const began = Date.now();
  let first = 0;
  location.hash = rest;
  for (;;) {
    await new Promise(requestAnimationFrame);
    const seen = document.querySelector(`[data-testid=${element}]`)?.dataset.ground ?? '';
    if (seen !== '' && first === 0) first = Date.now();
    if (seen === 'sharp') return [began / 1000, first / 1000, Date.now() / 1000];
  }
}"""
"""When a mission is opened, its first ground is drawn, and drawn as sharp as its picture is; since 1970."""


class Wire:
    """Bytes that come over the network, as they were sent, each with when it came; and a slower link."""

    def __init__(self, session: CDPSession) -> None:
        self.session = session
        self._came: list[tuple[float, str, float]] = []
        self._ended: dict[str, tuple[float, float]] = {}
        self._epoch_s = 0.0
        session.send("Network.enable")
        session.send("Network.setCacheDisabled", {"cacheDisabled": True})
        session.on("Network.requestWillBeSent", self._sent)
        session.on("Network.dataReceived", self._part)
        session.on("Network.loadingFinished", self._whole)

    def _sent(self, event: dict[str, Any]) -> None:
        self._epoch_s = event["wallTime"] - event["timestamp"]

    def _part(self, event: dict[str, Any]) -> None:
        self._came.append((event["timestamp"], event["requestId"], event["encodedDataLength"]))

    def _whole(self, event: dict[str, Any]) -> None:
        self._ended[event["requestId"]] = event["timestamp"], event["encodedDataLength"]

    def kb_until(self, utc_s: float) -> float:
        """Return kB that had come by a moment (seconds since 1970), heads of answers included."""
        at = utc_s - self._epoch_s
        ended = {name: size for name, (end, size) in self._ended.items() if end <= at}
        parts = sum(size for end, name, size in self._came if end <= at and name not in ended)
        return (sum(ended.values()) + parts) / 1000

    def throttle(self, mbit_s: float) -> None:
        """Let so much through, and no more, from now on."""
        rate = mbit_s * 1e6 / 8
        ways = {"downloadThroughput": rate, "uploadThroughput": rate}
        self.session.send(
            "Network.emulateNetworkConditions", {"offline": False, "latency": LATENCY_MS, **ways}
        )


def figures(browser: Browser, server: Server, repeat: int) -> Iterator[Figure]:
    """Yield what the ground costs, on Murray Buttes where its data are, else on ground from a seed."""
    name, mission = murray_buttes(server)
    plain, with_targets = mission, _with_targets(server, mission)
    for view, query in (("map", ""), ("3D", "?view=scene")):
        found = [_first_ground(browser, server, f"#/m/{plain}{query}", view) for _ in range(repeat)]
        load, ground, drawn, sharp = (statistics.median(part) for part in zip(*found, strict=True))
        if view == "map":
            yield Figure("first load on the wire, to the list of missions", load, "kB", FIRST_LOAD_MOST_KB)
        yield Figure(f"{name}, {view}: first ground on the wire", ground, "kB", FIRST_GROUND_MOST_KB)
        yield Figure(f"{name}, {view}: drawn at {MBIT:g} Mbit/s", drawn, "s", DRAWN_MOST_S)
        yield Figure(f"{name}, {view}: sharp at {MBIT:g} Mbit/s", sharp, "s", SHARP_MOST_S)
    for place, there in (
        (name, plain),
        (f"{name}, {TARGETS} targets", with_targets),
        ("1 km of ground", _kilometre(server)),
    ):
        frames, share, busy, heap = _orbit(browser, server, there)
        yield Figure(f"{place}: orbited, software GL", frames, "frames/s", FRAMES_LEAST, least=True)
        yield Figure(f"{place}: share of the linear resolution", share, "", SHARE_LEAST, least=True)
        yield Figure(f"{place}: a frame, main thread", busy, "ms")
        yield Figure(f"{place}: heap", heap, "MB", HEAP_MOST_MB)


def _first_ground(
    browser: Browser, server: Server, rest: str, view: str
) -> tuple[float, float, float, float]:
    """Return kB of the first load and of the first ground, and seconds until this is drawn and is sharp.

    The list of missions is loaded first, on the full link; the mission is opened over the throttled one.
    """
    with page_of(browser) as (page, session):
        wire = Wire(session)
        page.goto(f"{server}/")
        page.get_by_role("link").first.wait_for()
        page.wait_for_load_state("networkidle")
        load = wire.kb_until(math.inf)
        wire.throttle(MBIT)
        began, first, sharp = page.evaluate(OPENED, [rest, "map" if view == "map" else "scene"])
        page.wait_for_timeout(200)
        return load, wire.kb_until(first) - load, first - began, sharp - began


def _orbit(browser: Browser, server: Server, mission: str) -> tuple[float, float, float, float]:
    """Return frames a second while the view is turned, the least share of the window's resolution that they
    have, milliseconds of the main thread a frame, and MB of the heap with what lies beside it.
    """
    with page_of(browser) as (page, session):
        page.goto(f"{server}/#/m/{mission}?view=scene")
        page.wait_for_selector("[data-testid=scene][data-ready=true]")
        page.wait_for_timeout(3000)
        before = busy_s(session)
        frames, share = page.evaluate(
            """async ([seconds]) => {
                const canvas = document.querySelector('[data-testid=scene]');
                const box = canvas.getBoundingClientRect();
                canvas.setPointerCapture = canvas.releasePointerCapture = () => {};
                const send = (to, type, x, y) => to.dispatchEvent(new PointerEvent(type, {
                    pointerId: 1, button: 0, buttons: 1, pointerType: 'mouse', bubbles: true,
                    clientX: box.left + x, clientY: box.top + y }));
                const [x, y] = [box.width / 2, box.height / 2];
                send(canvas, 'pointerdown', x, y);
                const began = performance.now();
                const first = Number(canvas.dataset.drawn);
                let share = Infinity;
                while (performance.now() - began < 1000 * seconds) {
                    const phase = (performance.now() - began) / 700;
                    const [u, v] = [x + 250 * Math.sin(phase), y + 60 * Math.sin(phase / 2)];
                    send(canvas, 'pointermove', u, v);
                    await new Promise(requestAnimationFrame);
                    share = Math.min(share, canvas.width / (box.width * devicePixelRatio));
                }
                const drawn = Number(canvas.dataset.drawn) - first;
                send(canvas, 'pointerup', x, y);
                return [drawn / seconds, share];
            }""",
            [ORBIT_S],
        )
        busy = 1000.0 * (busy_s(session) - before) / max(1.0, frames * ORBIT_S)
        session.send("HeapProfiler.collectGarbage")
        used = session.send("Runtime.getHeapUsage")
        heap = used["usedSize"] + used.get("embedderHeapUsedSize", 0.0) + used.get("backingStorageSize", 0.0)
        return frames, share, busy, heap / 1e6


def murray_buttes(server: Server) -> tuple[str, str]:
    """Return the name and id of a mission on Murray Buttes; on ground from a seed where its data are not."""
    if not SHARED.is_dir():
        terrain = {"source": "generated", "seed": 1, "size_m": 128.0}
        return "seed 1", _mission(server, "Seed 1", terrain)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w") as zipped:
        for path in sorted(SHARED.iterdir()):
            if path.suffix != ".glb":
                zipped.write(path, path.name)
    found = uploaded(server, "murray_buttes.zip", packed.getvalue())
    return "Murray Buttes", _mission(server, "Murray Buttes", {"source": "uploaded", "upload_id": found})


def _kilometre(server: Server) -> str:
    """Return a mission on 1 km of hills, a height every metre and a picture of 0.5 m."""
    import rasterio
    from PIL import Image
    from rasterio.transform import from_origin

    rng = np.random.default_rng(1)
    side = 1024
    heights = np.zeros((side, side))
    for power in range(2, 7):
        coarse = rng.normal(size=(2**power, 2**power)) * 24.0 / 2**power
        heights += np.asarray(Image.fromarray(coarse).resize((side, side), Image.Resampling.BICUBIC))
    with rasterio.MemoryFile() as file:
        shape = {"driver": "GTiff", "height": side, "width": side, "count": 1, "dtype": "float32"}
        with file.open(**shape, transform=from_origin(-side / 2, side / 2, 1.0, 1.0)) as dataset:
            dataset.write(heights.astype(np.float32), 1)
        dem = uploaded(server, "kilometre.tif", file.read())
    shade = np.clip(128 + 400 * np.asarray(np.gradient(heights, axis=1)), 0, 255).astype(np.uint8)
    picture = io.BytesIO()
    Image.fromarray(shade).convert("RGB").resize((2 * side, 2 * side)).save(picture, "JPEG", quality=85)
    ortho = uploaded(server, "kilometre.jpg", picture.getvalue())
    terrain = {"source": "uploaded", "upload_id": dem, "ortho_upload_id": ortho}
    return _mission(server, "A kilometre", terrain)


def _mission(server: Server, name: str, terrain: Mapping[str, object]) -> str:
    body = {"name": name, "notes": "", "rover_profile": "k9", "terrain": terrain, "demo_content": False}
    return str(ask(server, "/missions", body)["id"])


def _with_targets(server: Server, mission: str) -> str:
    """Return a copy of a mission with 200 targets."""
    copy = str(ask(server, f"/missions/{mission}/copy", {"name": "Two hundred"})["id"])
    rng, made = np.random.default_rng(2), 0
    while made < TARGETS:
        east, north = (round(float(x), 2) for x in rng.uniform(-14.0, 14.0, 2))
        with suppress(HTTPError):  # ground that no camera saw takes no target
            ask(server, f"/missions/{copy}/targets", {"name": f"S{made}", "east_m": east, "north_m": north})
            made += 1
    return copy
