"""A campaign as one page of HTML that loads nothing: distribution, tree, failures, convergence."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence

from ground.campaigns.folder import CampaignFolder
from ground.campaigns.result import CampaignResult, Difference, Frequency, Interval
from ground.campaigns.tree import conditions_of_options, frequency_tree
from ground.reports.page import CHART_H, CHART_W, histogram, page, safe, table
from ground.reports.plan_drawing import to_svg

SHOWN_MODES = 20
OUTSIDE = "(outside)"


def report_page(folder: CampaignFolder, result: CampaignResult) -> str:
    """Return the page of a campaign that has ended."""
    order = folder.order()
    plan = order.case().plan()
    name = plan.name or plan.id or folder.path.name
    tree = to_svg(frequency_tree(plan, result), outline=True)
    return page(f"Campaign: {name}", _parts(result, tree, conditions_of_options(plan)))


def _parts(result: CampaignResult, tree: str, taken_when: Mapping[str, str]) -> Iterator[str]:
    utility = result.utility
    last = result.seed + result.runs - 1
    yield (
        f"<p>{result.runs:,} runs on the rover {safe(result.rover)}, seeds {result.seed} to {last}. "
        f"Mean utility <b>{utility.mean:.3f}</b> ({_ends(utility.interval)}), standard deviation "
        f"{utility.sd:.2f}. Intervals are of 95 %."
        + (f" The campaign ended because {safe(result.stopped)}." if result.stopped else "")
        + "</p>"
    )
    if utility.predicted is not None and utility.deviation is not None:
        yield (
            f"<p>The planner expected {utility.predicted:.3f}; the mean is {utility.deviation:+.1f} standard "
            "errors from it.</p>"
        )
    yield "<h2>Distribution of the utility</h2>"
    bins = result.histogram
    if len(bins) > 1:
        edges = [*(b.low for b in bins), bins[-1].high]
        shares = [b.runs / result.runs for b in bins]
        yield histogram(edges, shares, "utility; the line is the mean", mark=utility.mean)
    else:
        yield f"<p>All runs earn {bins[0].low:g}.</p>"
    head = ("share of runs below", "utility", "interval", "end, s", "energy used, J")
    yield table(head, _quantiles(result), numbers=(0, 1, 2, 3, 4))
    yield "<h2>Outcomes and options</h2>"
    rows = [_frequency(f, taken_when) for f in result.frequencies]
    counted = ("what", "taken when", "runs", "share", "interval", "predicted")
    yield table(counted, rows, numbers=(2, 3, 4, 5))
    if not all(map(_within, result.frequencies)):
        yield (
            f"<p>{OUTSIDE}: the prediction lies outside the interval of the share that was flown. Of twenty "
            "right predictions one does by chance.</p>"
        )
    yield "<h2>The plan, by how often it came to each step</h2>"
    yield (
        "<p>After a step stand the shares of all runs in which it succeeded and in which it failed; a box is "
        "the darker, and its line the wider, the more runs came there.</p>"
    )
    yield f'<div class="tree">{tree}</div>'
    yield "<h2>What goes wrong</h2>"
    yield _failures(result) or "<p>Nothing failed in any run.</p>"
    yield "<h2>The worst runs</h2>"
    yield table(
        ("seed", "utility", "why"), [(w.seed, f"{w.utility:g}", w.why) for w in result.worst], numbers=(0, 1)
    )
    if result.helps:
        yield "<h2>What would help most</h2>"
        yield "<p>With this plan as it is, on the same seeds; a plan made for the change may earn more.</p>"
        yield _differences(result.helps)
    if result.variants:
        yield "<h2>Variants, on the same seeds</h2>"
        yield _differences(result.variants)
    yield "<h2>Convergence of the mean</h2>"
    yield convergence_chart(result.convergence)
    yield f"<p>campaign {result.campaign[:16]}, rows {result.digest[:16]}</p>"


def _ends(interval: Interval, pattern: str = "{:.3g}") -> str:
    low = "-" if interval.low is None else pattern.format(interval.low)
    high = "-" if interval.high is None else pattern.format(interval.high)
    return f"{low} to {high}"


def _quantiles(result: CampaignResult) -> Iterator[Sequence[object]]:
    utility = result.utility
    for name, value in utility.quantiles.items():
        yield (
            f"{float(name):.0%}",
            f"{value:.2f}",
            _ends(utility.quantile_intervals[name], "{:.2f}"),
            f"{result.end_s[name]:,.0f}",
            f"{result.energy_used_j[name]:,.0f}",
        )


def _frequency(found: Frequency, taken_when: Mapping[str, str]) -> Sequence[object]:
    predicted = "" if found.predicted is None else f"{found.predicted:.2%}"
    kind, _, option = found.what.partition(" ")
    named = kind == "option" and option.startswith("option")  # an id of the planner's says that it is one
    return (
        option if named else found.what,
        taken_when.get(option, "") if kind == "option" else "",
        f"{found.runs:,}",
        f"{found.share:.2%}",
        _ends(found.interval, "{:.2%}"),
        predicted + ("" if _within(found) else f" {OUTSIDE}"),
    )


def _within(found: Frequency) -> bool:
    """Return whether a prediction, if there is one, lies in the interval."""
    low, high = found.interval.low, found.interval.high
    return found.predicted is None or (low or 0.0) <= found.predicted <= (1.0 if high is None else high)


def _failures(result: CampaignResult) -> str:
    modes = result.failures
    rows = [
        (
            mode.task,
            mode.condition,
            mode.resource,
            f"{mode.runs:,}",
            f"{mode.share:.2%}",
            _ends(mode.interval, "{:.2%}"),
            f"{mode.mean_utility:.1f}",
            "" if mode.utility_without is None else f"{mode.utility_without:.1f}",
            ", ".join(map(str, mode.examples)),
        )
        for mode in modes[:SHOWN_MODES]
    ]
    head = (
        *("task", "what failed", "resource", "runs", "share", "interval", "mean utility", "of the others"),
        "seeds to replay",
    )
    more = (
        f"<p>{len(modes) - SHOWN_MODES} rarer ones are in campaign.json.</p>"
        if len(modes) > SHOWN_MODES
        else ""
    )
    return table(head, rows, numbers=(3, 4, 5, 6, 7)) + more


def _differences(found: Sequence[Difference]) -> str:
    rows = [
        (
            d.name,
            f"{d.runs:,}",
            f"{d.mean:+.3f}",
            _ends(d.interval, "{:+.3f}"),
            f"{d.better:,}",
            f"{d.worse:,}",
            "" if d.variance_ratio is None else f"{d.variance_ratio:.1f}",
        )
        for d in found
    ]
    head = (
        "change",
        "pairs",
        "mean utility",
        "interval",
        "better in",
        "worse in",
        "runs saved by pairing, times",
    )
    return table(head, rows, numbers=(1, 2, 3, 4, 5, 6))


def convergence_chart(points: Sequence[tuple[int, float, float]]) -> str:
    """Return the mean and its interval over the number of runs (logarithmic), as SVG."""
    import math

    shown = [(runs, mean, error) for runs, mean, error in points if runs > 1 and math.isfinite(error)]
    if len(shown) < 2:
        return "<p>Too few runs for a curve.</p>"
    low = min(mean - 2 * error for _, mean, error in shown)
    high = max(mean + 2 * error for _, mean, error in shown)
    first, last = math.log(shown[0][0]), math.log(shown[-1][0])

    def place(runs: int, value: float) -> str:
        x = CHART_W * (math.log(runs) - first) / (last - first)
        y = CHART_H * (1 - (value - low) / max(high - low, 1e-9))
        return f"{x:.1f},{y:.1f}"

    band = [place(r, m + 2 * e) for r, m, e in shown] + [place(r, m - 2 * e) for r, m, e in reversed(shown)]
    line = " ".join(place(r, m) for r, m, _ in shown)
    labels = "".join(
        f'<text x="{CHART_W * (math.log(r) - first) / (last - first):.1f}" y="{CHART_H + 14}" '
        f'text-anchor="{anchor}">{r:,}</text>'
        for r, anchor in (
            (shown[0][0], "start"),
            (shown[len(shown) // 2][0], "middle"),
            (shown[-1][0], "end"),
        )
    )
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="mean utility over runs" '
        f'viewBox="-60 -14 {CHART_W + 80:.0f} {CHART_H + 60:.0f}" width="{CHART_W + 80:.0f}" '
        f'height="{CHART_H + 60:.0f}" font-family="sans-serif" font-size="11" fill="#14202a">'
        f'<polygon points="{" ".join(band)}" fill="#cfe3ee"/>'
        f'<polyline points="{line}" fill="none" stroke="#2b7fa8" stroke-width="2"/>'
        f'<line x1="0" y1="{CHART_H}" x2="{CHART_W}" y2="{CHART_H}" stroke="#44545f"/>'
        f'<text x="-6" y="8" text-anchor="end">{high:.2f}</text>'
        f'<text x="-6" y="{CHART_H}" text-anchor="end">{low:.2f}</text>{labels}'
        f'<text x="{CHART_W / 2}" y="{CHART_H + 32}" text-anchor="middle">runs; the band is two standard '
        "errors to each side</text></svg>"
    )


def summary_lines(result: CampaignResult) -> Iterator[str]:
    """Yield what a terminal is told of a campaign."""
    utility = result.utility
    yield (
        f"{result.runs:,} runs: utility {utility.mean:.3f} +- {utility.standard_error:.3f}, 5 % below "
        f"{utility.quantiles['0.05']:g}, 5 % above {utility.quantiles['0.95']:g}"
    )
    shares = ", ".join(f"{name} {count / result.runs:.2%}" for name, count in result.outcomes.items())
    yield f"  outcomes  {shares}"
    for mode in result.failures[:5]:
        seeds = ", ".join(map(str, mode.examples))
        yield f"  {mode.share:7.2%}  {mode.task}: {mode.condition}  (seeds {seeds})"
    for found in (*result.helps[:3], *result.variants):
        ends = _ends(found.interval, "{:+.3f}")
        yield f"  {found.name}: {found.mean:+.3f} ({ends}) over {found.runs:,} pairs"
