"""Actors: the network that flies is the network that was trained, in numpy, from a file without code."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import torch
from actor_helpers import assert_equal_up_to_rounding, rounding_bound
from damage_helpers import refusals
from safetensors.numpy import save_file
from safetensors.torch import save_file as save_torch_file
from stable_baselines3 import PPO, SAC, TD3
from stable_baselines3.common.base_class import BaseAlgorithm
from torch import nn

from agents.algorithms.to_actor import actor_of
from agents.algorithms.vec_env import Sb3VecEnv
from agents.policy.actor import Actor, Functions, Layer, read_actor, to_bytes
from formation_env import ConfigError, FormationEnv, Scenario, load_scenario
from formation_env.task.observation import SIZE

POWER = 3.0
MODULES = {"tanh": nn.Tanh, "relu": nn.ReLU, "elu": nn.ELU}


@pytest.fixture(scope="module")
def scenario() -> Scenario:
    return load_scenario("keeping")


def observations(rows: int) -> np.ndarray:
    return np.random.default_rng(0).normal(0, 1, (rows, SIZE)).astype(np.float32)


def layers(*widths: int) -> list[Layer]:
    """Random layers, large enough that some outputs are beyond [-1, 1]."""
    rng = np.random.default_rng(1)
    pairs = zip((*widths, 3), (SIZE, *widths), strict=True)
    return [tuple(rng.normal(0, 0.3, shape).astype(np.float32) for shape in (pair, pair[:1])) for pair in pairs]


def make_ppo(env: Sb3VecEnv, activation: type[nn.Module]) -> BaseAlgorithm:
    kwargs = {"activation_fn": activation, "net_arch": [24, 16]}
    model = PPO("MlpPolicy", env, policy_kwargs=kwargs, seed=0, device="cpu")
    with torch.no_grad():
        model.policy.action_net.weight.mul_(300)  # SB3 begins with actions near zero, far from the clip
    return model


def make_sac(env: Sb3VecEnv, activation: type[nn.Module]) -> BaseAlgorithm:
    kwargs = {"activation_fn": activation, "net_arch": [24]}
    return SAC("MlpPolicy", env, policy_kwargs=kwargs, buffer_size=10, seed=0, device="cpu")


@pytest.mark.parametrize("activation", MODULES)
@pytest.mark.parametrize("make", [make_ppo, make_sac])
def test_an_actor_acts_as_the_model_it_was_made_of(
    make: Callable[[Sb3VecEnv, type[nn.Module]], BaseAlgorithm], activation: str, scenario: Scenario
) -> None:
    """SB3's own deterministic predict, through the power, is the oracle, up to the rounding of float32 sums."""
    model = make(Sb3VecEnv(2, scenario), MODULES[activation])
    z, _ = model.predict(observations(500), deterministic=True)
    actor = actor_of(model, POWER, scenario)
    actions, state = actor.predict(observations(500), state="mine")
    assert state == "mine"
    assert actions.dtype == np.float32
    assert np.abs(z).std() > 0.02  # the actions differ from each other
    expected = np.sign(z) * np.abs(z) ** POWER
    assert_equal_up_to_rounding(actions, expected, rounding_bound(actor, observations(500)))
    if make is make_ppo:
        assert 0.01 < (np.abs(z) == 1).mean() < 0.99  # some are clipped


def test_one_observation_and_a_batch_act_alike(scenario: Scenario) -> None:
    """As a baseline's: (SIZE,) gives (3,), inside the action space; sums in another order round differently."""
    actor = Actor(layers(16), Functions("tanh", "clip", POWER), scenario)
    batch, _ = actor.predict(observations(20))
    space = FormationEnv(scenario=scenario).action_space
    bounds = rounding_bound(actor, observations(20))
    for observation, action, bound in zip(observations(20), batch, bounds, strict=True):
        single, state = actor.predict(observation)
        assert state is None
        assert space.contains(single)
        assert_equal_up_to_rounding(single, action, bound)


def test_two_layers_by_hand(scenario: Scenario) -> None:
    """One relu unit of weight 2 on element 4, read with 0.25, -0.25 and 5: thrusts (z/2)^3, -(z/2)^3 and the limit."""
    first, last = np.zeros((1, SIZE), np.float32), np.array([[0.25], [-0.25], [5.0]], np.float32)
    first[0, 4] = 2
    zeros = (np.zeros(1, np.float32), np.zeros(3, np.float32))
    actor = Actor([(first, zeros[0]), (last, zeros[1])], Functions("relu", "clip", POWER), scenario)
    observation = np.full(SIZE, 9, np.float32)
    for element, thrust in ((1.0, [0.125, -0.125, 1]), (-1.0, [0, 0, 0])):
        observation[4] = element
        np.testing.assert_array_equal(actor.predict(observation)[0], np.array(thrust, np.float32))


@pytest.mark.parametrize("widths", [(), (5,), (7, 6, 5)])
def test_a_file_gives_the_same_actor(widths: tuple[int, ...], scenario: Scenario, tmp_path: Path) -> None:
    """Written and read, an actor is the same numbers and functions; written again, it is the same file."""
    actor = Actor(layers(*widths), Functions("elu", "tanh", 2.5), scenario)
    assert len({to_bytes(actor) for _ in range(10)}) == 1
    (tmp_path / "actor.safetensors").write_bytes(to_bytes(actor))
    again = read_actor(tmp_path / "actor.safetensors", scenario)
    assert again.functions == actor.functions
    assert again.scenario == scenario
    np.testing.assert_array_equal(again.predict(observations(9))[0], actor.predict(observations(9))[0])


