"""Results in sentences, and numbers as text."""

import math
from collections.abc import Sequence

import numpy as np

from baselines.controllers.registry import POLICIES
from baselines.experiments.estimates import MIN_VERDICT_EPISODES, Interval, negative
from baselines.experiments.statistics import Results

MAX_DECIMALS = 4
"""A hundredth of a per cent of the costs here; means are not known more closely."""
Cells = tuple[str, str, str]
"""Mean, low and high end of its interval as text."""


def headline(results: Results) -> str:
    """The best policy of an environment and its margin, in one sentence."""
    best = results.best
    verb = "costs least" if results.count(best) >= MIN_VERDICT_EPISODES else "has the lowest mean cost"
    parts = [f"{best} {verb}, {numbers(results.cost(best))[0]} m/s"]
    if results.cost_ratios:
        ratio, low, high = numbers(results.cost_ratios[best])
        parts.append(f"{ratio} [{low}, {high}] times the bound")
    parts.append(f"{duration(results.flown.action_time_us(best))} per action")
    rest = [_rival(results, name, role) for role, name in _rivals(results)]
    return "; ".join([", ".join(parts), *rest]) + "."


def _rivals(results: Results) -> list[tuple[str, str]]:
    """The next policy, and the best of the other kind, classical or learned, if that is another: role and name."""
    others = [name for name in results.ranking if name != results.best]
    classical = results.best in POLICIES
    unlike = [name for name in others if (name in POLICIES) != classical]
    rank = results.ranking.index
    role = "next in rank is" if others and rank(others[0]) > rank(results.best) else "ranked before it by estimate is"
    rivals = [(role, others[0])] if others else []
    if unlike and unlike[0] != others[0]:
        rivals.append(("the best learned policy is" if classical else "the best classical policy is", unlike[0]))
    return rivals


def _rival(results: Results, name: str, role: str) -> str:
    """A policy's paired difference to the best, and whether it is significant."""
    behind = results.behind(results.best, name)
    mean, low, high = numbers(behind)
    cost = results.cost_flown(results.best, name)[0]
    share = f" ({number(100 * abs(behind[0]) / cost)} %)" if cost > 0 else ""
    common = results.common(name, results.best)
    side = "above" if behind[0] >= 0 else "below"
    if behind[0] < 0:
        mean, low, high = numbers(negative(behind))
    verdict = _verdict(results, name)
    return f"{role} {name}, {mean} [{low}, {high}] m/s{share} {side} it on the same {common} seeds: {verdict}"


def _verdict(results: Results, name: str) -> str:
    verdict = results.verdict(name, results.best)
    if verdict is None:
        return "too few for a verdict"
    return "significant" if verdict else "not significant"


def reading(results: Results) -> list[str]:
    """The result in plain sentences."""
    best = results.best
    dv, error = (numbers(results.interval(best, metric))[0] for metric in ("delta_v_m_s", "position_error_mean_m"))
    lines = [
        f"{best} costs {numbers(results.cost(best))[0]} m/s per episode on average, of which {dv} m/s is thrust; its "
        f"mean position error in hold is {error} m. It takes {duration(results.flown.action_time_us(best))} per action."
    ]
    others = [name for name in results.ranking if name != best]
    if others:
        lines.append(_comparison(results, others[0]))
    if results.cost_ratios:
        lines.append(_against_bound(results))
    early = [
        f"{name} in {count} of {results.count(name)}"
        for name in results.ranking
        if (count := results.ended_early(name))
    ]
    if early:
        lines.append(
            f"Episodes that a limit ended early: {', '.join(early)}. Their remaining steps count as flown at the "
            "distance limit."
        )
    return lines


def _against_bound(results: Results) -> str:
    """The best policy against the perfect-information bound."""
    assert results.bounds is not None
    ratio, low, high = numbers(results.cost_ratios[results.best])
    return (
        f"With perfect foresight, {number(float(results.bounds.mean()))} m/s suffices: "
        f"{results.best} costs {ratio} times the bound of each seed (95 % interval {low} to {high})."
    )


