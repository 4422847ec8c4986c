"""The fair comparison: error-state LQR and sliding mode, both with the path's own thrust, both tuned the same way.

Each law has two gains, searched over the same number of candidates on the tuning seeds for the least cost, delta-v plus a
price times the mean error; the winners fly the test seeds. The truth is linear or not; filter and laws stay linear.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final

import numpy as np
import pandas as pd

from baselines.policy import AccelerationPolicy
from baselines.registry import make_policy
from baselines.side_by_side import SideBySide
from baselines.thesis import scenarios
from baselines.thesis.claims_flights import PRINTED, Effort
from formation_env.dynamics.base import Array
from formation_env.evaluation import bootstrap_interval, evaluate
from formation_env.scenario import Scenario
from formation_env.seeds import seeds

PRICES: Final = (1e-3, 1e-2, 1e-1, 1.0)
"""Of the mean error, (m/s) per m."""
TRUTHS: Final = ("modified_hcw", PRINTED, "nonlinear")
TUNING_SEEDS: Final = 12
LAWS: Final = ("lqr", "smc")

Gains = dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """What a law's candidates come to over some seeds.

    Attributes:
        delta_v_m_s: (candidates, seeds).
        error_m: mean position errors (candidates, seeds).
    """

    delta_v_m_s: Array
    error_m: Array

    def cost(self, price: float) -> Array:
        """Costs (candidates, seeds), m/s, at a price in (m/s) per m."""
        return np.asarray(self.delta_v_m_s + price * self.error_m)


def candidates(law: str, count: int) -> list[Gains]:
    """Gains of a law, over count values of each of its two."""
    grids: dict[str, Callable[[float, float], Gains]] = {"lqr": _lqr, "smc": _smc}
    # LQR: bandwidths of 1e-1 to 1e-4 1/s and dampings; SMC: the rates of the surface and of the way to it
    spans = {"lqr": ((0.0, 8.0), (2.0, 7.0)), "smc": ((-4.5, -1.5), (-4.5, -1.5))}
    first, second = (np.logspace(low, high, count) for low, high in spans[law])
    return [grids[law](float(a), float(b)) for a, b in product(first, second)]


def _lqr(control_s2: float, velocity_s2: float) -> Gains:
    hold = {"velocity_s2": [velocity_s2] * 3, "control_s2": [control_s2] * 3}
    return {"design": "weights", "guidance": "automatic", "feedforward": True, "hold": hold}


def _smc(decay_per_s: float, q_per_s: float) -> Gains:
    surface = {"kind": "placed", "decay_per_s": [decay_per_s] * 3}
    return {
        "guidance": "automatic",
        "surface": surface,
        "reaching": {"kind": "exponential", "eps_m_s": 0.005, "q_per_s": q_per_s},
        "boundary_m": 50.0,
    }


def keeping(truth: str, fails: bool, effort: Effort) -> Scenario:
    """Section 5.2.2 on a truth, with or without failure; filter and laws believe the truth if it is linear."""
    make = scenarios.keeping_failure if fails else scenarios.keeping
    scenario = effort.noise.on(make(effort.grid_periods, dt_s=effort.coarse_dt_s))
    believed = "modified_hcw" if truth == "nonlinear" else truth
    return replace(scenario, dynamics=truth, filter=replace(scenario.filter, dynamics=believed))


def compare(truth: str, fails: bool, effort: Effort) -> list[dict[str, str | float | bool]]:
    """One line per price: the tuned laws' costs and the difference with its 95 % interval."""
    scenario = keeping(truth, fails, effort)
    tuned = {law: candidates(law, effort.candidates) for law in LAWS}
    found = {law: outcome(_policies(law, tuned[law], scenario), scenario, seeds("tuning", TUNING_SEEDS)) for law in LAWS}
    best = {law: [int(found[law].cost(price).mean(axis=1).argmin()) for price in PRICES] for law in LAWS}
    flown = {
        law: outcome(
            _policies(law, [tuned[law][k] for k in best[law]], scenario), scenario, seeds("test", effort.seeds)
        )
        for law in LAWS
    }
    chosen = {law: [tuned[law][k] for k in best[law]] for law in LAWS}
    return [
        {"truth": truth, "failure": fails, **_line(index, price, flown, chosen)} for index, price in enumerate(PRICES)
    ]


def _policies(law: str, gains: Sequence[Gains], scenario: Scenario) -> list[AccelerationPolicy]:
    return [make_policy(law, scenario, one) for one in gains]


def outcome(policies: Sequence[AccelerationPolicy], scenario: Scenario, episode_seeds: Sequence[int]) -> Outcome:
    """Fly policies on the same seeds, side by side."""
    table = evaluate(SideBySide(policies), scenario, [*episode_seeds] * len(policies))
    delta_v, error = (
        table[name].to_numpy(float).reshape(len(policies), -1) for name in ("delta_v_m_s", "position_error_mean_m")
    )
    return Outcome(delta_v, error)


def _line(index: int, price: float, flown: dict[str, Outcome], chosen: dict[str, list[Gains]]) -> dict[str, Any]:
    """The comparison at one price."""
    line: dict[str, Any] = {"price_m_s_per_m": price}
    for law in LAWS:
        line[f"{law}_delta_v_m_s"] = float(flown[law].delta_v_m_s[index].mean())
        line[f"{law}_mean_error_m"] = float(flown[law].error_m[index].mean())
        line[f"{law}_cost_m_s"] = float(flown[law].cost(price)[index].mean())
    difference = (flown["smc"].cost(price) - flown["lqr"].cost(price))[index]
    line["smc_minus_lqr_m_s"] = float(difference.mean())
    line["low"], line["high"] = bootstrap_interval(difference)
    lqr, smc = chosen["lqr"][index], chosen["smc"][index]
    line["lqr_gains"] = f"a = {lqr['hold']['control_s2'][0]:.3g}, velocity {lqr['hold']['velocity_s2'][0]:.3g} s^2"
    line["smc_gains"] = f"decay {smc['surface']['decay_per_s'][0]:.3g}, q {smc['reaching']['q_per_s']:.3g} 1/s"
    return line


def linear(effort: Effort) -> pd.DataFrame:
    """The comparison on the linear truths."""
    return _table(TRUTHS[:2], effort)


def nonlinear(effort: Effort) -> pd.DataFrame:
    """The comparison on the nonlinear truth."""
    return _table(TRUTHS[2:], effort)


def _table(truths: Sequence[str], effort: Effort) -> pd.DataFrame:
    lines = [line for truth, fails in product(truths, (False, True)) for line in compare(truth, fails, effort)]
    return pd.DataFrame(lines)
