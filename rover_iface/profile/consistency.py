"""Whether a profile and its dictionary speak of the same rover."""

from __future__ import annotations

from executive.crl.dictionary import Dictionary
from mission.instrument import Instrument
from rover_iface.profile.rover import ProfileFile

PARTS = ("mobility", "mast", "arm", "cameras", "power")
"""Parts of a rover that an action may need."""


def contradiction(profile: ProfileFile, language: Dictionary) -> str:
    """Return in what a dictionary contradicts a profile, the first thing found; empty if in nothing."""
    actions = language.commands.actions
    carried = ", ".join(sorted(profile.instruments)) or "none"
    for name, action in actions.items():
        if action.activity and action.activity not in profile.activities:
            return (
                f'action "{name}" takes its time from the activity "{action.activity}", which the profile '
                f"lacks; it has {', '.join(sorted(profile.activities))}"
            )
        for part in action.needs:
            if part not in PARTS:
                return f'action "{name}" needs "{part}"; a rover has {", ".join(PARTS)}'
        named = action.parameter(action.instrument) if action.instrument else None
        for choice in named.choices if named is not None else ():
            if choice not in profile.instruments:
                return (
                    f'action "{name}" lets its {action.instrument} be "{choice}", which the profile lacks; '
                    f"it carries {carried}"
                )
    for name, instrument in profile.instruments.items():
        wrong = _misused(name, instrument, language)
        if wrong:
            return wrong
    return ""


def _misused(name: str, instrument: Instrument, language: Dictionary) -> str:
    """Return what is wrong with the action that uses an instrument, or an empty string."""
    actions = language.commands.actions
    action = actions.get(instrument.used_by)
    if action is None:
        return (
            f'instrument "{name}" is used by the action "{instrument.used_by}", which the dictionary lacks; '
            f"it has {', '.join(actions)}"
        )
    for parameter in ("target", "instrument"):
        spec = action.parameter(parameter)
        if spec is None:
            known = ", ".join(p.name for p in action.parameters) or "none"
            return (
                f'instrument "{name}" is used by the action "{action.name}", which has no parameter '
                f'"{parameter}"; it has {known}'
            )
        if parameter == "instrument" and spec.choices and name not in spec.choices:
            return (
                f'instrument "{name}" is used by the action "{action.name}", whose instrument must be one of '
                f"{', '.join(spec.choices)}"
            )
    return ""
