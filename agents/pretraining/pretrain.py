"""Pretraining of an actor: imitation of a classical policy, then gradient descent through the model."""

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import torch
from torch import nn

from agents.algorithms.throttle_policy import ACTIVATIONS
from agents.hyperparameters import Network, Pretraining
from agents.policy.actor import ACTIONS, Actor, Functions
from agents.pretraining.gradient import ModelEpisodes
from agents.pretraining.imitation import Lesson, imitate
from agents.pretraining.recording import check_separation, record_disturbances
from baselines import make_policy
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.settings import ConfigError
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario
from formation_env.task.variants import draw_variants

UPDATES_PER_VALIDATION: Final = 50
"""Updates between validations; the best network is kept, since the cost still fluctuates at high learning rates."""
_WARM_UP_UPDATES: Final = 20
"""Updates over which the learning rate rises from zero: Muon's momentum averages over about as many."""
_LAST_SHARE: Final = 0.01
"""Final learning rate over the peak value: the last updates average out the noise of the batches."""
_MAX_NORM: Final = 1.0
"""Gradients are clipped to this norm; typical ones are below 0.1, those of an unstable closed loop far above."""
_FIRST_SEED: Final = 500_000
"""Offset in the training split, far behind the seeds with which reinforcement learning begins."""
_FIRST_OUTPUT: Final = 0.1
"""Factor of the last layer's initial weights: a new network hardly thrusts."""


def pretrain(
    settings: Pretraining,
    network: Network,
    functions: Functions,
    scenario: Scenario,
    *,
    seed: int,
    validation_episodes: int,
    progress: Callable[[str, float], Any] = lambda stage, cost: None,
) -> Actor:
    """Train an actor without reinforcement learning; the best one on the validation seeds is kept.

    Args:
        settings: effort of imitation and gradient descent.
        network: layers.
        functions: functions between and after the layers.
        scenario: task that is flown.
        seed: of initial weights, samples and episodes.
        validation_episodes: episodes on which the best network is chosen.
        progress: called with the stage that has ended and the mean validation cost after it, m/s.

    Raises:
        ConfigError: no teacher of that name, or `check_pretraining` fails.
    """
    check_pretraining(settings, scenario, seed)
    generator, net = np.random.default_rng(seed), _network(network, seed)
    best = _BestNetwork(net, functions, scenario, validation_episodes, progress)
    episodes = _training_seeds(settings, seed)
    recorded = episodes[settings.rows * settings.rounds :]
    models = _models(settings, functions, scenario, recorded) if settings.updates else []
    if settings.rounds:
        lesson = Lesson(
            make_policy(settings.teacher, scenario), scenario, functions.throttle_power, functions.magnification
        )
        rounds = [episodes[settings.rows * i : settings.rows * (i + 1)] for i in range(settings.rounds)]
        imitate(net, lesson, rounds, generator)
        best.validate(f"after imitating {settings.teacher}")
    if models:
        descend(net, functions.throttle_power, models, settings, generator, best.validate)
    return best.actor


class _BestNetwork:
    """Best state on the validation seeds of a network in training.

    Attributes:
        actor: that state, without torch; the initial one before the first validation.
    """

    def __init__(
        self,
        net: nn.Sequential,
        functions: Functions,
        scenario: Scenario,
        episodes: int,
        progress: Callable[[str, float], Any],
    ) -> None:
        self._net, self._functions, self._scenario, self._progress = net, functions, scenario, progress
        self._seeds = seeds("validation", episodes)
        self._lowest_cost = math.inf
        self.actor = _actor(net, functions, scenario)

    def validate(self, stage: str) -> None:
        """Fly the network in its present state, and keep it if its cost is the lowest so far."""
        actor = _actor(self._net, self._functions, self._scenario)
        cost = -float(evaluate(actor, self._scenario, self._seeds)["return"].mean())
        self._progress(stage, cost)
        if cost < self._lowest_cost:
            self.actor, self._lowest_cost = actor, cost


def check_pretraining(settings: Pretraining, scenario: Scenario, seed: int) -> None:
    """Refuse a pretraining that would fail or mislead later, before any work is done.

    Raises:
        ConfigError: too few training seeds, or, if the gradient is used, disturbances that depend on the thrust.
    """
    try:
        _training_seeds(settings, seed)
    except ConfigError:
        raise ConfigError(f"seed: no training seeds are left for pretraining, got {seed}") from None
    if settings.updates:
        for variant in draw_variants(scenario):
            check_separation(variant)


