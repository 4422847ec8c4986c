"""Behaviour cloning of a classical policy on the states that the clone visits (DAgger, Ross et al. 2011)."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
"""Samples of a gradient step."""
EPOCHS: Final = 3
"""Passes over all samples after each round."""
LEARNING_RATE: Final = 2e-3
"""Initial value; it falls linearly to `LAST_SHARE` of that."""
LAST_SHARE: Final = 0.05
THRUST_WEIGHT: Final = 5.0
"""Weight of the thrust's error relative to the throttle's, which is the larger one near coasting."""
TEACHER_NOISE: Final = 0.5
"""Standard deviation of the noise on the teacher's thrust in the first round, relative to that thrust, so that the
samples contain recoveries from deviations."""


@dataclass(frozen=True)
class Lesson:
    """Task of an imitation.

    Attributes:
        teacher: policy to imitate.
        scenario: task that is flown.
        throttle_power: p of the thrust sign(z) |z|^p for a throttle z.
        magnification: factor of the errors in the features.
    """

    teacher: Policy
    scenario: Scenario
    throttle_power: float
    magnification: float


def imitate(
    network: nn.Module,
    lesson: Lesson,
    rounds: Sequence[Sequence[int]],
    generator: np.random.Generator,
    progress: Callable[[int], Any] = lambda count: None,
) -> None:
    """Fit a network to a teacher's actions. The teacher flies the first round, the network all others.

    Args:
        network: from features (rows, SIZE) to throttles before the tanh (rows, 3); fitted in place.
        lesson: teacher and task.
        rounds: seeds of each round's episodes.
        generator: of the teacher's noise and of the order of samples.
        progress: called with 1 after each round.
    """
    optimizer = torch.optim.Adam(network.parameters(), LEARNING_RATE)
    schedule = torch.optim.lr_scheduler.LinearLR(optimizer, 1.0, LAST_SHARE, len(rounds) * EPOCHS)
    features_seen, teacher_actions = list[Tensor](), list[Tensor]()
    for index, seeds in enumerate(rounds):
        for inputs, actions in _fly(None if index == 0 else network, lesson, seeds, generator):
            features_seen.append(inputs)
            teacher_actions.append(actions)
        all_inputs, all_actions = torch.cat(features_seen), torch.cat(teacher_actions)
        for _ in range(EPOCHS):
            _fit(network, lesson.throttle_power, optimizer, (all_inputs, all_actions), generator)
            schedule.step()
        progress(1)


def _fit(
    network: nn.Module,
    throttle_power: float,
    optimizer: torch.optim.Optimizer,
    samples: tuple[Tensor, Tensor],
    generator: np.random.Generator,
) -> None:
    """One pass over the samples: features and the teacher's actions."""
    inputs, actions = samples
    throttles = actions.sign() * actions.abs() ** (1 / throttle_power)
    for rows in torch.split(torch.as_tensor(generator.permutation(len(inputs))), BATCH):
        z = network(inputs[rows]).tanh()
        loss = ((z - throttles[rows]) ** 2).mean()
        loss = loss + THRUST_WEIGHT * ((thrust_of(z, throttle_power) - actions[rows]) ** 2).mean()
        optimizer.zero_grad()
        loss.backward()
        optimizer.step()


def _fly(
    network: nn.Module | None, lesson: Lesson, seeds: Sequence[int], generator: np.random.Generator
) -> list[tuple[Tensor, Tensor]]:
    """Features at each step and the teacher's actions there; without a network the noisy teacher flies."""
    env, samples = FormationVectorEnv(len(seeds), lesson.scenario), []
    observations, _ = env.reset(seed=list(seeds))
    for _ in range(lesson.scenario.num_steps):
        inputs = torch.as_tensor(features(observations, lesson.magnification))
        taught: Array32 = lesson.teacher.predict(observations)[0]
        samples.append((inputs, torch.as_tensor(taught)))
        if network is None:
            flown = taught + TEACHER_NOISE * np.abs(taught) * generator.standard_normal(taught.shape, np.float32)
        else:
            with torch.no_grad():
                flown = thrust_of(network(inputs).tanh(), lesson.throttle_power).numpy()
        observations = env.step(np.clip(flown, -1, 1))[0]
    return samples
