"""Stable-Baselines3's VecEnv over the batched environment: all rows are stepped by one call."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices

from agents.algorithms.shaping import Shaping
from agents.policy.throttle import throttle
from formation_env.envs import FormationVectorEnv, info_keys
from formation_env.task.loading import load_scenario
from formation_env.task.scenario import Scenario

Infos = list[dict[str, Any]]
Row = dict[str, Any]


class Sb3VecEnv(VecEnv):
    """Adapter of a `FormationVectorEnv` to Stable-Baselines3's interface.

    The info of a row is empty except at the end of its episode; then it has `terminal_observation`,
    `TimeLimit.truncated`, `episode` as SB3's Monitor gives it (return `r` in m/s as reported, without scaling or
    shaping; length `l`, seconds `t`), and `episode_totals` (metrics by name). The list of infos is reused from step to
    step, and so is the dict of a row whose episode goes on: copy what must survive the next step.
    """

    def __init__(
        self,
        num_envs: int,
        scenario: str | Path | Scenario,
        reward_scale: float = 1.0,
        throttle_power: float = 1.0,
        shaping: Shaping | None = None,
        bootstrap_end: bool = True,
        stagger: bool = False,
    ) -> None:
        """Make the environment.

        Args:
            num_envs: rows.
            scenario: a registered id, a scenario's name or path, or a Scenario.
            reward_scale: rewards are multiplied by this, units per m/s.
            throttle_power: p of the thrust sign(z) |z|^p that an action z stands for; see `agents.policy.throttle`.
            shaping: potential-based term, added to the rewards before they are scaled.
            bootstrap_end: report the end of the episode as `TimeLimit.truncated`, so that SB3 adds the value of the
                last observation; else as a termination, which is how returns are reported.
            stagger: spread the starts of the rows' episodes evenly over an episode's length, so that each rollout sees
                all parts of the mission. Until its first end a row is where coasting took it.
        """
        self.batch = FormationVectorEnv(num_envs, load_scenario(scenario))
        self.reward_scale = reward_scale
        self.throttle_power = throttle_power
        self.shaping = shaping
        self.bootstrap_end = bootstrap_end
        self.stagger = stagger
        self._infos: Infos = [{} for _ in range(num_envs)]
        self._rows_with_info = np.zeros(0, np.intp)
        self._actions = np.zeros((num_envs, 3), np.float32)
        self._birth_s = time.perf_counter()
        super().__init__(num_envs, self.batch.single_observation_space, self.batch.single_action_space)

    def reset(self) -> NDArray[np.float32]:
        """Begin an episode in all rows, with the seeds and options given since the last reset, which count once."""
        observations, _ = self.batch.reset(seed=self._seeds, options=self._batch_options())
        self._reset_seeds()
        self._reset_options()
        if self.stagger:
            observations = self._spread(observations)
        if self.shaping is not None:
            self.shaping.restart(observations)
        return observations

    def memory(self) -> NDArray[np.float64]:
        """Copy of the state that the rows carry from one step to the next."""
        return self.batch.simulation.memory()

    def recall(self, memory: NDArray[np.float64], observations: NDArray[np.float32]) -> None:
        """Continue from a state that `memory` gave and the observations (num_envs, SIZE) at that time."""
        self.batch.reset(seed=0)
        self.batch.simulation.recall(memory)
        if self.shaping is not None:
            self.shaping.restart(observations)

    def _batch_options(self) -> dict[str, Any] | None:
        """Merge the rows' options; an option is given to all rows or to none."""
        keys = {key for options in self._options for key in options}
        for key in keys:
            if not all(key in options for options in self._options):
                raise ValueError(f"reset options: {key} must be given to all rows or to none")
        return {key: np.stack([options[key] for options in self._options]) for key in keys} or None

    def _spread(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Coast for an episode and restart the rows one after the other on the way."""
        length = self.batch.scenario.num_steps
        begins = np.arange(self.num_envs) * length // self.num_envs
        coast = np.zeros((self.num_envs, 3), np.float32)
        for step in range(length):
            chosen = begins == step
            if step and chosen.any():
                self.batch.reset(options={"reset_mask": chosen})
            observations = self.batch.step(coast)[0]
        return observations

    def step_async(self, actions: NDArray[np.float32]) -> None:
        """Keep the actions (num_envs, 3) for `step_wait`."""
        self._actions = throttle(actions, self.throttle_power)

    def step_wait(self) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.bool_], Infos]:
        """Fly one step in all rows; rows that end begin their next episode."""
        observations, rewards, terminations, truncations, batch_infos = self.batch.step(self._actions)
        ended = terminations | truncations
        interrupted = truncations & ~terminations & self.bootstrap_end
        self._update_infos(batch_infos, np.flatnonzero(ended), interrupted)
        if self.shaping is not None:
            rewards += self.shaping.added(observations, ended, self._last_potentials(ended, interrupted))
        return observations, (self.reward_scale * rewards).astype(np.float32), ended, self._infos

    def _update_infos(
        self, batch_infos: dict[str, Any], ended: NDArray[np.intp], interrupted: NDArray[np.bool_]
    ) -> None:
        """Enter the infos of the rows that ended, and clear those of the step before."""
        for row in self._rows_with_info:
            self._infos[row] = {}
        for row in ended.tolist():
            self._infos[row] = self._last_info(batch_infos, row)
            self._infos[row]["TimeLimit.truncated"] = bool(interrupted[row])
        self._rows_with_info = ended

    def _last_potentials(self, ended: NDArray[np.bool_], interrupted: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Final potentials of the ended rows: 0 after a termination, else that of the last observation."""
        last = np.zeros(len(ended))
        if self.shaping is not None and interrupted.any():
            seen = np.stack([self._infos[row]["terminal_observation"] for row in np.flatnonzero(interrupted)])
            last[interrupted] = self.shaping.potential(seen)
        return last[ended]

    def _last_info(self, infos: dict[str, Any], row: int) -> Row:
        """SB3's info of a row whose episode has ended."""
        totals = infos["final_info"][info_keys.TOTALS]
        totals = {name: float(values[row]) for name, values in totals.items() if not name.startswith("_")}
        age_s = round(time.perf_counter() - self._birth_s, 6)
        return {
            "terminal_observation": infos["final_obs"][row],
            "episode": {"r": totals["return"], "l": int(totals["steps"]), "t": age_s},
            info_keys.TOTALS: totals,
        }

    def close(self) -> None:
        """Close the batched environment."""
        self.batch.close()

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """Give an attribute of the batched environment, once per requested row: the rows share it."""
        return [getattr(self.batch, attr_name) for _ in self._get_indices(indices)]

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Set an attribute of the batched environment, for all rows, since they share it."""
        self._require_all_rows("set_attr", attr_name, indices)
        setattr(self.batch, attr_name, value)

    def env_method(  # the base class's signature
        self, method_name: str, *method_args: Any, indices: VecEnvIndices = None, **method_kwargs: Any
    ) -> list[Any]:
        """Call a method of the batched environment once and repeat its result for each row."""
        self._require_all_rows("env_method", method_name, indices)
        return [getattr(self.batch, method_name)(*method_args, **method_kwargs)] * self.num_envs

    def _require_all_rows(self, call: str, name: str, indices: VecEnvIndices) -> None:
        if sorted(self._get_indices(indices)) != list(range(self.num_envs)):
            raise ValueError(f"{call}: {name}: the rows share one environment, so indices must be all of them or None")

    def env_is_wrapped(self, wrapper_class: type, indices: VecEnvIndices = None) -> list[bool]:
        """Whether the rows are wrapped: by Monitor, whose records are kept here, and by nothing else."""
        from stable_baselines3.common.monitor import Monitor

        return [issubclass(wrapper_class, Monitor) for _ in self._get_indices(indices)]

    def get_images(self) -> Sequence[NDArray[np.uint8] | None]:
        """Return no images; render a single environment instead."""
        return [None] * self.num_envs


def batched_env(env: VecEnv) -> Sb3VecEnv:
    """The adapter of the batched environment below SB3's wrappers."""
    inner = env.unwrapped
    assert isinstance(inner, Sb3VecEnv), "make_env gives no other"
    return inner
