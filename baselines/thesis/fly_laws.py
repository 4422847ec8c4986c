"""Flights of several policies side by side in one batch."""

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np

from baselines.design.guidance import GuidanceName
from baselines.experiments.policy_batch import PolicyBatch
from baselines.thesis.flight_recorder import MEASUREMENT, FlightRecorder, recorded_steps
from baselines.thesis.recorded_flights import Flights
from formation_env.envs import info_keys, interface
from formation_env.envs.vector import FormationVectorEnv
from formation_env.evaluation.rollout import Policy
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

FEW: Final = 1
"""Default number of seeds of each policy whose full states are recorded."""


def fly_laws(
    policies: Sequence[Policy],
    scenario: Scenario,
    seeds: Sequence[int],
    guide: GuidanceName = "automatic",
    every: int = 1,
    few: int = FEW,
    measured: bool = False,
    start: Array | None = None,
    progress: Callable[[int], Any] = lambda steps: None,
) -> Flights:
    """Fly all policies on all seeds in one batch.

    Args:
        policies: policies that fly.
        scenario: scenario flown.
        seeds: one per episode, the same for all policies.
        guide: desired path that errors are measured from, see `baselines.design.guidance`.
        every: steps between recorded instants; sums and maxima are exact all the same.
        few: seeds of each policy, the first ones, whose states are recorded.
        measured: whether their measurements are recorded.
        start: true LVLH state (6,) to start at in place of the scenario's start and its spread, m and m/s.
        progress: called with the number of steps completed since the last call, over all rows.
    """
    env = FormationVectorEnv(len(policies) * len(seeds), scenario, analysis=measured)
    batch = PolicyBatch(policies)
    options = None if start is None else {interface.START_OPTION: start}
    observations, infos = env.reset(seed=[*seeds] * len(policies), options=options)
    log = FlightRecorder(scenario, (len(policies), len(seeds)), recorded_steps(scenario, every), few, guide)
    log.add(infos)
    for _ in range(scenario.num_steps):
        actions = batch.predict(observations)[0]
        observations, _, terminations, truncations, infos = env.step(actions)
        ended = terminations | truncations
        infos = _with_final_infos(infos) if ended.any() else infos
        log.add(infos, ended)
        progress(env.num_envs)
    return log.flights(tuple(int(seed) for seed in seeds))


def _with_final_infos(infos: dict[str, Any]) -> dict[str, Any]:
    """Infos of a step; those of ended episodes replace those of the episodes that follow them."""
    finals, ended = infos["final_info"], infos["_final_info"]
    merged = dict(infos)
    for name in ("true_state", "estimate", "measured", info_keys.THRUST, MEASUREMENT):
        if name in finals:
            mask = ended if finals[name].ndim == 1 else ended[:, None]
            merged[name] = np.where(mask, finals[name], infos[name])
    return merged
