"""What comes before reinforcement learning: the cost through the model is the environment's, and so is its gradient."""

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from agents_helpers import PRETRAINED, small_run
from torch import nn

from agents.hyperparameters import Network, Pretraining
from agents.policy.actor import Actor, Functions
from agents.policy.features import CUT, features
from agents.pretraining.gradient import SMOOTH_M, SMOOTH_THROTTLE, ModelEpisodes
from agents.pretraining.imitation import Lesson, imitate
from agents.pretraining.pretrain import check_pretraining, pretrain
from agents.pretraining.recording import record_disturbances
from agents.training.train import train
from baselines import make_policy
from formation_env import FormationVectorEnv, load_scenario
from formation_env.evaluation.rollout import evaluate
from formation_env.settings import ConfigError
from formation_env.task.observation import SIZE, SLICES
from formation_env.task.randomization import DomainRandomization
from formation_env.task.scenario import Reward, Scenario

MAGNIFICATION = 50.0
SEEDS = range(3_000_000, 3_000_006)


def short(name: str, hold_orbits: float = 0.2) -> Scenario:
    """A shipped scenario with short phases and a coarse step; random accelerations and outages as they are."""
    scenario = load_scenario(name)
    phases = tuple(
        dataclasses.replace(phase, transfer_orbits=min(phase.transfer_orbits, 0.3), hold_orbits=hold_orbits)
        for phase in scenario.phases
    )
    return dataclasses.replace(scenario, phases=phases, dt_s=60.0)


def network(size: float = 1.0, width: int = 8) -> nn.Sequential:
    """A network with thrusts of all sizes."""
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        net = nn.Sequential(nn.Linear(SIZE, width), nn.Tanh(), nn.Linear(width, 3))
    with torch.no_grad():
        net[-1].weight.mul_(size)
    return net


def actor(net: nn.Sequential, functions: Functions, scenario: Scenario) -> Actor:
    """The network in numpy."""
    layers = [(layer.weight.detach().numpy(), layer.bias.detach().numpy()) for layer in (net[0], net[2])]
    return Actor(layers, functions, scenario)


def flown_costs(net: nn.Sequential, functions: Functions, scenario: Scenario) -> np.ndarray:
    """What the environment says about each seed, m/s."""
    return -evaluate(actor(net, functions, scenario), scenario, SEEDS)["return"].to_numpy()


CASES = [
    ("keeping", Reward()),
    ("initialization", Reward(transfer_error_weight=0.002)),
    ("mission", Reward(error_cost="quadratic")),
]


@pytest.mark.parametrize(("name", "reward"), CASES)
def test_the_cost_through_the_model_is_the_environments(name: str, reward: Reward) -> None:
    """Other thrust, same seeds: recorded disturbances and the linear model give each episode's own return.

    The environment computes in double precision, this in single, over kilometres: 1e-4 of the cost. And each thrust
    and error counts less by what keeps its root smooth at zero.
    """
    scenario = dataclasses.replace(short(name), reward=reward)
    functions, net = Functions("tanh", "tanh", 2.0, MAGNIFICATION), network()
    model = ModelEpisodes(record_disturbances(scenario, SEEDS), MAGNIFICATION)
    with torch.no_grad():
        ours = [model.cost(net, 2.0, [row]).item() for row in range(len(SEEDS))]
    theirs = flown_costs(net, functions, scenario)
    assert theirs.min() > 0.01
    smooth = SMOOTH_THROTTLE * scenario.spacecraft.max_accel_m_s2 * scenario.num_steps * scenario.dt_s
    np.testing.assert_allclose(ours, theirs, rtol=1e-4, atol=smooth + SMOOTH_M * reward.error_weight)


