"""The environment of one group of followers, as a single agent sees it: all observations in, all actions out."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, cast

import gymnasium
import numpy as np
from gymnasium import spaces
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray

from formation_env.envs import group_options, info_keys, interface
from formation_env.kernel.group_simulation import GroupSimulation
from formation_env.kernel.metrics import episode_metrics
from formation_env.task import observation
from formation_env.task.loading import load_scenario
from formation_env.task.observation import observation_layout
from formation_env.task.scenario import Scenario

Observations = NDArray[np.float32]

_ONLY_GROUP: Final = np.zeros(1, np.intp)


class FormationSwarmEnv(gymnasium.Env[Observations, NDArray[np.float32]]):
    """A group of followers that fly a scenario around their leader, with a joint action.

    Observation: (followers, size), a line for each follower, see `formation_env.task.observation`. Action:
    (followers, 3), LVLH accelerations in units of each one's max_accel_m_s2. Reward: the mean of the followers'.
    Infos hold one value for each follower.

    Truncated at the end of the plan; terminated when all episodes have ended (`scenario.Safety.ends`): a follower
    whose own has ended is gone, its actions do nothing, and `info["present"]` says so.
    """

    metadata: dict[str, Any] = {"render_modes": []}  # noqa: RUF012

    @interface.known_arguments
    def __init__(
        self, scenario: str | Path | Scenario = "swarm", render_mode: str | None = None, analysis: bool = False
    ) -> None:
        """Make the environment; the arguments are those of `FormationEnv`, without a render mode.

        Raises:
            ConfigError: the scenario is wrong.
            ValueError: a render mode.
        """
        if render_mode is not None:
            raise ValueError(f"render_mode: the environment of several followers has none, got {render_mode!r}")
        self.scenario = load_scenario(scenario)
        self._spec: EnvSpec | None = None
        self.render_mode = None
        self.layout = observation_layout(self.scenario)
        count = self.scenario.followers
        self.action_space = joint(-1.0, 1.0, (count, 3))
        self.observation_space = joint(-observation.BOUND, observation.BOUND, (count, self.layout.size))
        self.simulation = GroupSimulation(self.scenario, 1, with_noises=analysis)
        self._observations = self.simulation.new_observations()
        self._infos = info_keys.keys_of(self.scenario, guarded=True, analysis=analysis)
        self._keyed = False

    @property
    def spec(self) -> EnvSpec | None:
        """Gymnasium's spec of the environment; `max_episode_steps` is the length of the scenario's plan."""
        return self._spec

    @spec.setter
    def spec(self, spec: EnvSpec | None) -> None:
        self._spec = interface.with_length(spec, self.scenario.num_steps)

    def reset(
        self, *, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Observations, dict[str, Any]]:
        """Begin an episode.

        Args:
            seed: seed of new random streams; without it the present streams continue.
            options: `initial_state`: true LVLH states (followers, 6) to start at, m and m/s; `slots`: who flies where,
                (followers,).

        Raises:
            ValueError: wrong options or seed.
        """
        seed = interface.check_seed(seed)
        slots, starts = group_options.read(options, self.simulation)
        super().reset(seed=seed)
        simulation = self.simulation
        if seed is not None or not self._keyed:
            simulation.seed_group(0, self.np_random)
            self._keyed = True
        simulation.reset_groups(_ONLY_GROUP, self._observations, slots, starts)
        simulation.forget_ends(simulation.rows_of(_ONLY_GROUP).ravel())
        return self._observations.copy(), self._info()

    def step(self, action: Any) -> tuple[Observations, float, bool, bool, dict[str, Any]]:
        """Fly one step.

        Args:
            action: (followers, 3), in units of max_accel_m_s2, clipped to [-1, 1].

        Raises:
            ValueError: the action has a wrong shape or is not finite; nothing has changed then.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        actions = interface.check_actions(action, self.scenario.followers)
        if not self._keyed:
            raise gymnasium.error.ResetNeeded("step: call reset first")
        simulation = self.simulation
        simulation.set_actions(actions[None])
        ended = simulation.step(self._observations)
        info = self._info()
        terminated, truncated = self.of_followers("terminated"), self.of_followers("truncated")
        if ended:
            metrics = episode_metrics(simulation)
            info[info_keys.TOTALS] = {name: simulation.by_group(value)[0] for name, value in metrics.items()}
        reward = float(simulation.rewards()[0])
        return self._observations.copy(), reward, bool(terminated.all()), bool(truncated.any()), info

    def last_observations(self) -> Observations:
        """Copy (followers, size) of the last observations."""
        return self._observations.copy()

    def of_followers(self, name: str) -> NDArray[Any]:
        """Copy (followers, ...) of a result of the last step or reset, by its name in `kernel.results`."""
        values: NDArray[Any] = self.simulation.by_group(self.simulation.results[name])[0]
        return values.copy()

    def _info(self) -> dict[str, Any]:
        simulation = self.simulation
        blocks = simulation.results.blocks
        info = {
            name: simulation.by_group(blocks[block][place, : simulation.num_rows].T)[0].copy()
            for name, _, block, place in self._infos
        }
        info["reward"] = self.of_followers("reward")
        info["present"] = simulation.by_group(simulation.gone.ravel())[0] == 0.0
        info["slots"] = simulation.slots[0].copy()
        return info


def joint(low: float, high: float, shape: tuple[int, ...]) -> spaces.Space[NDArray[np.float32]]:
    """A space of float32 within bounds."""
    return cast(spaces.Space[NDArray[np.float32]], spaces.Box(low, high, shape, np.float32))
