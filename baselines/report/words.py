"""The results in words, and numbers for people."""

import math

import numpy as np

from baselines.controllers.registry import POLICIES
from baselines.experiments.statistics import Interval, Results, significant


def headline(results: Results) -> str:
    """Who wins an environment and by how much, in one sentence."""
    best = results.best
    parts = [f"{best} wins at {numbers(results.cost(best))[0]} m/s"]
    if results.cost_ratios:
        ratio, low, high = numbers(results.cost_ratios[best])
        parts.append(f"{ratio} [{low}, {high}] times the bound")
    parts.append(f"{duration(results.flown.action_time_us(best))} per action")
    rest = [_rival(results, name, role) for role, name in _rivals(results)]
    return "; ".join([", ".join(parts), *rest]) + "."


def _rivals(results: Results) -> list[tuple[str, str]]:
    """The next policy, and the best of the other kind, classical or learned, if that is not the next: role and name."""
    others = results.ranking[1:]
    classical = results.best in POLICIES
    unlike = [name for name in others if (name in POLICIES) != classical]
    found = [("next is", others[0])] if others else []
    if unlike and unlike[0] != others[0]:
        found.append(("the best learned policy is" if classical else "the best classical policy is", unlike[0]))
    return found


def _rival(results: Results, name: str, role: str) -> str:
    """How far behind the best a policy is."""
    behind = results.behind(results.best, name)
    mean, low, high = numbers(behind)
    cost = results.cost(results.best)[0]
    share = f" ({number(100 * behind[0] / cost)} %)" if cost > 0 else ""
    verdict = "significant" if significant(behind) else "not significant"
    return f"{role} {name}, {mean} [{low}, {high}] m/s{share} behind on the same seeds, which is {verdict}"


def reading(results: Results) -> list[str]:
    """The result in plain sentences."""
    best = results.best
    dv, error = (numbers(results.interval(best, metric))[0] for metric in ("delta_v_m_s", "position_error_mean_m"))
    lines = [
        f"{best} has the least mean cost, {numbers(results.cost(best))[0]} m/s per episode, of which {dv} m/s "
        f"is thrust; its mean position error in hold is {error} m. An action takes it "
        f"{duration(results.flown.action_time_us(best))} (the median of one flight)."
    ]
    if len(results.ranking) > 1:
        lines.append(_comparison(results, results.ranking[1]))
    if results.cost_ratios:
        lines.append(_against_bound(results))
    lost = [
        f"{name} in {count} of {results.count(name)}"
        for name in results.ranking
        if (count := results.ended_early(name))
    ]
    if lost:
        lines.append(f"A limit ended episodes early: {', '.join(lost)}.")
    return lines


def _against_bound(results: Results) -> str:
    """The best policy against what was possible."""
    assert results.bounds is not None
    ratio, low, high = numbers(results.cost_ratios[results.best])
    return (
        f"Had everything been known beforehand, {number(float(results.bounds.mean()))} m/s would have been enough: "
        f"{results.best} costs {ratio} times the bound of each seed (95 % interval {low} to {high})."
    )


def _comparison(results: Results, second: str) -> str:
    """Best against second best, on the same seeds."""
    best = results.best
    behind = results.behind(best, second)
    mean, low, high = numbers(behind)
    common = min(results.count(best), results.count(second))
    ours, theirs = (results.flown.episodes[name]["return"].to_numpy()[:common] for name in (best, second))
    text = (
        f"Next is {second}, {mean} m/s behind on the same seeds (95 % interval {low} to "
        f"{high}); {best} is better on {int(np.sum(ours > theirs))} of {common} seeds. "
    )
    if significant(behind):
        return text + "The difference is significant: the interval leaves out zero."
    return text + "The difference is not significant: the interval holds zero."


def fewer(results: Results) -> str:
    """Why some policies flew fewer seeds, and what stands for their means; empty if all flew the same."""
    if not results.partial:
        return ""
    counts = ", ".join(f"{name} ({results.count(name)})" for name in results.partial)
    every = results.count(results.reference)
    cost = (
        ""
        if results.bounds is None
        else "; for the return the bound stands in where the difference to it scatters less"
    )
    return (
        f"Too slow for all {every} seeds: {counts} flew the first ones only; their means are estimates for all seeds, "
        f"those of {results.reference}, the best that flew all, plus the mean difference to it on the same seeds{cost}."
    )


def duration(time_us: float) -> str:
    """A time for people, two significant digits."""
    unit, scale = ("ms", 1e3) if time_us >= 1e3 else ("µs", 1.0)
    return f"{float(f'{time_us / scale:.2g}'):,g} {unit}"


def number(value: float) -> str:
    """A number for people: three significant digits, thousands with a comma; a dash if there is none."""
    if not np.isfinite(value):
        return "–"
    text = f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return text.replace("-", "−")


def numbers(interval: Interval, factor: float = 1.0) -> tuple[str, str, str]:
    """Mean, low and high for people, with decimals for two digits of the interval's width, but at most four digits."""
    values = [factor * value for value in interval]
    width = abs(values[2] - values[1])
    if not width > 0:
        mean, low, high = (number(value) for value in values)
        return mean, low, high
    digits = 3 - math.floor(math.log10(max(abs(values[0]), width)))
    decimals = max(0, min(digits, 1 - math.floor(math.log10(width))))
    mean, low, high = (f"{value:,.{decimals}f}".replace("-", "−") for value in values)
    return mean, low, high