GOOD = {"activation": "tanh", "squash": "clip", "throttle_power": "3.0", "magnification": "50.0"}
WEIGHT, BIAS = np.zeros((3, SIZE), np.float32), np.zeros(3, np.float32)
LAYER = {"layers.0.weight": WEIGHT, "layers.0.bias": BIAS}


@pytest.mark.parametrize(
    ("tensors", "metadata", "fault"),
    [
        ({}, GOOD, "layers: there are none"),
        (LAYER, {}, "activation: missing, so this is no actor"),
        ({"layers.0.weight": WEIGHT, "other": BIAS}, GOOD, "layers.0.bias: missing, so this is no actor"),
        (LAYER | {"other": BIAS}, GOOD, "tensors: must be a weight and a bias for each layer"),
        (
            LAYER | {"layers.0.weight": WEIGHT.T.copy()},
            GOOD,
            r"must be float32 \(3, 38\), got float32 \(38, 3\)",
        ),
        (LAYER | {"layers.0.weight": WEIGHT.astype(float)}, GOOD, "layers.0.weight: must be float32, got F64"),
        (LAYER | {"layers.0.bias": BIAS * np.float32(np.nan)}, GOOD, "layers.0.bias: must be finite"),
        (LAYER, GOOD | {"activation": "tnh"}, "activation: no such function: 'tnh'; did you mean 'tanh'?"),
        (LAYER, GOOD | {"squash": "clp"}, "squash: no such function: 'clp'; did you mean 'clip'?"),
        (LAYER, GOOD | {"throttle_power": "nan"}, "throttle_power: must be > 0, got nan"),
        (LAYER, GOOD | {"throttle_power": "3x"}, "could not convert string to float: '3x'"),
    ],
)
def test_a_file_that_is_no_actor_is_one_line(
    tensors: dict[str, np.ndarray], metadata: dict[str, str], fault: str, scenario: Scenario, tmp_path: Path
) -> None:
    """File, tensor and fault are named."""
    path = tmp_path / "actor.safetensors"
    save_file(tensors, path, metadata or None)
    with pytest.raises(ConfigError, match=fault) as caught:
        read_actor(path, scenario)
    assert str(caught.value).startswith(f"{path}: ")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("content", [None, b"", b"no safetensors at all"])
def test_a_file_that_cannot_be_read_is_one_line(content: bytes | None, scenario: Scenario, tmp_path: Path) -> None:
    """A missing file, an empty one, and one of another kind."""
    path = tmp_path / "actor.safetensors"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(ConfigError, match="cannot be read") as caught:
        read_actor(path, scenario)
    assert "\n" not in str(caught.value)


def test_other_networks_are_refused(scenario: Scenario) -> None:
    """Neither an algorithm nor an activation that an actor does not know is turned into something else."""
    env = Sb3VecEnv(2, scenario)
    with pytest.raises(ConfigError, match="only the MlpPolicy of PPO, A2C and SAC"):
        actor_of(TD3("MlpPolicy", env, buffer_size=10, device="cpu"), POWER, scenario)
    with pytest.raises(ConfigError, match="activation: no such function"):
        actor_of(make_sac(env, nn.Softsign), POWER, scenario)


@pytest.mark.parametrize("dtype", ["bfloat16", "float8_e4m3fn", "float16", "int32"])
def test_tensors_of_other_types_are_one_line(dtype: str, scenario: Scenario, tmp_path: Path) -> None:
    """Types that numpy does not have are refused like those that it has."""
    path = tmp_path / "actor.safetensors"
    tensors = {"layers.0.weight": torch.zeros(3, SIZE, dtype=getattr(torch, dtype)), "layers.0.bias": torch.zeros(3)}
    save_torch_file(tensors, path, GOOD)
    with pytest.raises(ConfigError, match=r"actor.safetensors: layers.0.weight: must be float32, got \w+$"):
        read_actor(path, scenario)


@pytest.mark.parametrize(
    ("weight", "bias"), [((), ()), ((3, SIZE), ()), ((3,), (3,)), ((), (3,)), ((3, SIZE, 1), (3,))]
)
def test_tensors_of_other_ranks_are_one_line(
    weight: tuple[int, ...], bias: tuple[int, ...], scenario: Scenario, tmp_path: Path
) -> None:
    """Scalars and vectors in place of matrices."""
    path = tmp_path / "actor.safetensors"
    tensors = {"layers.0.weight": np.zeros(weight, np.float32), "layers.0.bias": np.zeros(bias, np.float32)}
    save_file(tensors, path, GOOD)
    with pytest.raises(ConfigError, match=r"actor.safetensors: layers.0.\w+: must be float32 of rank"):
        read_actor(path, scenario)


def test_damaged_files_are_one_line_or_another_actor(scenario: Scenario, tmp_path: Path) -> None:
    """Each byte of the header inverted, and cuts throughout: an error that names the file, or an actor."""
    actor, path = Actor(layers(), Functions("tanh", "clip", POWER), scenario), tmp_path / "actor.safetensors"
    content = to_bytes(actor)
    header = 8 + int.from_bytes(content[:8], "little")
    faults = refusals(path, content, lambda: read_actor(path, scenario), header)
    assert len(faults) > header / 2
