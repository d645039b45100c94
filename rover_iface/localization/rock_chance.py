"""How probably a patch above the ground is a rock: by its shape, and by its outline in the picture."""

from __future__ import annotations

import math
from dataclasses import replace

from rover_iface.localization.seen_rock import SeenRock

ROCK_SIGNS = (7.824, 2.434, 2.017, -1.928, -0.102, -0.179, 0.293, 2.956)
"""Logistic weights: a constant, then the signs of `rock_probability`."""


def rock_probability(signs: tuple[float, ...]) -> float:
    """Return the odds, as a probability, that a patch above the ground is a rock and no rise of it.

    `signs` are the logarithms of height, height over width and range (metres), how many deviations its face
    recedes beyond the limit, how much it recedes, and how far disparity falls (px) above its top and beside
    it: a rise goes over into the ground, a rock ends.
    """
    constant, *weights = ROCK_SIGNS
    level = constant + sum(weight * sign for weight, sign in zip(weights, signs, strict=True))
    return 1.0 / (1.0 + math.exp(-max(-30.0, min(30.0, level))))


OUTLINE_LAW = {True: (2.33, 0.11), False: (-3.16, 0.27)}
"""By whether the picture shows an outline: constant and slope of log odds over those of `rock_probability`.

Fitted on the 16 rendered stops of terrains 393882176 to 393882183, 1,103 patches: of those with an outline
93 % were rocks, of those without 8 %.
"""

OUTLINED_ENOUGH = 6
"""Outlined patches, more probably rocks than not, by which a stop's pictures show that rocks have outlines
there: as many as a leg asks of rocks (`FaultLimits.least_rocks`). With fewer a patch without one may still be
a rock, on ground as bright as the rocks are."""


def weighed_by_outlines(rocks: list[SeenRock], least_probability: float) -> list[SeenRock]:
    """Return rocks with the probabilities that they have given the outlines of the picture; those that are
    less than `least_probability` are left away.

    Without enough outlines in the pictures the rocks come back as they are.
    """
    if sum(bool(rock.outlined) and rock.probability > 0.5 for rock in rocks) < OUTLINED_ENOUGH:
        return rocks
    weighed = []
    for rock in rocks:
        constant, slope = OUTLINE_LAW[bool(rock.outlined)]
        odds = rock.probability / max(1.0 - rock.probability, 1e-9)
        probability = 1.0 / (1.0 + math.exp(-constant) * odds**-slope)
        if probability >= least_probability:
            weighed.append(replace(rock, probability=probability))
    return weighed
