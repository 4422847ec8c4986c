"""Behaviour cloning of a classical policy, on what the clone itself sees (DAgger, Ross et al. 2011)."""

from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from agents.policy.features import features
from agents.policy.throttle import thrust_of
from formation_env.envs import FormationVectorEnv
from formation_env.evaluation.rollout import Policy
from formation_env.task.scenario import Scenario

Array32 = NDArray[np.float32]
BATCH: Final = 512
EPOCHS: Final = 3
LEARNING_RATE: Final = 2e-3
"""At the first round; it falls to a twentieth."""
THRUST_WEIGHT: Final = 5.0
"""Of errors of the thrust over errors of the throttle, which count most near coasting."""
_SHAKE: Final = 0.5
"""Share of its thrust by which the teacher is shaken on the first flight, so that it shows how it recovers."""


def imitate(
    network: nn.Module,
    throttle_power: float,
    teacher: Policy,
    scenario: Scenario,
    rounds: Sequence[Sequence[int]],
    magnification: float,
    generator: np.random.Generator,
    progress: Callable[[int], Any] = lambda count: None,
) -> None:
    """Fit a network to a teacher's actions. The first round is flown by the teacher, the others by the network.

    Args:
        network: from features (rows, SIZE) to throttles before the tanh (rows, 3); fitted in place.
        throttle_power: p of the thrust that a throttle stands for.
        teacher: whose actions are the goal.
        scenario: what is flown.
        rounds: seeds of each round's episodes.
        magnification: of the features.
        generator: of the shaking and of the order of samples.
        progress: called with 1 after each round.
    """
    optimizer = torch.optim.Adam(network.parameters(), LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, 0.05, len(rounds) * EPOCHS)
    seen, wanted = list[Tensor](), list[Tensor]()
    for index, seeds in enumerate(rounds):
        flown_by = None if index == 0 else network
        for shown, action in _fly(flown_by, throttle_power, teacher, scenario, seeds, magnification, generator):
            seen.append(shown)
            wanted.append(action)
        inputs, actions = torch.cat(seen), torch.cat(wanted)
        for _ in range(EPOCHS):
            _fit(network, throttle_power, optimizer, inputs, actions, generator)
            schedule.step()
        progress(1)


def _fit(
    network: nn.Module,
    throttle_power: float,
    optimizer: torch.optim.Optimizer,
    inputs: Tensor,
    actions: Tensor,
    generator: np.random.Generator,
) -> None:
    """One pass over the samples."""
    throttles = actions.sign() * actions.abs() ** (1 / throttle_power)
    for rows in torch.as_tensor(generator.permutation(len(inputs))).split(BATCH):
        z = network(inputs[rows]).tanh()
        loss = ((z - throttles[rows]) ** 2).mean()
        loss = loss + THRUST_WEIGHT * ((thrust_of(z, throttle_power) - actions[rows]) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()


def _fly(
    network: nn.Module | None,
    throttle_power: float,
    teacher: Policy,
    scenario: Scenario,
    seeds: Sequence[int],
    magnification: float,
    generator: np.random.Generator,
) -> list[tuple[Tensor, Tensor]]:
    """Features seen at each step, and the teacher's actions there; flown by the network, or by the shaken teacher."""
    env, samples = FormationVectorEnv(len(seeds), scenario), []
    observations, _ = env.reset(seed=list(seeds))
    for _ in range(scenario.num_steps):
        shown = torch.as_tensor(features(observations, magnification))
        wanted: Array32 = teacher.predict(observations)[0]
        samples.append((shown, torch.as_tensor(wanted)))
        if network is None:
            flown = wanted + _SHAKE * np.abs(wanted) * generator.standard_normal(wanted.shape, np.float32)
        else:
            with torch.no_grad():
                flown = thrust_of(network(shown).tanh(), throttle_power).numpy()
        observations = env.step(np.clip(flown, -1, 1))[0]
    return samples
