"""Range of validity of the models: sentences and a table, computed from the results."""

from typing import Final

import numpy as np
import pandas as pd

from baselines.report.text import number
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
"""Leaders of the table; all under J2."""
NEAR_M: Final = 1000.0
"""Formation size in the sentences, m."""


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
    """Largest size up to which the error of every closed formation stays below an accuracy.

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
    """Table of `good_enough` for the page: one line per leader and model."""
    lines = []
    for (name, model), group in enough.groupby(["leader", "model"], sort=False):
        line = {"leader": name, "model": model}
        for orbits, accuracy_m, size_m in zip(group["orbits"], group["accuracy_m"], group["size_m"], strict=True):
            span = f"{orbits} {'orbit' if orbits == 1 else 'orbits'}"
            line[f"within {accuracy_m:g} m over {span}"] = _size(float(size_m))
        lines.append(line)
    return pd.DataFrame(lines)


def _size(size_m: float) -> str:
    """Text of a maximum size."""
    if size_m == 0:
        return f"below {SIZES_M[0]:g} m"
    return f"beyond {SIZES_M[-1] / 1e3:g} km" if np.isinf(size_m) else f"{number(float(f'{size_m:.2g}'))} m"


def sentences(errors: pd.DataFrame, costs: pd.DataFrame) -> list[str]:
    """Conclusions in sentences.

    Args:
        errors: lines of all surveys.
        costs: of `closed_loop_costs.summary`.
    """
    return [_circle(errors), _size_parts(errors), _tilt(errors), _ellipse(errors), _feedback(costs), _mismatched(costs)]


def _near(errors: pd.DataFrame, orbit: Orbit, model: str, span: int = 1) -> str:
    """Error of the worst formation at `NEAR_M` in words, without the unit."""
    return number(worst(errors, orbit, model, span)[NEAR_M])


def _circle(errors: pd.DataFrame) -> str:
    one, ten = ([_near(errors, leader(), model, span) for model in (HCW, OSCULATING, MEAN)] for span in SPANS)
    return (
        f"With the leader on a circular orbit at 600 km and 60° and the follower {NEAR_M:g} m away, in the worst "
        f"closed formation HCW errs by up to {one[0]} m over one orbit, modified HCW by {one[1]} m with the osculating "
        f"mean "
        f"motion and by {one[2]} m with the mean one; over ten orbits by {ten[0]}, {ten[1]} and {ten[2]} m. Yamanaka "
        "and Ankersen's model equals HCW there."
    )


def _size_parts(errors: pd.DataFrame) -> str:
    bare, full = (worst(errors, leader(j2=j2), HCW, 1) for j2 in (False, True))
    sizes_m = bare.index.to_numpy(float)
    even_m = crossing(sizes_m, (bare / full).to_numpy(float), 0.5)
    return (
        f"Without J2 only the linearisation is in error, by {number(bare[1e3])} m at 1 km and {number(bare[1e4])} m at "
        "10 km over one orbit: it grows with the square of the size. The contribution of J2 is proportional to the "
        f"size; it dominates HCW's error up to {number(even_m / 1e3)} km, the linearisation beyond."
    )


def _tilt(errors: pd.DataFrame) -> str:
    def error(inclination_deg: float, model: str) -> str:
        lines = about(errors, leader(inclination_deg))
        mine = (lines["model"] == model) & (lines["formation"] == "x-y ellipse") & (lines["orbits"] == 1)
        return number(lines[mine & (lines["size_m"] == NEAR_M)]["error_m"].item())

    return (
        f"The benefit of the mean radius depends on the inclination: on an x-y ellipse of {NEAR_M:g} m modified HCW "
        f"with the mean radius errs by {error(97.8, MEAN)} m over one orbit at 97.8°, and by "
        f"{error(97.8, OSCULATING)} m with the osculating one; at 0° by {error(0.0, MEAN)} and "
        f"{error(0.0, OSCULATING)} m. A leader whose osculating elements are circular follows a slight ellipse under "
        "J2, which no circular model represents."
    )


def _ellipse(errors: pd.DataFrame) -> str:
    small, large = (leader(eccentricity=e) for e in (0.001, 0.1))
    return (
        f"An eccentricity of 0.001 increases HCW's error at {NEAR_M:g} m over one orbit from "
        f"{_near(errors, leader(), HCW)} m to {_near(errors, small, HCW)} m, one of 0.1 to "
        f"{_near(errors, large, HCW)} m; with Yamanaka and Ankersen's "
        f"model it is {_near(errors, small, ELLIPTIC)} and {_near(errors, large, ELLIPTIC)} m, at 0.1 without J2 "
        f"{_near(errors, leader(eccentricity=0.1, j2=False), ELLIPTIC)} m."
    )


def _feedback(costs: pd.DataFrame) -> str:
    parts_by_policy = []
    for policy in ("lqr", "smc"):
        more = costs[costs["policy"] == policy].set_index(["scenario", "truth"])["more_percent"]
        parts = [
            f"{comparison.scenario} {number(more[comparison.scenario, closed_loop_costs.OSCULATING])} % "
            f"({number(more[comparison.scenario, closed_loop_costs.MEAN])} %)"
            for comparison in closed_loop_costs.COMPARISONS
            if comparison.scenario != closed_loop_costs.ECCENTRIC
        ]
        parts_by_policy.append(f"{policy} {', '.join(parts)}")
    return (
        "In closed loop, with settings tuned on the linear truth, the nonlinear truth increases the cost by, with "
        f"the osculating mean motion (with the mean one): {'; '.join(parts_by_policy)}."
    )


def _mismatched(costs: pd.DataFrame) -> str:
    lines = costs[(costs["scenario"] == closed_loop_costs.ECCENTRIC) & costs["policy"].isin(["lqr", "smc"])]
    cost = lines.set_index(["policy", "truth"])["cost_m_s"]
    parts = []
    for policy in ("lqr", "smc"):
        right, wrong = (cost[policy, world] for world in (closed_loop_costs.ELLIPTIC, closed_loop_costs.CIRCULAR))
        more = 100 * (right / cost[policy, closed_loop_costs.LINEAR] - 1)
        parts.append(f"{policy} {number(more)} % more than on the linear truth, and {number(wrong / right)} times that")
    return (
        "With e = 0.1 the nonlinear truth costs, with Yamanaka and Ankersen's model in filter and law, and with "
        f"HCW in both: {'; '.join(parts)}."
    )
