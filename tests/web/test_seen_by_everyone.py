"""Keep-outs are told from the ground by every eye: in simulated colour-vision deficiencies and in grey."""

from __future__ import annotations

import io

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Page, expect

from tests.web.conftest import Server
from tests.web.page import chromium, field_of, open_demo, open_page, pixel

pytestmark = [pytest.mark.browser, pytest.mark.slow, pytest.mark.xdist_group("browser")]

EYES = ("none", "protanopia", "deuteranopia", "tritanopia", "achromatopsia")
"""What the browser can simulate."""
LEAST_CONTRAST = 3.0
"""WCAG 2.2, 1.4.11: graphics that are needed to understand the content."""


def luminance(page: Page) -> NDArray[np.float64]:
    """Return the relative luminance (WCAG 2.2) of every pixel of the page; shape (height, width)."""
    rgb = np.asarray(Image.open(io.BytesIO(page.screenshot())).convert("RGB")) / 255.0
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    found: NDArray[np.float64] = linear @ np.array([0.2126, 0.7152, 0.0722])
    return found


def ratio(one: float, other: float) -> float:
    return (max(one, other) + 0.05) / (min(one, other) + 0.05)


def test_keep_outs_stand_out_to_every_eye(server: Server) -> None:
    with chromium() as browser, open_page(browser, server, "?webgl=off") as page:
        open_demo(page)
        mission = page.url.split("#/m/")[1].split("?")[0].split("/")[0]
        polygon = field_of(page, server, f"/missions/{mission}/keep-outs")["items"][0]["polygon_m"]
        east, north = np.mean(polygon, axis=0)
        expect(page.get_by_test_id("map")).to_be_visible()
        x, y = (round(v) for v in pixel(page, float(east), float(north)))
        corners = np.array([pixel(page, *corner) for corner in polygon])
        half = max(12, int(0.3 * np.ptp(corners, axis=0).min()))
        away = round(float(np.ptp(corners, axis=0).max())) + 3 * half
        session = page.context.new_cdp_session(page)
        for eye in EYES:
            session.send("Emulation.setEmulatedVisionDeficiency", {"type": eye})
            page.wait_for_timeout(200)
            seen = luminance(page)
            inside = seen[y - half : y + half, x - half : x + half]
            ground = float(np.median(seen[y - half : y + half, x - away - half : x - away + half]))
            light, dark = np.quantile(inside, [0.9, 0.1])
            best = max(ratio(float(light), ground), ratio(float(dark), ground))
            assert best >= LEAST_CONTRAST, f"{eye}: {best:.2f} to one"
