"""The batched environment of groups of followers."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import gymnasium
import numpy as np
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from formation_env.envs import group_options, info_keys, interface
from formation_env.envs.batch_arguments import (
    MASK_OPTION,
    check_arguments,
    check_ready,
    read_autoreset_mode,
    read_mask,
)
from formation_env.envs.swarm import joint
from formation_env.kernel.group_simulation import GroupSimulation
from formation_env.kernel.metrics import episode_metrics
from formation_env.kernel.threads import check_num_threads
from formation_env.task import observation
from formation_env.task.loading import load_scenario
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario

Observations = NDArray[np.float32]
ROWS_PER_FOLLOWER: Final = 4
"""A follower of a group takes about as long as so many alone; from there on it pays to share a step."""
Flags = NDArray[np.bool_]

_NO_GROUPS: Final = np.empty(0, np.intp)


class FormationSwarmVectorEnv(VectorEnv[Observations, NDArray[np.float32], NDArray[Any]]):
    """Many groups of followers; group i equals, bit for bit, a `FormationSwarmEnv` with its seed.

    Observations are (num_envs, followers, size), actions (num_envs, followers, 3), rewards the means over followers
    (num_envs,); infos have a value for each follower, (num_envs, followers, ...), `info["reward"]` among them.
    Groups that end are reset as `FormationVectorEnv` says.
    """

    metadata: dict[str, Any] = {"render_modes": [], "autoreset_mode": AutoresetMode.SAME_STEP}  # noqa: RUF012

    @interface.known_arguments
    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | Path | Scenario = "swarm",
        render_mode: str | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.SAME_STEP,
        analysis: bool = False,
        num_threads: int | None = None,
    ) -> None:
        """Make the environment of `num_envs` groups; the other arguments are those of `FormationVectorEnv`.

        Raises:
            ConfigError: the scenario is wrong.
            ValueError: no groups, a render mode, an unknown autoreset mode or no threads.
        """
        check_arguments(num_envs, render_mode, None)
        self.autoreset_mode = read_autoreset_mode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.scenario = load_scenario(scenario)
        self.num_envs = num_envs
        self._spec: EnvSpec | None = None
        self.render_mode = None
        self.layout = observation_layout(self.scenario)
        count, size = self.scenario.followers, self.layout.size
        self.single_action_space = joint(-1.0, 1.0, (count, 3))
        self.single_observation_space = joint(-observation.BOUND, observation.BOUND, (count, size))
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        threads = check_num_threads(num_threads, num_envs * count * ROWS_PER_FOLLOWER)
        self.simulation = GroupSimulation(self.scenario, num_envs, analysis, threads)
        self._shape = (num_envs, count, size)
        self._info_keys = info_keys.keys_of(self.scenario, guarded=True, analysis=analysis)
        self._last = np.zeros((num_envs * count, size), np.float32)
        self._keyed = False
        self._waiting = _NO_GROUPS  # groups that ended and are not reset yet

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec of the environment; `max_episode_steps` is the length of an episode."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = interface.with_length(spec, self.scenario.num_steps)

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | NDArray[np.integer] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode in all groups, or in those of a mask.

        Args:
            seed: group i gets seed + i, or the i-th of a list or array; without a seed the groups' streams continue.
            options: `initial_state`, (followers, 6) or (num_envs, followers, 6), and `slots`, (followers,) or
                (num_envs, followers), as of `FormationSwarmEnv`; `reset_mask` as of `FormationVectorEnv`.

        Raises:
            ValueError: wrong options or number of seeds.
        """
        others = dict(options or {})
        groups = read_mask(others.pop(MASK_OPTION, None), self.num_envs, self._keyed)
        slots, starts = group_options.read(others, self.simulation)
        seeds = interface.check_seeds(seed, self.num_envs)
        if isinstance(seeds, range):
            self._np_random, self._np_random_seed = gymnasium.utils.seeding.np_random(seeds.start)
        for group in groups.tolist():
            if seeds[group] is not None or not self._keyed:
                self.simulation.seed_group(group, np.random.default_rng(seeds[group]))
        self._keyed = True
        observations = self.simulation.new_observations()
        observations[:] = self._last
        self.simulation.new_results(self.simulation.rows_of(groups).ravel())
        self._begin(groups, observations, slots, starts)
        self._waiting = np.setdiff1d(self._waiting, groups)
        self._last = observations
        mask = self._mask(groups)
        return observations.reshape(self._shape), self._infos(mask)

    def step(self, actions: Any) -> tuple[Observations, NDArray[np.float64], Flags, Flags, dict[str, Any]]:
        """Fly one step in all groups.

        Args:
            actions: (num_envs, followers, 3), in units of max_accel_m_s2, clipped to [-1, 1].

        Raises:
            ValueError: the actions have a wrong shape or are not finite; nothing has changed then.
            gymnasium.error.ResetNeeded: before the first reset, or a group has ended and autoreset is disabled.
        """
        actions = interface.check_actions(actions, *self._shape[:2])
        check_ready(self._keyed, self._waiting if self.autoreset_mode is AutoresetMode.DISABLED else _NO_GROUPS)
        simulation = self.simulation
        simulation.set_actions(actions)
        observations = simulation.new_observations()
        num_ended = simulation.step(observations)
        if len(self._waiting):  # they begin in this step; what they flew is overwritten
            self._begin(self._waiting, observations)
        rewards = simulation.rewards()
        terminations: Flags = np.all(self._of_followers("terminated"), axis=1)
        truncations: Flags = np.any(self._of_followers("truncated"), axis=1)
        ended = np.flatnonzero(terminations | truncations) if num_ended else _NO_GROUPS
        infos = self._infos(np.ones(self.num_envs, bool))
        if len(ended):
            infos |= self._end(infos, observations, ended)
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            self._waiting = ended
        self._last = observations
        return observations.reshape(self._shape), rewards, terminations, truncations, infos

    def _begin(
        self, groups: NDArray[np.intp], observations: Observations, slots: Any = None, starts: Any = None
    ) -> None:
        """Reset some groups; neither reward nor end of a step before is theirs."""
        if len(groups):
            chosen = None if slots is None else slots[groups]
            self.simulation.reset_groups(groups, observations, chosen, None if starts is None else starts[groups])
            self.simulation.forget_ends(self.simulation.rows_of(groups).ravel())

    def _end(self, infos: dict[str, Any], observations: Observations, ended: NDArray[np.intp]) -> dict[str, Any]:
        """Infos of groups that ended, with their totals; with SAME_STEP they are reset."""
        mask = self._mask(ended)
        metrics = episode_metrics(self.simulation)
        totals = {name: np.where(mask[:, None], self.simulation.by_group(each), 0.0) for name, each in metrics.items()}
        shown = info_keys.with_mask({info_keys.TOTALS: info_keys.with_mask(totals, mask)}, mask)
        if self.autoreset_mode is not AutoresetMode.SAME_STEP:
            return shown
        final_info = {name: value.copy() for name, value in infos.items()} | shown
        final_obs = np.empty(self.num_envs, object)  # None everywhere
        for group, each in zip(ended.tolist(), observations.reshape(self._shape)[ended], strict=True):
            final_obs[group] = each
        self.simulation.reset_groups(ended, observations)
        finals = info_keys.with_mask({"final_info": final_info, "final_obs": final_obs}, mask)
        return self._infos(np.ones(self.num_envs, bool)) | finals

    def _of_followers(self, name: str) -> NDArray[Any]:
        """A result (num_envs, followers, ...) of the last step or reset."""
        return self.simulation.by_group(self.simulation.results[name])

    def _infos(self, mask: Flags) -> dict[str, Any]:
        """Infos of the last step or reset in Gymnasium's form."""
        simulation = self.simulation
        blocks = simulation.results.blocks
        shown: dict[str, Any] = {
            name: simulation.by_group(blocks[block][place, : simulation.num_rows].T)
            for name, _, block, place in self._info_keys
        }
        shown["reward"] = self._of_followers("reward")
        shown["present"] = simulation.by_group(simulation.gone.ravel()) == 0.0
        shown["slots"] = simulation.slots.copy()
        return info_keys.with_mask(shown, mask)

    def _mask(self, groups: NDArray[np.intp]) -> Flags:
        """Which groups are among some (num_envs,)."""
        mask = np.zeros(self.num_envs, bool)
        mask[groups] = True
        return mask
