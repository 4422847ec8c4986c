"""When which model is good enough: sentences and a table, all from the numbers."""

from typing import Final

import numpy as np
import pandas as pd

from baselines.report.words import number
from baselines.thesis.models import closed_loop_costs
from baselines.thesis.models.open_loop_errors import MODELS, SIZES_M, SPANS, about, leader
from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit

HCW, OSCULATING, MEAN, ELLIPTIC = MODELS
ACCURACIES_M: Final = (10.0, 100.0)
LEADERS: Final = {
    "circular, 60°": leader(),
    "circular, 97.8°": leader(97.8),
    "e = 0.001, 60°": leader(eccentricity=0.001),
    "e = 0.1, 60°": leader(eccentricity=0.1),
}
"""Of the table; all under J2."""
NEAR_M: Final = 1000.0
"""Size that the sentences speak of."""


def worst(errors: pd.DataFrame, orbit: Orbit, model: str, span: int) -> pd.Series:
    """Error of the worst closed formation by size, m."""
    lines = about(errors, orbit)
    chosen = lines[(lines["model"] == model) & (lines["orbits"] == span)]
    return chosen.groupby("size_m")["error_m"].max()


def crossing(sizes_m: Array, values: Array, level: float) -> float:
    """Size up to which growing values stay below a level, by straight lines between logarithms.

    Returns:
        0 if the level is passed at the smallest size already, infinity if it is not passed at all.
    """
    if values[0] > level:
        return 0.0
    if values.max() <= level:
        return np.inf
    above = int(np.argmax(values > level))
    ends = slice(above - 1, above + 1)
    return float(np.exp(np.interp(np.log(level), np.log(values[ends]), np.log(sizes_m[ends]))))


def good_enough(errors: pd.DataFrame) -> pd.DataFrame:
    """Greatest size at which no closed formation strays further than an accuracy.

    Returns:
        One line per leader, model, span and accuracy: leader, model, orbits, accuracy_m, size_m; the size is 0 where
        100 m is too large already, and infinite where 20 km is small enough.
    """
    lines = []
    for name, orbit in LEADERS.items():
        known = about(errors, orbit)["model"].unique()
        for model in (model for model in MODELS if model in known):
            for span in SPANS:
                by_size = worst(errors, orbit, model, span)
                sizes_m, values = by_size.index.to_numpy(float), by_size.to_numpy(float)
                lines += [(name, model, span, m, crossing(sizes_m, values, m)) for m in ACCURACIES_M]
    return pd.DataFrame(lines, columns=["leader", "model", "orbits", "accuracy_m", "size_m"])


def guide(enough: pd.DataFrame) -> pd.DataFrame:
    """The table of `good_enough` for people: a line for each leader and model."""
    lines = []
    for (name, model), group in enough.groupby(["leader", "model"], sort=False):
        line = {"leader": name, "model": model}
        for row in group.itertuples():
            span = f"{row.orbits} {'orbit' if row.orbits == 1 else 'orbits'}"
            line[f"within {row.accuracy_m:g} m over {span}"] = _size(row.size_m)
        lines.append(line)
    return pd.DataFrame(lines)


def _size(size_m: float) -> str:
    """A greatest size in words."""
    if size_m == 0:
        return f"below {SIZES_M[0]:g} m"
    return f"beyond {SIZES_M[-1] / 1e3:g} km" if np.isinf(size_m) else f"{number(float(f'{size_m:.2g}'))} m"


def sentences(errors: pd.DataFrame, costs: pd.DataFrame) -> list[str]:
    """What is learned.

    Args:
        errors: lines of all surveys.
        costs: of `model_costs.summary`.
    """
    return [_circle(errors), _size_parts(errors), _tilt(errors), _ellipse(errors), _feedback(costs), _believed(costs)]


def _near(errors: pd.DataFrame, orbit: Orbit, model: str, span: int = 1) -> str:
    """Error of the worst formation at `NEAR_M` in words, without the unit."""
    return number(worst(errors, orbit, model, span)[NEAR_M])


