"""The `full` rover: everything in the loop, from rendered stereo to the tool on the rock.

It drives by a hazard map made of dense stereo of rendered navcam pairs, follows its targets by SIFT features
on full-resolution pairs round them, registers what it sees on arrival with what it saw before, hands the
target to the hazcams by the cascade that tests itself, judges by their cloud whether and where the tool may
touch, moves an arm of five joints there until its sensors report contact, and brings a close-up of the
microscopic imager. The sun moves, and the rover's own shadow is in its pictures. Body, slip, drift, power and
faults are those of the `subframe` rover.
"""

from __future__ import annotations

from functools import partial

from rover_iface.behaviour import repertoire
from rover_iface.simulator import subframe_rover

make_rover = partial(subframe_rover.make_rover, make=repertoire.full, own_shadow=True)
"""The entry point `full` of the group `outcrop.rovers`; see `subframe_rover.make_rover`."""
