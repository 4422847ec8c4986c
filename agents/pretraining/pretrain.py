"""From a scenario to an actor that flies it, without reinforcement learning: a clone, improved by the gradient."""

import copy
import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, Final

import numpy as np
import torch
from torch import nn

from agents.algorithms.models import ACTIVATIONS
from agents.hyperparameters import Network, Pretraining
from agents.policy.actor import Actor, Functions
from agents.pretraining.gradient import ModelEpisodes
from agents.pretraining.imitation import imitate
from agents.pretraining.recording import record_disturbances
from baselines import make_policy
from formation_env.evaluation.rollout import evaluate
from formation_env.evaluation.seeds import seeds
from formation_env.task.observation import SIZE
from formation_env.task.scenario import Scenario
from formation_env.task.variants import draw_variants

UPDATES_A_JUDGEMENT: Final = 50
"""After so many the network flies the validation seeds; the best one is kept."""
_WARM_UP: Final = 20
_MAX_NORM: Final = 1.0
_FIRST_SEED: Final = 500_000
"""Of the training split: far behind those that reinforcement learning begins with."""
_FIRST_OUTPUT: Final = 0.1
"""Factor of the last layer's first weights: a new network hardly thrusts."""


def pretrain(
    how: Pretraining,
    network: Network,
    functions: Functions,
    scenario: Scenario,
    seed: int,
    validation_episodes: int = 64,
    progress: Callable[[str, float], Any] = lambda done, cost: None,
) -> Actor:
    """The actor of least validation cost on the way.

    Args:
        how: what is done.
        network: its layers.
        functions: what stands between and behind them.
        scenario: what is flown.
        seed: of weights, samples and episodes.
        validation_episodes: on which the best is chosen.
        progress: told what has just been done, and the mean validation cost that it came to, m/s.

    Raises:
        ConfigError: no teacher of that name, or a nonlinear truth where the gradient is wanted.
    """
    generator, power = np.random.default_rng(seed), functions.throttle_power
    net = _network(network, seed)
    episodes = _training_seeds(how, seed)
    best, least = copy.deepcopy(net), math.inf

    def judge(text: str) -> None:
        nonlocal best, least
        actor = _actor(net, functions, scenario)
        cost = -float(evaluate(actor, scenario, seeds("validation", validation_episodes))["return"].mean())
        progress(text, cost)
        if cost < least:
            best, least = copy.deepcopy(net), cost

    models = _models(how, functions, scenario, episodes[how.rows * how.rounds :]) if how.updates else []
    if how.rounds:
        teacher = make_policy(how.teacher, scenario)
        rounds = [episodes[how.rows * i : how.rows * (i + 1)] for i in range(how.rounds)]
        imitate(net, power, teacher, scenario, rounds, functions.magnification, generator)
        judge(f"after imitating {how.teacher}")
    if models:
        descend(net, power, models, how, generator, judge)
    return _actor(best, functions, scenario)


def _models(how: Pretraining, functions: Functions, scenario: Scenario, recorded: range) -> list[ModelEpisodes]:
    """Recorded episodes, evenly shared among the scenario's variants."""
    variants = draw_variants(scenario)[: how.episodes]
    return [
        ModelEpisodes(record_disturbances(variant, recorded[k :: len(variants)]), functions.magnification)
        for k, variant in enumerate(variants)
    ]


def descend(
    net: nn.Module,
    throttle_power: float,
    models: Sequence[ModelEpisodes],
    how: Pretraining,
    generator: np.random.Generator,
    judge: Callable[[str], Any],
) -> None:
    """Follow the cost's gradient through the model.

    Args:
        net: from features to outputs; changed in place.
        throttle_power: p of the thrust sign(z) |z|^p that the outputs' z = tanh stands for.
        models: the episodes of each variant of the scenario; each update takes those of one.
        how: how many updates, of which size.
        generator: chooses the episodes of each.
        judge: called with a text from time to time, and at the end.
    """
    optimizers = _optimizers(net, how.learning_rate)
    schedules = [
        torch.optim.lr_scheduler.LambdaLR(optimizer, lambda k: _share(k, how.updates)) for optimizer in optimizers
    ]
    for update in range(1, how.updates + 1):
        model = models[generator.integers(len(models))]
        rows = torch.as_tensor(generator.choice(model.rows, min(how.batch, model.rows), replace=False))
        net.zero_grad()
        model.cost(net, throttle_power, rows).backward()
        nn.utils.clip_grad_norm_(net.parameters(), _MAX_NORM)
        for optimizer, schedule in zip(optimizers, schedules, strict=True):
            optimizer.step()
            schedule.step()
        if update % UPDATES_A_JUDGEMENT == 0 or update == how.updates:
            judge(f"after {update} updates through the model")


def _optimizers(net: nn.Module, learning_rate: float) -> list[torch.optim.Optimizer]:
    """Muon (Jordan et al. 2024) for weights: it gives all directions of a matrix the same step, the weak ones, too.

    It has no rule for biases, which Adam takes.
    """
    weights = [part for part in net.parameters() if part.ndim > 1]
    biases = [part for part in net.parameters() if part.ndim == 1]
    muon = torch.optim.Muon(weights, learning_rate, weight_decay=0.0, adjust_lr_fn="match_rms_adamw")
    return [muon, torch.optim.Adam(biases, learning_rate)]


def _share(update: int, updates: int) -> float:
    """Of the greatest learning rate: up within `_WARM_UP` updates, then down to nearly nothing with the cosine."""
    return min(1.0, (update + 1) / _WARM_UP) * (0.505 + 0.495 * math.cos(math.pi * update / updates))


def _network(network: Network, seed: int) -> nn.Sequential:
    """A new network from features to outputs."""
    widths, layers = [SIZE, *network.hidden], list[nn.Module]()
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        for inside, outside in itertools.pairwise(widths):
            layers += [nn.Linear(inside, outside), ACTIVATIONS[network.activation]()]
        last = nn.Linear(widths[-1], 3)
    with torch.no_grad():
        last.weight.mul_(_FIRST_OUTPUT)
        last.bias.zero_()
    return nn.Sequential(*layers, last)


def _actor(net: nn.Sequential, functions: Functions, scenario: Scenario) -> Actor:
    """The network as it is now, without torch."""
    linear = [layer for layer in net if isinstance(layer, nn.Linear)]
    layers = [(layer.weight.detach().numpy().copy(), layer.bias.detach().numpy().copy()) for layer in linear]
    return Actor(layers, functions, scenario)


def _training_seeds(how: Pretraining, seed: int) -> range:
    """Episodes of imitation and, behind them, of the gradient; others for each seed."""
    count = how.rows * how.rounds + how.episodes
    return seeds("training", _FIRST_SEED + (seed + 1) * count)[-count:]