def _circle(errors: pd.DataFrame) -> str:
    one, ten = ([_near(errors, leader(), model, span) for model in (HCW, OSCULATING, MEAN)] for span in SPANS)
    return (
        f"Leader on a circle at 600 km and 60°, follower {NEAR_M:g} m away, worst closed formation: over one orbit HCW "
        f"errs by up to {one[0]} m, modified HCW by {one[1]} m about the osculating orbit and by {one[2]} m about the "
        f"mean one; over ten orbits by {ten[0]}, {ten[1]} and {ten[2]} m. Yamanaka and Ankersen's model is HCW there."
    )


def _size_parts(errors: pd.DataFrame) -> str:
    bare, full = (worst(errors, leader(j2=j2), HCW, 1) for j2 in (False, True))
    sizes_m = bare.index.to_numpy(float)
    even_m = crossing(sizes_m, (bare / full).to_numpy(float), 0.5)
    return (
        f"Without J2 only the linearisation is wrong, by {number(bare[1e3])} m at 1 km and {number(bare[1e4])} m at "
        f"10 km over one orbit: with the square of the size. What J2 adds grows with the size itself; up to "
        f"{number(even_m / 1e3)} km it is the greater part of HCW's error, beyond, the linearisation is."
    )


def _tilt(errors: pd.DataFrame) -> str:
    def error(inclination_deg: float, model: str) -> str:
        lines = about(errors, leader(inclination_deg))
        mine = (lines["model"] == model) & (lines["formation"] == "x-y ellipse") & (lines["orbits"] == 1)
        return number(lines[mine & (lines["size_m"] == NEAR_M)]["error_m"].item())

    return (
        f"What the mean reference is worth depends on the inclination: on an x-y ellipse of {NEAR_M:g} m modified HCW "
        f"about the mean orbit errs by {error(97.8, MEAN)} m over one orbit at 97.8°, and by "
        f"{error(97.8, OSCULATING)} m about the osculating one; at 0° by {error(0.0, MEAN)} and "
        f"{error(0.0, OSCULATING)} m. A leader whose osculating elements are circular flies a slight ellipse under J2, "
        f"which no circular model knows."
    )


def _ellipse(errors: pd.DataFrame) -> str:
    small, large = (leader(eccentricity=e) for e in (0.001, 0.1))
    return (
        f"An eccentricity of 0.001 takes HCW's {_near(errors, leader(), HCW)} m at {NEAR_M:g} m and one orbit to "
        f"{_near(errors, small, HCW)} m, one of 0.1 to {_near(errors, large, HCW)} m; with Yamanaka and Ankersen's "
        f"model it is {_near(errors, small, ELLIPTIC)} and {_near(errors, large, ELLIPTIC)} m, at 0.1 without J2 "
        f"{_near(errors, leader(eccentricity=0.1, j2=False), ELLIPTIC)} m."
    )


def _feedback(costs: pd.DataFrame) -> str:
    said = []
    for policy in ("lqr", "smc"):
        more = costs[costs["policy"] == policy].set_index(["scenario", "world"])["more_percent"]
        parts = [
            f"{comparison.scenario} {number(more[comparison.scenario, closed_loop_costs.OSCULATING])} % "
            f"({number(more[comparison.scenario, closed_loop_costs.MEAN])} %)"
            for comparison in closed_loop_costs.COMPARISONS
            if comparison.scenario != closed_loop_costs.ECCENTRIC
        ]
        said.append(f"{policy} {', '.join(parts)}")
    return (
        f"In closed loop, with the gains tuned in the linear world, the nonlinear one costs more by, with the "
        f"osculating reference (with the mean one): {'; '.join(said)}."
    )


def _believed(costs: pd.DataFrame) -> str:
    lines = costs[(costs["scenario"] == closed_loop_costs.ECCENTRIC) & costs["policy"].isin(["lqr", "smc"])]
    cost = lines.set_index(["policy", "world"])["cost_m_s"]
    parts = []
    for policy in ("lqr", "smc"):
        right, wrong = (cost[policy, world] for world in (closed_loop_costs.ELLIPTIC, closed_loop_costs.CIRCULAR))
        more = 100 * (right / cost[policy, closed_loop_costs.LINEAR] - 1)
        parts.append(f"{policy} {number(more)} % more than in the linear world, and {number(wrong / right)} times that")
    return (
        f"On an ellipse of e = 0.1 the nonlinear world costs with Yamanaka and Ankersen's model in filter and law, and "
        f"with HCW in both: {'; '.join(parts)}."
    )
