"""Several followers as a PettingZoo environment, in which all act at once."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray
from pettingzoo import ParallelEnv  # type: ignore[import-untyped]

from formation_env.envs import group_options, interface
from formation_env.envs.swarm import FormationSwarmEnv, joint
from formation_env.task import observation
from formation_env.task.scenario import Scenario

Vectors = dict[str, NDArray[np.float32]]


class FormationParallelEnv(ParallelEnv[str, NDArray[np.float32], NDArray[np.float32]]):  # type: ignore[misc]
    """A group of followers, each an agent `follower_0`, `follower_1`, ...

    Observation (size,), action (3,) and reward of an agent are those of its line in a `FormationSwarmEnv`; infos have
    the same keys, `cost` among them. An agent whose episode has ended leaves; with `safety.ends: group` all do.
    """

    metadata: dict[str, Any] = {"name": "formation_v0", "render_modes": []}  # noqa: RUF012

    def __init__(self, scenario: str | Path | Scenario = "swarm", render_mode: str | None = None) -> None:
        """Make the environment; the arguments are those of `FormationSwarmEnv`.

        Raises:
            ConfigError: the scenario is wrong.
            ValueError: a render mode.
        """
        self._env = FormationSwarmEnv(scenario, render_mode)
        self.scenario, self.layout, self.render_mode = self._env.scenario, self._env.layout, None
        self.possible_agents = [f"follower_{index}" for index in range(self.scenario.followers)]
        self.agents: list[str] = []
        bound = observation.BOUND
        self.observation_spaces = {name: joint(-bound, bound, (self.layout.size,)) for name in self.possible_agents}
        self.action_spaces = {name: interface.action_space() for name in self.possible_agents}

    def observation_space(self, agent: str) -> spaces.Space[NDArray[np.float32]]:
        """Space of an agent's observation."""
        return self.observation_spaces[agent]

    def action_space(self, agent: str) -> spaces.Space[NDArray[np.float32]]:
        """Space of an agent's action."""
        return self.action_spaces[agent]

    def reset(
        self, seed: int | None = None, options: Mapping[str, Any] | None = None
    ) -> tuple[Vectors, dict[str, dict[str, Any]]]:
        """Begin an episode; see `FormationSwarmEnv.reset`. Other options are left alone, as PettingZoo's tests want."""
        known = {name: value for name, value in (options or {}).items() if name in group_options.KNOWN}
        observations, info = self._env.reset(seed=seed, options=known)
        self.agents = list(self.possible_agents)
        return self._by_agent(observations), self._infos(info)

    def step(
        self, actions: Mapping[str, Any]
    ) -> tuple[Vectors, dict[str, float], dict[str, bool], dict[str, bool], dict[str, dict[str, Any]]]:
        """Fly one step with an action (3,) of each agent.

        Raises:
            ValueError: an agent has no action, or a wrong one; nothing has changed then.
            gymnasium.error.ResetNeeded: before the first reset.
        """
        joined = np.zeros((len(self.possible_agents), 3), np.float32)
        for name in self.agents:
            if name not in actions:
                raise ValueError(f"actions: none for {name!r}")
            joined[self.possible_agents.index(name)] = interface.check_action(actions[name])
        observations, _, _, _, info = self._env.step(joined)
        terminated, truncated = self._env.of_followers("terminated"), self._env.of_followers("truncated")
        results = (
            self._by_agent(observations),
            {name: float(value) for name, value in self._by_agent(info["reward"]).items()},
            {name: bool(value) for name, value in self._by_agent(terminated).items()},
            {name: bool(value) for name, value in self._by_agent(truncated).items()},
            self._infos(info),
        )
        ended = self._by_agent(terminated | truncated)
        self.agents = [name for name in self.agents if not ended[name]]
        return results

    def state(self) -> NDArray[np.float32]:
        """The observations of all followers (followers, size), also of those that have left."""
        return self._env.last_observations()

    def _by_agent(self, values: NDArray[Any]) -> dict[str, Any]:
        """One value for each agent that is there."""
        return {name: values[self.possible_agents.index(name)] for name in self.agents}

    def _infos(self, info: dict[str, Any]) -> dict[str, dict[str, Any]]:
        """Each agent's part of the infos."""
        totals = info.pop("episode_totals", {})
        shown = {name: {key: values[index] for key, values in info.items()} for name, index in self._places()}
        for name, index in self._places():
            if totals:
                shown[name]["episode_totals"] = {key: float(values[index]) for key, values in totals.items()}
        return shown

    def _places(self) -> list[tuple[str, int]]:
        return [(name, self.possible_agents.index(name)) for name in self.agents]
