"""What would help most: variants that give the plan a little more of each thing it may lack."""

from __future__ import annotations

from ground.campaigns.case import Case, observations_of
from ground.campaigns.variant import NamedCase, Variant, varied

MORE_TIME_S = 600.0
MORE_ENERGY_J = 36_000.0
"""Ten watt-hours."""
FEWER = 0.5


def help_cases(base: Case) -> tuple[NamedCase, ...]:
    """Return the questions that make sense for a plan: more of each budget it has, half the losses, half the
    spoilt observations. Only the abstract rover's odds can be asked about.
    """
    if base.rover != "abstract":
        return ()
    budgets = {b.resource for b in base.plan().budgets}
    asked = []
    if "time" in budgets:
        asked.append(Variant(f"time-plus-{MORE_TIME_S:g}-s", add_time_s=MORE_TIME_S))
    if "energy" in budgets:
        asked.append(Variant(f"energy-plus-{MORE_ENERGY_J:g}-j", add_energy_j=MORE_ENERGY_J))
    legs = base.problem.get("legs", ())
    if any(chance > 0 for leg in legs for chance in (leg.get("p_lose") or {}).values()):
        asked.append(Variant("half-the-losses-of-tracks", loss_factor=FEWER))
    made = (o for t in base.problem.get("targets", ()) for o in observations_of(t))
    if any((1.0 if (p := o.get("p_success")) is None else p) < 1.0 for o in made):
        asked.append(Variant("half-the-spoilt-observations", failure_factor=FEWER))
    return tuple(NamedCase(v.name, varied(v, base)) for v in asked)
