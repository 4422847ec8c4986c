"""The fair comparison: error-state LQR and sliding mode, both with the path's own thrust, both tuned the same way.

Each law has two gains, searched over the same number of candidates on the tuning seeds for the least cost, delta-v plus
a price times the mean error; the winners fly the test seeds. Filter and laws stay linear on any truth.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final

import numpy as np
import pandas as pd

from baselines.controllers.registry import make_policy
from baselines.experiments.policy_batch import SideBySide
from baselines.thesis import plan, scenarios
from baselines.thesis.claims.flights import Effort
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

PRICES: Final = (1e-3, 1e-2, 1e-1, 1.0)
"""Of the mean error, (m/s) per m."""
LINEAR: Final = ("modified_hcw", plan.DYNAMICS)
TUNING_SEEDS: Final = 12
TUNING_STEP_S: Final = 30.0
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


def keeping(truth: str, fails: bool, effort: Effort, dt_s: float) -> Scenario:
    """Section 5.2.2 on a truth, with or without failure; filter and laws believe a nonlinear one to be modified HCW."""
    make = scenarios.keeping_failure if fails else scenarios.keeping
    scenario = effort.noise.on(make(effort.grid_periods, dt_s=dt_s))
    return replace(scenario, dynamics=truth)


@dataclass(frozen=True)
class Comparison:
    """Both laws on one truth, flown like a `Job`.

    Attributes:
        truth: name of the true dynamics.
        fails: whether communication fails for the first 3000 s.
        effort: how many candidates and seeds, and in what noise.
    """

    truth: str
    fails: bool
    effort: Effort

    @property
    def cost(self) -> int:
        """How long it takes, in steps of one law."""
        steps = keeping(self.truth, self.fails, self.effort, TUNING_STEP_S).num_steps
        return 3 * len(LAWS) * self.effort.candidates**2 * steps

    def run(self, progress: Callable[[int], Any]) -> list[dict[str, Any]]:
        """One line per price: the tuned laws' costs and the difference with its 95 % interval."""
        chosen = {law: self._tuned(law) for law in LAWS}
        progress(self.cost // 2)
        scenario = keeping(self.truth, self.fails, self.effort, self.effort.coarse_dt_s)
        flown = {law: outcome(law, chosen[law], scenario, seeds("test", self.effort.seeds)) for law in LAWS}
        progress(self.cost - self.cost // 2)
        said = {"truth": self.truth, "failure": self.fails}
        return [said | _line(index, price, flown, chosen) for index, price in enumerate(PRICES)]

    def _tuned(self, law: str) -> list[Gains]:
        """The candidate of least cost on the tuning seeds, for each price."""
        tried = candidates(law, self.effort.candidates)
        scenario = keeping(self.truth, self.fails, self.effort, TUNING_STEP_S)
        found = outcome(law, tried, scenario, seeds("tuning", TUNING_SEEDS))
        return [tried[int(found.cost(price).mean(axis=1).argmin())] for price in PRICES]


def outcome(law: str, gains: Sequence[Gains], scenario: Scenario, episode_seeds: Sequence[int]) -> Outcome:
    """Fly a law with each of some gains on the same seeds, side by side."""
    policies = [make_policy(law, scenario, one) for one in gains]
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


def jobs(effort: Effort) -> dict[str, Comparison]:
    """The comparison on each truth, with and without failure."""
    return {
        f"{truth} {'failure' if fails else 'no failure'}": Comparison(truth, fails, effort)
        for truth, fails in product(effort.truths, (False, True))
    }


def table(flown: Mapping[str, list[dict[str, Any]]]) -> pd.DataFrame:
    """One line per truth, failure and price."""
    return pd.DataFrame([line for lines in flown.values() for line in lines])