def test_the_gradient_is_that_of_the_flown_cost() -> None:
    """Weights a little to both sides along a random direction: the flown costs' difference is what autograd says.

    Weights are single precision, and a tenth of a thousandth of each is moved: 2 %.
    """
    scenario = short("keeping")
    functions, net = Functions("tanh", "tanh", 2.0, MAGNIFICATION), network(size=0.3)
    model = ModelEpisodes(record_disturbances(scenario, SEEDS), MAGNIFICATION)
    model.cost(net, 2.0, slice(None)).backward()
    generator = torch.Generator().manual_seed(1)
    way = [torch.randn(p.shape, generator=generator) for p in net.parameters()]
    slope = sum(float((p.grad * w).sum()) for p, w in zip(net.parameters(), way, strict=True))
    step, costs = 1e-3, []
    for sign in (1.0, -2.0):
        with torch.no_grad():
            for p, w in zip(net.parameters(), way, strict=True):
                p.add_(sign * step * w)
        costs.append(flown_costs(net, functions, scenario).mean())
    assert abs(slope) > 0.01
    assert (costs[0] - costs[1]) / (2 * step) == pytest.approx(slope, rel=0.02)


def test_features_magnify_errors_and_leave_the_observation_alone() -> None:
    """Errors times the factor, the rest as it is, all within the cut."""
    observation = np.linspace(-1, 1, 2 * SIZE, dtype=np.float32).reshape(2, SIZE)
    before = observation.copy()
    shown = features(observation, 10.0)
    np.testing.assert_array_equal(observation, before)
    for block in ("error", "zero_effort_miss"):
        np.testing.assert_allclose(shown[:, SLICES[block]], np.clip(10 * before[:, SLICES[block]], -CUT, CUT))
    rest = slice(SLICES["error_log"].start, SIZE)
    np.testing.assert_array_equal(shown[:, rest], before[:, rest])


def test_the_models_features_are_the_environments() -> None:
    """At the start and after a transfer's first thrusts, what the network is shown is what the environment shows.

    Single precision of kilometres, magnified: 1e-3 of features of order 1.
    """
    scenario = short("initialization")
    model, shown = ModelEpisodes(record_disturbances(scenario, SEEDS), MAGNIFICATION), list[torch.Tensor]()

    class Spy(nn.Module):
        def forward(self, x: torch.Tensor) -> torch.Tensor:
            shown.append(x)
            return torch.full((len(x), 3), math.atanh(0.1))

    model.cost(Spy(), 1.0, slice(None))
    env = FormationVectorEnv(len(SEEDS), scenario)
    observation = env.reset(seed=list(SEEDS))[0]
    for step in range(scenario.num_steps):
        np.testing.assert_allclose(shown[step].numpy(), features(observation, MAGNIFICATION), atol=1e-3)
        observation = env.step(np.full((len(SEEDS), 3), 0.1, np.float32))[0]


def test_a_clone_flies_nearly_as_its_teacher() -> None:
    """Untaught, the network costs many times what LQR costs; taught, a little more than it."""
    scenario = short("keeping", hold_orbits=0.5)
    functions, net = Functions("tanh", "tanh", 2.0, MAGNIFICATION), network(size=0.1, width=64)
    teacher = make_policy("lqr", scenario)
    before = flown_costs(net, functions, scenario).mean()
    rounds = [range(3_100_000 + 64 * i, 3_100_064 + 64 * i) for i in range(4)]
    imitate(net, Lesson(teacher, scenario, 2.0, MAGNIFICATION), rounds, np.random.default_rng(0))
    after = flown_costs(net, functions, scenario).mean()
    lqr = -evaluate(teacher, scenario, SEEDS)["return"].mean()
    assert before > 3 * lqr
    assert lqr < after < 2 * lqr


def test_pretraining_keeps_the_best_and_repeats_itself() -> None:
    """Equal seeds give equal actors; the actor's validation cost is the lowest in the log."""
    scenario, log = short("keeping"), list[tuple[str, float]]()
    settings = Pretraining(rounds=1, rows=8, updates=4, episodes=8, batch=4)
    functions = Functions("tanh", "tanh", 2.0, MAGNIFICATION)
    first, second = (
        pretrain(
            settings,
            Network(hidden=(8,)),
            functions,
            scenario,
            seed=3,
            validation_episodes=8,
            progress=lambda stage, cost: log.append((stage, cost)),
        )
        for _ in range(2)
    )
    for (weight, bias), (other_weight, other_bias) in zip(first.layers, second.layers, strict=True):
        np.testing.assert_array_equal(weight, other_weight)
        np.testing.assert_array_equal(bias, other_bias)
    assert log[:2] == log[2:]
    cost = -evaluate(first, scenario, range(1_000_000, 1_000_008))["return"].mean()
    assert cost == pytest.approx(min(cost for _, cost in log), rel=1e-12)


