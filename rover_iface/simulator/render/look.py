"""How rough and how sandy surfaces look below their triangles."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from rover_iface.errors import RenderError


@dataclass(frozen=True, slots=True)
class Look:
    """How rough the surface is below the triangles; the defaults pass the texture acceptance test.

    Attributes
    ----------
    soil_slope, stone_slope
        Slope of an octave of bumps, of soil and of rock.
    mottle
        Brightness of an octave of rock, share of its albedo.
    bounce
        Light from the sunlit ground on what faces down, against that of the sky on what faces up.
    soil_mottle
        Factor on how much the soil's brightness varies.
    sand
        Share of the ground under drifts of fine sand, 0..1: quiet places between the stones.
    grain
        Brightness of soil's grains that a pixel does not resolve, share of its albedo.
    gravel_mottle
        Factor on how much the brightness of gravel varies.
    close_up
        Strength of single grains of sand and of rock in pictures that resolve them, 0..1.
    ripples, wind_rad
        Steepest slope of the wind ripples on sand, 10 cm apart, and the azimuth that the wind comes from.
    """

    soil_slope: float = 0.10
    stone_slope: float = 0.06
    mottle: float = 0.11
    bounce: float = 0.7
    soil_mottle: float = 1.0
    sand: float = 0.0
    grain: float = 0.0
    ripples: float = 0.0
    wind_rad: float = 0.0
    gravel_mottle: float = 1.0
    close_up: float = 0.0

    def __post_init__(self) -> None:
        if not 0.0 <= self.sand <= 1.0:
            raise RenderError(f"look has sand on a share of {self.sand} of the ground; 0 to 1 is possible")
        if not 0.0 <= self.grain <= 1.0:
            raise RenderError(f"look has grain of {self.grain}; 0 to 1 is possible")
        if not 0.0 <= self.ripples <= 0.5:
            raise RenderError(f"look has ripples of slope {self.ripples}; 0 to 0.5 is possible")
        if not 0.0 <= self.close_up <= 1.0:
            raise RenderError(f"look has grains in close-ups of strength {self.close_up}; 0 to 1 is possible")
        if not 0.0 <= self.gravel_mottle <= 2.0:
            raise RenderError(f"look has a gravel mottle of {self.gravel_mottle}; 0 to 2 is possible")
        if not 0.0 <= self.soil_mottle <= 4.0:
            raise RenderError(f"look has a soil mottle of {self.soil_mottle}; 0 to 4 is possible")

    def parameters(self) -> npt.NDArray[np.float64]:
        """Return the look [11] as `shade.radiance` takes it."""
        return np.array(
            (
                self.soil_slope,
                self.stone_slope,
                self.mottle,
                self.bounce,
                self.soil_mottle,
                self.sand,
                self.grain,
                self.ripples,
                self.wind_rad,
                self.gravel_mottle,
                self.close_up,
            )
        )


SANDY = Look(soil_slope=0.15, soil_mottle=0.4, sand=0.6, grain=0.1)
"""Ground like Spirit's: much of it under sand, less blotchy, with grain. Set on eight Mars frames beside
terrains 5000 to 9108, and judged beside others by `studies/picture_page.py`."""