def _models(settings: Pretraining, functions: Functions, scenario: Scenario, recorded: range) -> list[ModelEpisodes]:
    """Recorded episodes, evenly distributed among the scenario's variants."""
    variants = draw_variants(scenario)[: settings.episodes]
    return [
        ModelEpisodes(record_disturbances(variant, recorded[k :: len(variants)]), functions.magnification)
        for k, variant in enumerate(variants)
    ]


def descend(
    net: nn.Module,
    throttle_power: float,
    models: Sequence[ModelEpisodes],
    settings: Pretraining,
    generator: np.random.Generator,
    validate: Callable[[str], Any],
) -> None:
    """Minimise the mean cost by gradient descent through the model.

    Args:
        net: from features to outputs; changed in place.
        throttle_power: p of the thrust sign(z) |z|^p for z = tanh(output).
        models: episodes of each variant of the scenario; each update uses those of one.
        settings: number and size of the updates.
        generator: chooses the episodes of each update.
        validate: called with a text every `UPDATES_PER_VALIDATION` updates and at the end.
    """
    optimizers = _optimizers(net, settings.learning_rate)
    schedules = [
        torch.optim.lr_scheduler.LambdaLR(optimizer, lambda k: _learning_rate_share(k, settings.updates))
        for optimizer in optimizers
    ]
    for update in range(1, settings.updates + 1):
        model = models[int(generator.integers(len(models)))]
        rows = torch.as_tensor(generator.choice(model.rows, min(settings.batch, model.rows), replace=False))
        net.zero_grad()
        model.cost(net, throttle_power, rows).backward()  # type: ignore[no-untyped-call] # torch leaves it untyped
        nn.utils.clip_grad_norm_(net.parameters(), _MAX_NORM)
        for optimizer, schedule in zip(optimizers, schedules, strict=True):
            optimizer.step()
            schedule.step()
        if update % UPDATES_PER_VALIDATION == 0 or update == settings.updates:
            validate(f"after {update} updates through the model")


def _optimizers(net: nn.Module, learning_rate: float) -> list[torch.optim.Optimizer]:
    """Muon (Jordan et al. 2024) for weights: all directions of a matrix get the same step size, weak ones included.

    It has no rule for biases, for which Adam is used.
    """
    weights = [part for part in net.parameters() if part.ndim > 1]
    biases = [part for part in net.parameters() if part.ndim == 1]
    muon = torch.optim.Muon(weights, learning_rate, weight_decay=0.0, adjust_lr_fn="match_rms_adamw")
    return [muon, torch.optim.Adam(biases, learning_rate)]


def _learning_rate_share(update: int, updates: int) -> float:
    """Learning rate over its peak value: a linear rise, times a cosine decay from 1 to `_LAST_SHARE`."""
    middle, half = (1 + _LAST_SHARE) / 2, (1 - _LAST_SHARE) / 2
    return min(1.0, (update + 1) / _WARM_UP_UPDATES) * (middle + half * math.cos(math.pi * update / updates))


def _network(network: Network, seed: int) -> nn.Sequential:
    """Build a network from features to outputs."""
    widths, layers = [SIZE, *network.hidden], list[nn.Module]()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for inside, outside in itertools.pairwise(widths):
            layers += [nn.Linear(inside, outside), ACTIVATIONS[network.activation]()]
        last = nn.Linear(widths[-1], ACTIONS)
    with torch.no_grad():
        last.weight.mul_(_FIRST_OUTPUT)
        last.bias.zero_()
    return nn.Sequential(*layers, last)


def _actor(net: nn.Sequential, functions: Functions, scenario: Scenario) -> Actor:
    """Copy the network's present state into an actor."""
    linear = [layer for layer in net if isinstance(layer, nn.Linear)]
    layers = [(layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy()) for layer in linear]
    return Actor(layers, functions, scenario)


def _training_seeds(settings: Pretraining, seed: int) -> range:
    """Seeds of imitation and, after them, of the recorded episodes; different for each seed of a run.

    Raises:
        ConfigError: there are not so many.
    """
    count = settings.training_episodes
    return seeds("training", _FIRST_SEED + (seed + 1) * count)[-count:]
