"""Critics of after-states, exploration impulses, and the regulariser towards the pretrained actor."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from agents_helpers import checkpoint_of, random_actor, small_run

from agents.algorithms.afterstate_critic import UNIT_POS_M, UNIT_VEL_M_S, AfterStateFeatures
from agents.algorithms.models import make_env, make_model
from agents.algorithms.sac_learner import CriticFirstSAC
from agents.policy.actor import to_bytes
from agents.training.run_folder import Run
from agents.training.train import resume, train
from agents.training.validation import Validation
from agents.training.warm_start import start_from
from formation_env import ConfigError, load_scenario
from formation_env.dropout.bernoulli import Bernoulli
from formation_env.envs import FormationVectorEnv
from formation_env.task.observation import observation_layout

POSITIONS, VELOCITIES = [0, 1, 2, 6, 7, 8], [3, 4, 5, 9, 10, 11]


@pytest.mark.parametrize("name", ["initialization", "mission"])
def test_after_state_is_what_the_filter_predicts(name: str) -> None:
    """Without measurements the environment's next observation is the prediction, changes of phase among it.

    Observations are float32 in units of kilometres and more, so positions are known to a millimetre; over the coast to
    the arrival, half an orbit, an error of velocity of 1e-6 m/s grows to some more.
    """
    scenario = replace(load_scenario(name), dropout=Bernoulli(loss_probability=1.0))
    env, after_state = FormationVectorEnv(8, scenario), AfterStateFeatures(scenario)
    layout, rng = observation_layout(scenario), np.random.default_rng(0)
    observations, _ = env.reset(seed=list(range(8)))
    for step in range(scenario.num_steps - 1):
        thrusts = rng.normal(0, 0.01, (8, 3)).astype(np.float32)
        expected = after_state.errors(torch.from_numpy(observations), torch.from_numpy(thrusts)).numpy()
        observations = env.step(thrusts)[0]
        got = np.hstack([layout.state(observations, block) for block in ("error", "zero_effort_miss")])
        for axes, unit, within in ((POSITIONS, UNIT_POS_M, 0.05), (VELOCITIES, UNIT_VEL_M_S, 5e-5)):
            np.testing.assert_allclose(
                unit * expected[:, axes], got[:, axes], rtol=1e-5, atol=within, err_msg=f"step {step}"
            )


def started(folder: Path, agent: str) -> tuple[CriticFirstSAC, Run]:
    """A model that begins with an actor, and its run; SB3's seed is 0."""
    run, path = small_run(folder, "sac", agent), folder / "actor.safetensors"
    path.write_bytes(to_bytes(random_actor("tanh")))
    model = make_model(run.agent, make_env(run.agent, run.scenario), 0)
    start_from(path, model, run.agent, run.scenario)
    return model, replace(run, start=str(path))


def some_observations(run: Run) -> torch.Tensor:
    """Those of 8 episodes' first instants (8, SIZE)."""
    return torch.from_numpy(FormationVectorEnv(8, run.scenario).reset(seed=list(range(8)))[0])


def test_what_a_thrust_costs_at_once_is_not_learnt(tmp_path: Path) -> None:
    """With W = 0, Q is minus the delta-v of the step, times the scale: the reward's first term (README)."""
    model, run = started(tmp_path, "after_state: true\n")
    with torch.no_grad():
        for network in model.critic.q_networks:
            network[-1].weight.zero_()
            network[-1].bias.zero_()
    throttles = torch.rand(8, 3) * 2 - 1
    delta_v_m_s = (throttles**4).sum(dim=1).sqrt() * 0.002 * 30  # p = 2, and greatest thrust and step of the scenario
    for values in model.critic(some_observations(run), throttles):
        torch.testing.assert_close(values.squeeze(1), -10 * delta_v_m_s, rtol=1e-4, atol=1e-5)


def test_the_behaviour_regularizer_pulls_back(tmp_path: Path) -> None:
    """At the start the price of distance is nought; beyond it is weight times the squared way of the throttles."""
    model, run = started(tmp_path, "behaviour_regularizer_weight: 7.0\n")
    observations = some_observations(run)
    mean = model.actor.get_action_dist_params(observations)[0].detach()
    torch.testing.assert_close(model._behaviour_penalty(mean, observations), torch.zeros(8))
    moved = (mean.tanh() + torch.tensor([0.1, 0.0, -0.2])).clamp(-0.99, 0.99)
    expected = 7 * ((moved - mean.tanh()) ** 2).sum(dim=1)
    torch.testing.assert_close(model._behaviour_penalty(moved.atanh(), observations), expected, rtol=1e-3, atol=1e-6)


