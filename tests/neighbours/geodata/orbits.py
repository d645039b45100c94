"""Kernels of our own: Mars and Earth on their mean ellipses, written as an SPK by SPICE itself.

The elements are those of Standish, "Keplerian elements for approximate positions of the major planets", JPL,
for 1800 to 2050: semi-major axis (au), eccentricity, inclination, mean longitude, longitudes of perihelion
and node (degrees), each with its change a century. They are good to 0.01 degree.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
AU_KM = 149_597_870.7
OBLIQUITY_RAD = np.radians(23.43928)
ELEMENTS = {
    499: (
        (1.52371034, 0.09339410, 1.84969142, -4.55343205, -23.94362959, 49.55953891),
        (0.00001847, 0.00007882, -0.00813131, 19140.30268499, 0.44441088, -0.29257343),
    ),
    399: (
        (1.00000261, 0.01671123, -0.00001531, 100.46457166, 102.93768193, 0.0),
        (0.00000562, -0.00004392, -0.01294668, 35999.37244981, 0.32327364, 0.0),
    ),
}


def place_km(body: int, et: Floats) -> Floats:
    """Return places (n, 3) from the sun, km, J2000, at seconds past J2000."""
    first, change = (np.array(part)[:, None] for part in ELEMENTS[body])
    a, e, inclination, longitude, perihelion, node = first + change * (et / 86400.0 / 36525.0)
    inclination, node = np.radians(inclination), np.radians(node)
    omega = np.radians(perihelion) - node
    mean = np.radians(longitude - perihelion)
    anomaly = mean + e * np.sin(mean)
    for _ in range(12):
        anomaly = anomaly - (anomaly - e * np.sin(anomaly) - mean) / (1 - e * np.cos(anomaly))
    x, y = a * (np.cos(anomaly) - e), a * np.sqrt(1 - e**2) * np.sin(anomaly)
    px = np.cos(omega) * x - np.sin(omega) * y
    py = np.sin(omega) * x + np.cos(omega) * y
    ecliptic = np.array(
        [
            np.cos(node) * px - np.sin(node) * np.cos(inclination) * py,
            np.sin(node) * px + np.cos(node) * np.cos(inclination) * py,
            np.sin(inclination) * py,
        ]
    )
    c, s = np.cos(OBLIQUITY_RAD), np.sin(OBLIQUITY_RAD)
    return np.asarray((np.array([[1, 0, 0], [0, c, -s], [0, s, c]]) @ ecliptic).T * AU_KM)


def write_spk(spiceypy: Any, path: Path, first_et: float, last_et: float) -> None:
    """Write an SPK of sun, Earth and Mars; the sun rests."""
    et = np.arange(first_et - 10 * 86400.0, last_et + 10 * 86400.0, 43200.0)
    handle = spiceypy.spkopn(str(path), "made for tests", 0)
    for body in ELEMENTS:
        step = 600.0
        speed = (place_km(body, et + step) - place_km(body, et - step)) / (2 * step)
        states = np.ascontiguousarray(np.hstack([place_km(body, et), speed]))
        spiceypy.spkw09(handle, body, 10, "J2000", et[0], et[-1], f"{body}", 7, len(et), states, et)
    rest = np.zeros((2, 6))
    spiceypy.spkw09(handle, 10, 0, "J2000", et[0], et[-1], "sun", 1, 2, rest, et[[0, -1]])
    spiceypy.spkcls(handle)
