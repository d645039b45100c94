"""Rover profiles: one TOML file holds what a rover is, and every room reads it from here.

`load_profile("k9")` reads a profile by name, `load_profile(Path("mine.toml"))` any other.
"""

from rover_iface.profile.consistency import PARTS, contradiction
from rover_iface.profile.dictionary import STANDARD_DICTIONARY, dictionary_file, standard_dictionary
from rover_iface.profile.load import PROFILES, load_profile, profile_names
from rover_iface.profile.parts import Activity, Arm
from rover_iface.profile.rover import RoverProfile

__all__ = [
    "PARTS",
    "PROFILES",
    "STANDARD_DICTIONARY",
    "Activity",
    "Arm",
    "RoverProfile",
    "contradiction",
    "dictionary_file",
    "load_profile",
    "profile_names",
    "standard_dictionary",
]