@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("keeping_nonlinear", "pretraining: the gradient .* needs a linear truth; set updates: 0"),
        ("keeping_randomized", r"domain_randomization: .* give one of draw_variants\(scenario\)"),
    ],
)
def test_a_truth_that_is_not_one_linear_model_has_no_such_gradient(name: str, reason: str) -> None:
    """Said in one line."""
    with pytest.raises(ConfigError, match=f"^{reason}$"):
        record_disturbances(load_scenario(name), SEEDS)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        ({"spacecraft": {"thrust_noise": 0.05}}, "spacecraft.thrust_noise: 0, got 0.05"),
        ({"spacecraft": {"min_accel_m_s2": 1e-4}}, "spacecraft.min_accel_m_s2: 0, got 0.0001"),
        ({"filter": {"thrust_noise": 0.02}}, "filter.thrust_noise: 0, got 0.02"),
        ({"filter": {"dynamics": "hcw"}}, "a filter with the true dynamics, got filter.dynamics: hcw"),
    ],
)
def test_disturbances_that_depend_on_thrust_are_refused(
    changes: dict[str, dict[str, Any]], reason: str, tmp_path: Path
) -> None:
    """Recorded without thrust, they would be others than those flown; said before any work, and not in silence.

    Each of these scenarios does give other estimation errors, or another effect, under thrust than without.
    """
    scenario = short("keeping")
    parts = {key: dataclasses.replace(getattr(scenario, key), **values) for key, values in changes.items()}
    changed = dataclasses.replace(scenario, **parts)
    assert thrust_matters(changed)
    assert not thrust_matters(scenario)
    with pytest.raises(ConfigError, match=f"^pretraining: the gradient through the model needs {reason}"):
        record_disturbances(changed, SEEDS)
    run = small_run(tmp_path, "ppo", PRETRAINED)
    with pytest.raises(ConfigError, match=f"^pretraining: the gradient through the model needs {reason}"):
        train(dataclasses.replace(run, scenario=changed), tmp_path / "run")
    assert not (tmp_path / "run").exists()
    check_pretraining(Pretraining(updates=0), changed, seed=0)  # imitation needs no model


def thrust_matters(scenario: Scenario) -> bool:
    """Whether estimation errors, or the effect of the random accelerations, change with the thrust."""
    ends = []
    for thrust in (0.0, 1e-2):
        env = FormationVectorEnv(4, scenario)
        _, infos = env.reset(seed=[1, 2, 3, 4])
        model, gamma = scenario.true_dynamics(), scenario.spacecraft.max_accel_m_s2 * scenario.true_dynamics().Gamma
        pushes, state = [], infos["true_state"]
        for _ in range(scenario.num_steps - 1):
            infos = env.step(np.full((4, 3), thrust, np.float32))[4]
            predicted = state @ model.Phi.T + model.delta + gamma @ np.full(3, thrust, np.float32)
            state = infos["true_state"]
            pushes.append(state - predicted)
        ends.append(np.hstack([infos["estimate"] - state, *pushes]))
    return not np.allclose(*ends, rtol=1e-6, atol=1e-6)


def test_the_gradient_goes_through_all_variants_of_a_scenario() -> None:
    """Episodes that differ in size and thrust limit: the clone comes to cost less, on seeds unseen."""
    differing = DomainRandomization(variants=3, formation_size_factor=(0.5, 1.5), max_accel_factor=(0.5, 2.0))
    scenario, costs = dataclasses.replace(short("keeping"), domain_randomization=differing), list[float]()
    settings = Pretraining(rounds=2, rows=32, updates=60, episodes=96, batch=32, learning_rate=2e-2)
    functions = Functions("tanh", "tanh", 2.0, MAGNIFICATION)
    pretrain(
        settings,
        Network(hidden=(16,)),
        functions,
        scenario,
        seed=0,
        validation_episodes=64,
        progress=lambda stage, cost: costs.append(cost),
    )
    assert costs[-1] < 0.9 * costs[0]
