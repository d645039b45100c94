"""Numbers that steer planning, each with its reason and where it is from; a file may change them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from annotated_types import Ge, Le

from mission.codec import Codec, read_toml
from mission.errors import MissionError
from mission.values import NotNegative, Positive, value
from planner.errors import PlannerError

Nodes = tuple[Annotated[int, Ge(3), Le(2001)], Annotated[int, Ge(3), Le(2001)]]
"""Grid nodes in time and in drive energy."""

Count = Annotated[int, Ge(1)]


@value
class PlannerOptions:
    """How planning spends its work.

    Seconds are those of a processor of 2.1 GHz as `planner.tally` reckons them. "By hand" says that a number
    was chosen for the reason given and not fitted to any set of problems.
    """

    search_nodes: Nodes = (49, 29)
    """Grid of the search. By hand: 8 targets fill their table in 0.14 s."""

    coarse_nodes: Nodes = (33, 21)
    """Grid of the search where the table is large: 0.49 of the nodes."""

    quick_nodes: Nodes = (25, 15)
    """Grid of a quick search: 0.26 of the nodes."""

    notes_nodes: Nodes = (61, 37)
    """Grid of the notes on a finished plan, the coarser one of the evaluator (`propagate.COARSE`)."""

    many_live_sets: Count = 5_000
    """Live sets above which a table is large: in single precision 284 MB for ten places on `search_nodes`."""

    most_noted_tracks: Count = 9
    """Targets tracked at once up to which notes come from a grid; each doubles its states. By hand."""

    bound_s: Positive = 1.8
    """Processor seconds, as reckoned, for the table of an upper bound. By hand: with 8 targets a final plan
    comes within 10 s, and bounds are 0.2 to 0.3 % looser than with 2.8 s."""

    bound_s_per_target: NotNegative = 30.0
    """More of them for each target above 8, as far as the limit has them left. By hand: with 10 targets all
    that a limit of 60 s leaves, 2.3 % from the plan on a day where half of it left 2.4 %."""

    hasty_bound_s: Positive = 0.06
    """Processor seconds for an upper bound that somebody waits for. By hand."""

    search_s: Positive = 2.8
    """Processor seconds for the search with up to 8 targets and 6 branches. By hand, see `bound_s`: on three
    days of 8 targets plans were the same with 4.5 s, and 0.7 % worse on one with 2 s; the first passes of the
    search take a quarter of it (`growing.PASSES`)."""

    search_s_per_target: NotNegative = 1.0
    """More of them for each target above 8. By hand: with 10 targets a longer search wins less than growing
    options again (`sampled.raced_lines`)."""

    quick_search_s: Positive = 0.3
    """Processor seconds for a quick search beside its table: an answer within a second."""

    quick_plans: Count = 2
    """Cuts of the route on mean values that a search begins with. By hand."""

    main_lines: Count = 4
    """Unbranched plans that options are grown from (`growing.py`). By hand."""

    tolerance: Positive = 2e-4
    """Share of the value that an option must win. By hand: below the grid's own error of 5e-4."""

    quick_tolerance: Positive = 1e-3
    """The same for a quick search, on its coarser grid. By hand."""

    first_price: Positive = 0.1
    """First multiplier of an overrun under a chance constraint, as a share of all utility. By hand: the
    multiplier is then raised fourfold or halved as needed (`chance.plans_within`)."""

    check_futures: Count = 200_000
    """Futures of the Monte Carlo check: an error of the mean of 1/447 of the standard deviation of a day."""

    long_check_futures: Count = 1_000_000
    """The same for more than 8 targets: 1/1000. By hand: half a second, for 0.1 % of what is certified."""

    quick_check_futures: Count = 20_000
    """The same for a quick answer: 1/141."""

    glance_futures: Count = 4_096
    """The same where the plan alone is asked for, and who asks checks it: one chunk of the simulation."""

    def __post_init__(self) -> None:
        if self.hasty_bound_s > self.bound_s:
            raise MissionError(f"hasty_bound_s is {self.hasty_bound_s:g}; it must be at most bound_s")


OPTIONS = Codec(PlannerOptions, "planner-options/1", "planner options", error=PlannerError)


def load_options(path: Path) -> PlannerOptions:
    """Return the options in a TOML file of the members of `PlannerOptions` that differ from the defaults.

    Raises
    ------
    PlannerError
        If the file cannot be read, is not TOML, or holds a member or value that is not possible.
    """
    try:
        raw = path.read_bytes()
    except OSError as err:
        raise PlannerError(f"options file {path}: {err.strerror or err}") from err
    document = read_toml(raw, f"options file {path}", PlannerError)
    return OPTIONS.from_document({"format": OPTIONS.format, **document}, f"options file {path}")
