"""How surely a target that is not found is where it is believed.

Correlation fails in another light, behind dust, and where the rover has turned farther than it knows. The
first two leave the target where it was, the last does not, and no texture tells them apart. The surface does:
a stereo pair ranges rock and ground in any light. So what was ranged round the target when it was last seen
is registered with what is ranged now (`shape.register`), as K9 found its targets again at the end of a
traverse (Deans, Kunz, Sargent and others 2005, section 2). Where it fits within what dead reckoning errs, the
target is where it was; where it does not, something else stands there. The place itself is left as it is: in
a subframe that one face fills, surfaces fit as well several centimetres beside each other.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from rover_iface.cameras.model import Array
from rover_iface.frames import Transform
from rover_iface.vision.correlation.judging import ASTRAY, Followed
from rover_iface.vision.seen_relief import SeenRelief
from rover_iface.vision.shape import register
from rover_iface.vision.surface import ShapeOptions, surface_from_cloud

LOST, BELIEVED_M = 0.49, 0.05
"""Most confidence in a lost target, and how near to where it is believed it should lie, across the line of
sight: its confidence is the chance of that, times the most. Kim et al. 2009 count 3 cm as right."""
LEAST_ALIKE = 0.1
"""What is left of that chance where another surface stands at its place, or none is ranged: dust, and a panel
that stands in front, come with the right place too."""
STEP_PX = 2
"""Pixels between the points of the surfaces: 1 cm at 5 m, half of what GICP thins them to."""
NOISES = 2.0
"""Errors of both ranges by which points may lie apart and still be of one surface, from afar: at 6.6 m one
is 3 cm, and with the 5 cm that do near by every tenth point of the same ground lay before what was seen."""
INWARD_M = 0.05
"""How far inside its reach a registration must end: at the border of the search the best fit is the nearest
to another one. Two that were believed after an unknown turn (tuning seed 0) were 10 cm off, from there."""


def surface_agrees(track: Followed, relief: SeenRelief, covariance: Array) -> bool:
    """Return whether the surface round a lost target is seen where it should be.

    `relief` is what the new pair ranges there, `covariance` (3, 3), m^2, what the place where it is believed
    may be off.
    """
    last, believed = track.last, track.believed
    model = None if last.relief is None else last.relief.cloud
    scene = relief.cloud
    if model is None or scene is None:
        return False
    before, now = (surface_from_cloud(cloud, STEP_PX) for cloud in (model, scene))
    plain = ShapeOptions()
    options = replace(plain, cap_m=max(plain.cap_m, NOISES * math.hypot(before.noise_m, now.noise_m)))
    guess = Transform(np.eye(3), believed - last.point)
    found = register(before, now, guess, last.point, options)
    point = np.asarray(found.scene_from_model.apply(last.point), dtype=np.float64)
    gap = point - believed
    if not found.accepted or float(np.abs(gap).max()) > options.search_m - INWARD_M:
        return False
    return float(gap @ np.linalg.solve(covariance + found.covariance(), gap)) <= ASTRAY


def chance_believed(covariance: Array, ray: Array) -> float:
    """Return the chance that a place lies within `BELIEVED_M` of where it is told, across a ray (3,).

    By its covariance (3, 3), m^2, as if that were round across the ray.
    """
    along = ray / np.linalg.norm(ray)
    aside_m2 = 0.5 * (float(np.trace(covariance)) - float(along @ covariance @ along))
    return -math.expm1(-0.5 * BELIEVED_M**2 / aside_m2)