def _comparison(results: Results, second: str) -> str:
    """Best against second best, on the same seeds."""
    best = results.best
    behind = results.behind(best, second)
    more, difference = ("more", behind) if behind[0] >= 0 else ("less", negative(behind))
    mean, low, high = numbers(difference)
    common = results.common(best, second)
    ours, theirs = (results.flown.episodes[name]["return"].to_numpy()[:common] for name in (best, second))
    text = (
        f"Compared with it, {second} costs {mean} m/s {more} on the same seeds (95 % interval {low} to {high}), and "
        f"{best} is better on {int(np.sum(ours > theirs))} of {common}. "
    )
    verdict = results.verdict(second, best)
    if verdict is None:
        return text + f"{common} episodes are too few for a verdict; {MIN_VERDICT_EPISODES} are needed."
    if verdict:
        return text + "The difference is significant: the interval excludes zero."
    return text + "The difference is not significant: the interval contains zero."


def fewer(results: Results) -> str:
    """Why some policies flew fewer seeds, and how their means are estimated; empty if all flew the same."""
    if not results.partial:
        return ""
    counts = ", ".join(f"{name} ({results.count(name)})" for name in results.partial)
    every = results.count(results.reference)
    bound = "" if results.bounds is None else " (for the cost: to the bound, where that difference scatters less)"
    return (
        f"Too slow for all {every} seeds: {counts} flew only the first. Their rows, marked ≈, are estimates for all "
        f"{every} seeds: the mean of {results.reference} plus the paired difference to it on the seeds flown{bound}."
    )


def duration(time_us: float) -> str:
    """A duration with two significant digits."""
    unit, scale = ("ms", 1e3) if time_us >= 1e3 else ("µs", 1.0)
    return f"{float(f'{time_us / scale:.2g}'):,g} {unit}"


def microseconds(time_us: float) -> str:
    """A duration in microseconds with two significant digits, for a column of one unit."""
    return f"{float(f'{time_us:.2g}'):,.0f}"


def number(value: float) -> str:
    """A number with three significant digits, thousands with a comma; a dash if it is not finite."""
    if not np.isfinite(value):
        return "–"
    return _minus(f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}")


def numbers(interval: Interval, factor: float = 1.0) -> Cells:
    """Mean, low and high as text: decimals for two digits of the interval's width, four digits at most."""
    values = [factor * value for value in interval]
    if not abs(values[2] - values[1]) > 0:
        mean, low, high = (number(value) for value in values)
        return mean, low, high
    return _fixed(interval, factor, _decimals(interval, factor))


def column(intervals: Sequence[Interval | None], factor: float = 1.0) -> list[Cells | None]:
    """A column of a table: all numbers with the same decimals, so that ranks can be read; None stays None.

    The decimals are the median of those that each number needs by itself.
    """
    known = [interval for interval in intervals if interval is not None]
    needed = sorted(_decimals(interval, factor) for interval in known if interval[0] != 0)
    decimals = needed[len(needed) // 2] if needed else 0
    return [None if interval is None else _fixed(interval, factor, decimals) for interval in intervals]


def _decimals(interval: Interval, factor: float) -> int:
    """Decimals for two digits of the interval's width, and three or four of the mean, so that ranks can be read."""
    mean, low, high = (abs(factor) * value for value in interval)
    width = abs(high - low)
    size = max(abs(mean), width)
    if not (np.isfinite(size) and size > 0):
        return 0
    digits = 3 - math.floor(math.log10(size))
    by_width = 1 - math.floor(math.log10(width)) if width > 0 else digits
    by_mean = 2 - math.floor(math.log10(mean)) if mean > 0 else by_width
    return max(0, min(digits, max(by_width, by_mean), MAX_DECIMALS))


def _fixed(interval: Interval, factor: float, decimals: int) -> Cells:
    """Mean and ordered ends with a number of decimals."""
    mean, low, high = (factor * value for value in interval)
    low, high = min(low, high), max(low, high)
    texts = [f"{value:,.{decimals}f}" if np.isfinite(value) else "–" for value in (mean, low, high)]
    mean_text, low_text, high_text = (_minus(text) for text in texts)
    return mean_text, low_text, high_text


def _minus(text: str) -> str:
    """A typographic minus; none for a rounded zero."""
    return text.lstrip("-") if not text.strip("-0.,") else text.replace("-", "−")