def test_a_strong_regularizer_holds_the_actor(tmp_path: Path) -> None:
    """The same updates move the throttles much less, and the pretrained reference is not learnt."""
    moved = {}
    for weight in (0.0, 1e4):
        folder = tmp_path / str(weight)
        folder.mkdir()
        model, run = started(folder, f"behaviour_regularizer_weight: {weight}\nafter_state: true\n")
        observations = some_observations(run)
        before = model.actor(observations, deterministic=True).detach()
        model.learn(400)
        moved[weight] = (model.actor(observations, deterministic=True) - before).abs().mean().item()
        assert torch.equal(
            model.behaviour(model.actor.extract_features(observations, model.actor.features_extractor)).tanh(), before
        )
    assert 0 < moved[1e4] < moved[0.0] / 3


def test_a_regularized_run_resumes_to_the_same_bits(tmp_path: Path) -> None:
    """After an interruption the reference is the actor of the start again, not that of the checkpoint."""
    agent = (
        "behaviour_regularizer_weight: 5.0\nafter_state: true\nexploration_impulses: {probability: 0.5}\nn_steps: 3\n"
    )
    _, run = started(tmp_path, agent)
    train(run, tmp_path / "whole")
    assert train(run, tmp_path / "stopped", time_limit_s=0.0) == "out of time"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("agents.training.validation.Validation._on_step", stop_at(300))
        with pytest.raises(KeyError):
            resume(tmp_path / "stopped")
    assert 0 < checkpoint_of(tmp_path / "stopped")["counters"]["num_timesteps"] < 300
    assert resume(tmp_path / "stopped") == "finished"
    one, other = (checkpoint_of(tmp_path / name)["parameters"]["policy"] for name in ("whole", "stopped"))
    for name, tensor in one.items():
        assert torch.equal(tensor, other[name]), name


def stop_at(step: int) -> Callable[[Validation], bool]:
    """A callback that dies there."""
    on_step = Validation._on_step

    def dies(self: Validation) -> bool:
        if self.num_timesteps >= step:
            raise KeyError(step)
        return on_step(self)

    return dies


def test_exploration_impulses_are_sparse_graded_and_stored(tmp_path: Path) -> None:
    """Of 8 rows and 2000 draws a fifth has an impulse, within 5 binomial sigmas; sizes are a geometric series."""
    model, _ = started(tmp_path, "exploration_impulses: {probability: 0.2, sigma_min: 0.01, sigma_max: 0.1}\n")
    still = np.zeros((8, 3), np.float32)
    draws = np.stack([model._with_impulses(still)[0] for _ in range(2000)])
    fires = (draws != 0).any(axis=2)
    assert fires.mean() == pytest.approx(0.2, abs=5 * np.sqrt(0.2 * 0.8 / fires.size))
    deviations = [draws[fires[:, row], row].std() for row in range(8)]
    np.testing.assert_allclose(deviations, np.geomspace(0.01, 0.1, 8), rtol=0.15)  # some 1200 numbers each: 2 % scatter
    flown, remembered = model._with_impulses(still)
    assert flown is remembered


@pytest.mark.parametrize(
    ("agent", "fault"),
    [
        ("after_state: true\nnormalise_reward: true\n", "normalise_reward: must be false with after_state"),
        (
            "exploration_impulses: {sigma_min: 0.5, sigma_max: 0.1}\n",
            "sigma_min: must be at most sigma_max",
        ),
        ("kicks: {}\n", "kicks: now exploration_impulses"),
        ("anchor_weight: 1\n", "anchor_weight: now behaviour_regularizer_weight"),
        ("exploration_impulses: {share: 0.1}\n", "exploration_impulses.share: now probability"),
    ],
)
def test_what_does_not_go_together_is_refused(agent: str, fault: str, tmp_path: Path) -> None:
    """In one line."""
    with pytest.raises(ConfigError, match=fault):
        small_run(tmp_path, "sac", agent)


def test_the_actor_learns_at_a_rate_of_its_own_that_falls_to_nothing(tmp_path: Path) -> None:
    """Half-way from the delay's end to the run's the rate is half of the first; the critics keep theirs."""
    model, _ = started(tmp_path, "actor_learning_rate: 1e-4\nlearning_rate: 2e-3\nlearning_rate_end: 2e-3\n")
    model._set_actor_learning_rate(0.5)
    assert model.actor.optimizer.param_groups[0]["lr"] == pytest.approx(5e-5)
    model._set_actor_learning_rate(-0.1)
    assert model.actor.optimizer.param_groups[0]["lr"] == 0
    assert model.critic.optimizer.param_groups[0]["lr"] == pytest.approx(2e-3)


def test_after_states_need_one_model(tmp_path: Path) -> None:
    """Where a thrust leads differs from variant to variant: said in one line, before anything is flown."""
    with pytest.raises(ConfigError, match=r"agent.after_state: must be false for a scenario with domain_randomization"):
        small_run(tmp_path, "sac", "after_state: true\n", env="keeping_randomized")
