"""Tuned comparison: error-state LQR and sliding mode, both with the path's feedforward thrust, tuned alike.

Each law has two parameters, searched over the same number of candidates on the tuning seeds for the lowest cost,
delta-v plus a weighted mean error; the winners fly the test seeds. Filter and laws stay linear on any truth.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, Final

import numpy as np
import pandas as pd

from baselines.controllers.registry import make_policy
from baselines.experiments.policy_batch import PolicyBatch
from baselines.thesis import figure_flights, scenarios
from baselines.thesis.claims.shared_flights import ClaimOptions
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

ERROR_WEIGHTS: Final = (1e-3, 1e-2, 1e-1, 1.0)
"""Weights of the mean error, (m/s) per m."""
LINEAR: Final = ("modified_hcw", figure_flights.DYNAMICS)
TUNING_SEEDS: Final = 12
TUNING_STEP_S: Final = 30.0
LAWS: Final = ("lqr", "smc")

Settings = dict[str, Any]


@dataclass(frozen=True)
class Outcome:
    """Results of a law's candidates over several seeds.

    Attributes:
        delta_v_m_s: (candidates, seeds).
        error_m: mean position errors (candidates, seeds).
    """

    delta_v_m_s: Array
    error_m: Array

    def cost(self, error_weight: float) -> Array:
        """Costs (candidates, seeds), m/s, at an error weight in (m/s) per m."""
        return np.asarray(self.delta_v_m_s + error_weight * self.error_m)


def candidates(law: str, count: int) -> list[Settings]:
    """Settings of a law's candidates: count values of each of its two parameters."""
    grids: dict[str, Callable[[float, float], Settings]] = {"lqr": _lqr, "smc": _smc}
    # LQR: bandwidths of 1e-1 to 1e-4 1/s and dampings; SMC: the rates of the surface and of the way to it
    spans = {"lqr": ((0.0, 8.0), (2.0, 7.0)), "smc": ((-4.5, -1.5), (-4.5, -1.5))}
    first, second = (np.logspace(low, high, count) for low, high in spans[law])
    return [grids[law](float(a), float(b)) for a, b in product(first, second)]


def _lqr(control_s2: float, velocity_s2: float) -> Settings:
    hold = {"velocity_s2": [velocity_s2] * 3, "control_s2": [control_s2] * 3}
    return {"design": "weights", "guidance": "automatic", "feedforward": True, "hold": hold}


def _smc(decay_per_s: float, q_per_s: float) -> Settings:
    surface = {"kind": "placed", "decay_per_s": [decay_per_s] * 3}
    return {
        "guidance": "automatic",
        "surface": surface,
        "reaching": {"kind": "exponential", "eps_m_s": 0.005, "q_per_s": q_per_s},
        "boundary_m": 50.0,
    }


def keeping(truth: str, fails: bool, options: ClaimOptions, dt_s: float) -> Scenario:
    """Scenario of section 5.2.2 on a truth, with or without failure; the filter model is linear on any truth."""
    make = scenarios.keeping_failure if fails else scenarios.keeping
    scenario = options.noise.on(make(options.grid_periods, dt_s=dt_s))
    return replace(scenario, dynamics=truth)


@dataclass(frozen=True)
class TunedComparison:
    """Job that tunes and compares both laws on one truth.

    Attributes:
        truth: name of the true dynamics.
        fails: whether communication fails for the first 3000 s.
        options: numbers of candidates and seeds, and the noise.
    """

    truth: str
    fails: bool
    options: ClaimOptions

    @property
    def cost(self) -> int:
        """Duration of the job, in steps of one law."""
        steps = keeping(self.truth, self.fails, self.options, TUNING_STEP_S).num_steps
        return 3 * len(LAWS) * self.options.candidates**2 * steps

    def run(self, progress: Callable[[int], Any]) -> list[dict[str, Any]]:
        """Lines per error weight: the tuned laws' costs and their difference with its 95 % interval."""
        chosen = {law: self._tuned(law) for law in LAWS}
        progress(self.cost // 2)
        scenario = keeping(self.truth, self.fails, self.options, self.options.coarse_dt_s)
        flown = {law: outcome(law, chosen[law], scenario, seeds("test", self.options.seeds)) for law in LAWS}
        progress(self.cost - self.cost // 2)
        case = {"truth": self.truth, "failure": self.fails}
        return [case | _line(index, error_weight, flown, chosen) for index, error_weight in enumerate(ERROR_WEIGHTS)]

    def _tuned(self, law: str) -> list[Settings]:
        """Candidates of lowest cost on the tuning seeds, for each error weight."""
        tried = candidates(law, self.options.candidates)
        scenario = keeping(self.truth, self.fails, self.options, TUNING_STEP_S)
        tuned = outcome(law, tried, scenario, seeds("tuning", TUNING_SEEDS))
        return [tried[int(tuned.cost(error_weight).mean(axis=1).argmin())] for error_weight in ERROR_WEIGHTS]


def outcome(
    law: str, candidate_settings: Sequence[Settings], scenario: Scenario, episode_seeds: Sequence[int]
) -> Outcome:
    """Fly a law with several settings on the same seeds."""
    policies = [make_policy(law, scenario, one) for one in candidate_settings]
    table = evaluate(PolicyBatch(policies), scenario, [*episode_seeds] * len(policies))
    delta_v, error = (
        table[name].to_numpy(float).reshape(len(policies), -1) for name in ("delta_v_m_s", "position_error_mean_m")
    )
    return Outcome(delta_v, error)


def _line(
    index: int, error_weight: float, flown: dict[str, Outcome], chosen: dict[str, list[Settings]]
) -> dict[str, Any]:
    """Comparison at one error weight."""
    line: dict[str, Any] = {"price_m_s_per_m": error_weight}
    for law in LAWS:
        line[f"{law}_delta_v_m_s"] = float(flown[law].delta_v_m_s[index].mean())
        line[f"{law}_mean_error_m"] = float(flown[law].error_m[index].mean())
        line[f"{law}_cost_m_s"] = float(flown[law].cost(error_weight)[index].mean())
    difference = (flown["smc"].cost(error_weight) - flown["lqr"].cost(error_weight))[index]
    line["smc_minus_lqr_m_s"] = float(difference.mean())
    line["low"], line["high"] = bootstrap_interval(difference)
    lqr, smc = chosen["lqr"][index], chosen["smc"][index]
    line["lqr_settings"] = f"a = {lqr['hold']['control_s2'][0]:.3g}, velocity {lqr['hold']['velocity_s2'][0]:.3g} s^2"
    line["smc_settings"] = f"decay {smc['surface']['decay_per_s'][0]:.3g}, q {smc['reaching']['q_per_s']:.3g} 1/s"
    return line


def tuned_jobs(options: ClaimOptions) -> dict[str, TunedComparison]:
    """Jobs of the comparison on each truth, with and without failure."""
    return {
        f"{truth} {'failure' if fails else 'no failure'}": TunedComparison(truth, fails, options)
        for truth, fails in product(options.truths, (False, True))
    }


def tuned_table(flown: Mapping[str, list[dict[str, Any]]]) -> pd.DataFrame:
    """Table with one line per truth, failure and error weight."""
    return pd.DataFrame([line for lines in flown.values() for line in lines])
