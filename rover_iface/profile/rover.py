"""A rover by its profile: what the file holds, and what is asked of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from executive.crl.dictionary import Dictionary
from mission.errors import MissionError
from mission.instrument import USUAL_ACTIONS, Instrument, Use
from mission.values import value
from rover_iface.errors import ProfileError
from rover_iface.profile.dictionary import STANDARD_DICTIONARY, standard_dictionary
from rover_iface.profile.parts import Activity, Arm, Body, Cameras, LegModel, Mast, Mobility, Power, Wheels


@value
class ProfileFile:
    """What a profile file holds: metres, radians, rover frame (x forward, y left, z up, origin on the
    ground).

    `dictionary` names a dictionary that comes with the program, or a file beside the profile.
    """

    name: str
    version: str
    body: Body
    wheels: Wheels
    mobility: Mobility
    power: Power
    mast: Mast
    arm: Arm
    cameras: Cameras
    leg_model: LegModel
    instruments: Mapping[str, Instrument]
    activities: Mapping[str, Activity]
    doc: str = ""
    dictionary: str = STANDARD_DICTIONARY

    def __post_init__(self) -> None:
        held: dict[str, str] = {name: name for name in self.instruments}
        for name, instrument in self.instruments.items():
            if instrument.alias and held.setdefault(instrument.alias, name) != name:
                raise MissionError(
                    f'instruments.{name}.alias is "{instrument.alias}", which the instrument '
                    f"{held[instrument.alias]} has already"
                )


@dataclass(frozen=True, slots=True)
class RoverProfile(ProfileFile):
    """What a rover is, with its dictionary.

    Attributes
    ----------
    sha256
        Of the profile's file.
    camera_set
        Where its camera set is: a name or the path of a file.
    language
        Content of its dictionary: what it can be told, and what it tells.
    """

    sha256: str = field(default="", compare=False)
    camera_set: str = field(default="", compare=False)
    language: Dictionary = field(default_factory=standard_dictionary, compare=False)

    def activity(self, name: str) -> Activity:
        """Return the times of an activity, zero when the profile does not list it."""
        return self.activities.get(name, Activity())

    def instrument_key(self, name: str) -> str:
        """Return the profile's name of an instrument, given that or its alias.

        Raises
        ------
        ProfileError
            If the rover has no such instrument.
        """
        if name in self.instruments:
            return name
        for key, instrument in self.instruments.items():
            if instrument.alias == name:
                return key
        raise ProfileError(
            f'rover "{self.name}" has no instrument "{name}"; it carries {", ".join(self.instrument_names())}'
        )

    def instrument(self, name: str) -> Instrument:
        """Return one instrument by name or alias; raises as `instrument_key` does."""
        return self.instruments[self.instrument_key(name)]

    def instrument_names(self) -> list[str]:
        """Return the names under which requests hold the instruments, sorted."""
        return sorted(instrument.alias or key for key, instrument in self.instruments.items())

    def usual_action(self, action: str, parameters: Mapping[str, object]) -> str:
        """Return the action that a rover carries a command out as.

        An action that the dictionary gives to an instrument goes as the usual one of that instrument's use:
        a drill is placed as any contact instrument is.
        """
        spec = self.language.commands.actions.get(action)
        if spec is None or not spec.instrument or action in USUAL_ACTIONS.values():
            return action
        figures = self.instruments.get(str(parameters.get(spec.instrument, "")))
        return action if figures is None else USUAL_ACTIONS[figures.use]

    def usual_instrument(self, use: Use) -> str:
        """Return the profile's name of the first instrument of a use.

        Raises
        ------
        ProfileError
            If it has none.
        """
        for key, instrument in self.instruments.items():
            if instrument.use is use:
                return key
        raise ProfileError(f'rover "{self.name}" has no {use} instrument')
