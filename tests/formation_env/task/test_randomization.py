"""Domain randomization: an episode is, bit for bit, one of the plain environment of the variant that it drew."""

import dataclasses
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from env_helpers import assert_same, fly, fly_rows, random_actions
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from scipy import stats

from baselines import fuel_optimal
from formation_env import ConfigError, FormationEnv, FormationVectorEnv, Scenario, load_scenario
from formation_env.evaluation.rollout import evaluate
from formation_env.settings import build
from formation_env.task.randomization import QUANTITIES, DomainRandomization
from formation_env.task.variants import draw_variants

VARIANTS = 64


@cache
def short(name: str = "keeping_randomized", hold_orbits: float = 0.15) -> Scenario:
    """Holds of 27 to 31 steps, by the variant's orbit."""
    scenario = load_scenario(name)
    phases = tuple(dataclasses.replace(phase, hold_orbits=hold_orbits) for phase in scenario.phases)
    return dataclasses.replace(scenario, phases=phases)


def elliptic() -> Scenario:
    """The nonlinear truth about an ellipse: truth and filter differ from step to step, and with the variant."""
    ranges = DomainRandomization(
        variants=3,
        altitude_m=(1300e3, 1500e3),
        inclination_deg=(10.0, 80.0),
        formation_size_factor=(0.5, 1.5),
        ballistic_coefficient_factor=(0.01, 1.0),
    )
    return dataclasses.replace(short("keeping_eccentric"), domain_randomization=ranges)


def without_variant(results: list[tuple[Any, ...]]) -> list[tuple[Any, ...]]:
    """What reset and the steps returned, but for the infos' `variant`."""
    kept = [{key: value for key, value in result[-1].items() if key != "variant"} for result in results]
    return [(*result[:-1], info) for result, info in zip(results, kept, strict=True)]


@pytest.mark.parametrize("scenario", [short(), elliptic()], ids=["linear", "elliptic"])
def test_an_episode_is_one_of_its_variants_environment(scenario: Scenario) -> None:
    """The plain environment of the variant is the oracle: same seed, same bits, in the first episode and the second.

    Stepping on behind the end is part of it, and so is a start that is given.
    """
    actions, seen = random_actions(0, 40), set[int]()
    for seed in range(4):
        env = FormationEnv(scenario)
        for episode, start in enumerate(({}, {"options": {"initial_state": [2000.0, 100, 3400, 0, -4, 0]}})):
            flown = fly(env, actions, **(start if episode else {"seed": seed}))
            variant = flown[0][-1]["variant"]
            assert all(result[-1]["variant"] == variant for result in flown)
            plain = FormationEnv(draw_variants(scenario)[variant])
            plain.reset(seed=seed)
            expected = fly(plain, actions, **(start if episode else {"seed": seed}))
            assert_same(without_variant(flown), expected)
            assert_same(without_variant([env.step(actions[0])]), [plain.step(actions[0])])
            seen.add(variant)
    assert len(seen) > 1


@pytest.mark.parametrize("num_envs", [1, 33])
def test_a_batch_equals_gymnasiums_batch_of_single_envs(num_envs: int) -> None:
    """Through several episodes of every row, which end at different steps; all outputs, masks and types."""
    scenario = short()
    actions = random_actions(1, 100, num_envs)
    batch = FormationVectorEnv(num_envs, scenario)
    singles = SyncVectorEnv([lambda: FormationEnv(scenario)] * num_envs, autoreset_mode=AutoresetMode.SAME_STEP)
    assert_same(batch.reset(seed=5), singles.reset(seed=5))
    results = [batch.step(action) for action in actions]
    for k, (result, action) in enumerate(zip(results, actions, strict=True)):
        assert_same(result, singles.step(action), f"step {k}")
    ends = np.array([result[3] for result in results])
    assert (ends.sum(axis=0) >= 3).all()
    if num_envs > 1:
        assert len(np.flatnonzero(ends.any(axis=1))) > 6


def test_gymnasiums_other_autoreset_flies_the_same_episodes() -> None:
    """Reset at the step after the end, a row of length n takes n + 1 steps; each episode is the same as otherwise."""
    scenario = short()
    env = SyncVectorEnv([lambda: FormationEnv(scenario)] * 3, autoreset_mode=AutoresetMode.NEXT_STEP)
    results = fly_rows(env, np.zeros((40, 3, 3), np.float32), seed=9)  # type: ignore[arg-type]
    for row in range(3):
        single = FormationEnv(scenario)
        expected = fly(single, np.zeros((40, 3), np.float32), seed=9 + row)
        again = single.reset()
        end = len(expected) - 1
        assert end == draw_variants(scenario)[expected[0][1]["variant"]].num_steps
        assert [bool(result[3][row]) for result in results[1 : end + 2]] == [False] * (end - 1) + [True, False]
        np.testing.assert_array_equal(results[end][0][row], expected[end][0])
        np.testing.assert_array_equal(results[end + 1][0][row], again[0])
        assert results[end + 1][-1]["variant"][row] == again[1]["variant"]


def values_of(scenario: Scenario, variant: Scenario) -> dict[str, float]:
    """The quantities that a variant has, read off its settings."""
    formation, nominal = variant.phases[0].formation, scenario.phases[0].formation
    drag, leaders = (s.spacecraft.drag_area_per_mass_m2_kg for s in (variant, scenario))
    return {
        "formation_size_factor": formation.x0_m / nominal.x0_m,  # type: ignore[attr-defined]
        "start_spread_factor": variant.start.initial_sigma_vel_m_s / scenario.start.initial_sigma_vel_m_s,
        "sensor_noise_factor": variant.sensor.sigma_pos_m / scenario.sensor.sigma_pos_m,
        "process_noise_factor": variant.process_noise_m_s2 / scenario.process_noise_m_s2,
        "outage_length_factor": variant.dropout.mean_outage_s / scenario.dropout.mean_outage_s,  # type: ignore[attr-defined]
        "outage_spacing_factor": variant.dropout.mean_uptime_orbits / scenario.dropout.mean_uptime_orbits,  # type: ignore[attr-defined]
        "max_accel_factor": variant.spacecraft.max_accel_m_s2 / scenario.spacecraft.max_accel_m_s2,
        "ballistic_coefficient_factor": leaders / drag,
        "altitude_m": variant.orbit.altitude_m,
        "inclination_deg": variant.orbit.inclination_deg,
    }


def test_what_is_drawn_is_uniform_in_its_ranges_and_independent() -> None:
    """Kolmogorov & Smirnov's test on 2000 variants; the cells of the Latin hypercube make it stricter than at random.

    Each of 64 variants has a cell of its own. Ranks of two quantities correlate by 1 / sqrt(2000) = 0.022, 1 sigma.
    """
    few, scenario = load_scenario("keeping_randomized"), None
    scenario = dataclasses.replace(few, domain_randomization=dataclasses.replace(randomization(few), variants=1000))
    columns = {}
    for one in (few, scenario):
        drawn = [values_of(one, variant) for variant in draw_variants(one)]
        for name, (low, high) in randomization(one).ranges.items():
            values = np.array([values[name] for values in drawn])
            assert low <= values.min() < values.max() <= high, name
            assert stats.kstest(values, stats.uniform(low, high - low).cdf).pvalue > 0.5, name
            cells = np.floor((values - low) / (high - low) * len(values) * (1 - 1e-12))
            assert len(set(cells.tolist())) == len(values), name
            columns[name] = values
    correlation = stats.spearmanr(np.array(list(columns.values())), axis=1).statistic
    assert np.abs(correlation - np.eye(len(correlation))).max() < 5 / np.sqrt(1000)
    assert set(columns) == set(QUANTITIES) - {"loss_probability_factor"}


def randomization(scenario: Scenario) -> DomainRandomization:
    assert scenario.domain_randomization is not None
    return scenario.domain_randomization


def test_what_is_not_named_stays_and_the_leader_keeps_its_drag() -> None:
    """A variant of one quantity differs from the scenario in that alone; the formation of the start is resized, too."""
    scenario = dataclasses.replace(load_scenario("keeping"), domain_randomization=None)
    same = dataclasses.replace(scenario, domain_randomization=DomainRandomization(variants=2))
    assert draw_variants(same) == (scenario, scenario)
    ranges = DomainRandomization(variants=1, ballistic_coefficient_factor=(2.0, 2.0))
    (variant,) = draw_variants(dataclasses.replace(scenario, domain_randomization=ranges))
    halved = dataclasses.replace(scenario.spacecraft, drag_coefficient=0.5)
    assert variant == dataclasses.replace(scenario, spacecraft=halved, leader_spacecraft=scenario.spacecraft)
    ranges = DomainRandomization(variants=1, formation_size_factor=(3.0, 3.0))
    (variant,) = draw_variants(dataclasses.replace(scenario, domain_randomization=ranges))
    np.testing.assert_allclose(
        variant.start.formation.state(variant.orbit), 3 * scenario.start.formation.state(scenario.orbit), rtol=1e-15
    )
    assert variant.start.formation == variant.phases[0].formation


def drawn_by(env: FormationVectorEnv, episodes: int, seed: int) -> list[list[int]]:
    """The variants of each episode's rows."""
    infos = [env.reset(seed=seed)[1], *(env.reset()[1] for _ in range(episodes - 1))]
    return [info["variant"].tolist() for info in infos]


def test_rows_and_episodes_draw_all_variants_alike() -> None:
    """Chi square of 4 episodes of 2000 rows; successive episodes of a row are independent; equal seeds draw alike."""
    env = FormationVectorEnv(2000, short())
    drawn = drawn_by(env, 4, seed=1)
    assert drawn == drawn_by(env, 4, seed=1)
    assert drawn != drawn_by(env, 4, seed=2001)
    flat = np.ravel(drawn)
    assert stats.chisquare(np.bincount(flat, minlength=VARIANTS)).pvalue > 0.01
    again = np.mean(np.array(drawn[0]) == np.array(drawn[1]))
    assert again == pytest.approx(1 / VARIANTS, abs=4 * np.sqrt(1 / VARIANTS / 2000))


def test_the_draw_is_independent_of_the_episodes_noises() -> None:
    """It takes numbers of its own: neither the start's errors nor their sizes follow the variant.

    By chance ranks of 4000 rows correlate by 1 / sqrt(4000) = 0.016, 1 sigma; shared numbers would by about 1.
    """
    scenario = short()
    env = FormationVectorEnv(4000, scenario)
    info = env.reset(seed=7)[1]
    nominal = np.array([variant.start.formation.state(variant.orbit) for variant in draw_variants(scenario)])
    errors = info["true_state"] - nominal[info["variant"]]
    errors /= np.array([variant.start.initial_sigma_pos_m for variant in draw_variants(scenario)])[
        info["variant"], None
    ]
    columns = np.column_stack([info["variant"], errors, np.abs(errors), info["measured"]])
    correlation = stats.spearmanr(columns).statistic[0, 1:]
    assert np.abs(correlation).max() < 5 / np.sqrt(4000)


def test_the_seed_of_the_ranges_makes_other_variants() -> None:
    """Equal settings give equal variants, in every process; another seed gives others."""
    scenario = short()
    other = dataclasses.replace(randomization(scenario), seed=1)
    assert not set(draw_variants(dataclasses.replace(scenario, domain_randomization=other))) & set(
        draw_variants(scenario)
    )
    assert randomization(scenario).draw() == randomization(scenario).draw()


def test_memory_holds_what_is_flown() -> None:
    """Put back into another batch, the rows fly on as they did, in their variants and through the next episodes."""
    env, twin = FormationVectorEnv(5, short()), FormationVectorEnv(5, short())
    actions = random_actions(3, 60, 5)
    fly_rows(env, actions[:10], seed=3)
    twin.reset(seed=100)
    twin.simulation.recall(env.simulation.memory())
    for action in actions:
        assert_same(twin.step(action), env.step(action))


def test_only_randomized_scenarios_tell_a_variant() -> None:
    """The info of the others is as it was; the variant is an int in one environment, an array in a batch."""
    assert "variant" not in FormationEnv("keeping").reset(seed=0)[1]
    assert "variant" not in FormationVectorEnv(2, "keeping").reset(seed=0)[1]
    assert type(FormationEnv(short()).reset(seed=0)[1]["variant"]) is int
    assert FormationVectorEnv(2, short()).reset(seed=0)[1]["variant"].dtype == np.int64


def test_a_given_start_must_suit_every_variant() -> None:
    """Which variant comes is not known before; the largest must be within reach, and the running episode stays."""
    env = FormationEnv(short())
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"initial_state: farther than 50000 m"):
        env.reset(options={"initial_state": [-47_000.0, 0, 0, 0, 0, 0]})
    FormationEnv(dataclasses.replace(short(), domain_randomization=None)).reset(
        options={"initial_state": [-47_000.0, 0, 0, 0, 0, 0]}
    )


class Coasting:
    """Does nothing."""

    def predict(self, observation: Any, state: Any = None, **_: Any) -> tuple[Any, None]:
        return np.zeros((len(observation), 3), np.float32), None


def test_evaluate_scores_each_seed_by_its_variant() -> None:
    """One line per seed, the same as in the plain environment of the variant; the steps are the variant's."""
    scenario, seeds = short(), [3, 4, 5]
    table = evaluate(Coasting(), scenario, seeds)
    for line, seed in zip(table.to_dict("records"), seeds, strict=True):
        variant = draw_variants(scenario)[FormationEnv(scenario).reset(seed=seed)[1]["variant"]]
        assert line == evaluate(Coasting(), variant, [seed]).to_dict("records")[0]
        assert line["steps"] == variant.num_steps


def test_the_fuel_optimum_of_a_seed_is_its_variants() -> None:
    """The bound knows which variant the seed flies."""
    scenario = short()
    variant = draw_variants(scenario)[FormationEnv(scenario).reset(seed=6)[1]["variant"]]
    assert fuel_optimal(scenario, seed=6).cost == fuel_optimal(variant, seed=6).cost


def test_the_picture_is_that_of_the_variant() -> None:
    """Reference, limits and thrust arrows are the plain environment's, pixel by pixel, episode after episode."""
    env = FormationEnv(short(), render_mode="rgb_array")
    env.reset(seed=1)
    env.render()
    info = env.reset(seed=2)[1]
    plain = FormationEnv(draw_variants(short())[info["variant"]], render_mode="rgb_array")
    plain.reset(seed=2)
    for one in (env, plain):
        one.step(np.array([0.5, -0.5, 0.5], np.float32))
    np.testing.assert_array_equal(env.render(), plain.render())


BASE = "phases: [{formation: {kind: following}, hold_orbits: 1}]\ndomain_randomization: "
# What is in the file, and what the one line of the error says after the file's name.
FAULTS = {
    "unknown key": ("{altitude: [1, 2]}", "domain_randomization.altitude: unknown key; did you mean 'altitude_m'\\?"),
    "backwards": (
        "{altitude_m: [700e3, 400e3]}",
        r"domain_randomization.altitude_m: must be \[low, high\] with low <= high, got \[700000.0, 400000.0\]",
    ),
    "no pair": ("{altitude_m: 400e3}", "domain_randomization.altitude_m: must be a list, got 400000.0"),
    "one end": ("{altitude_m: [400e3]}", "domain_randomization.altitude_m.1: required but missing"),
    "word": ("{max_accel_factor: [low, 1]}", "domain_randomization.max_accel_factor.0: .* got the string 'low'"),
    "negative": ("{sensor_noise_factor: [-1, 1]}", "domain_randomization.sensor_noise_factor.0: .* got -1"),
    "no drag": ("{ballistic_coefficient_factor: [0, 1]}", r"domain_randomization.ballistic_coefficient_factor.0: .* 0"),
    "no variants": ("{variants: 0}", "domain_randomization.variants: must be greater than or equal to 1, got 0"),
    "fraction": ("{variants: 2.5}", "domain_randomization.variants: must be a valid integer, got 2.5"),
    "too many": (
        "{variants: 100000}",
        "domain_randomization.variants: tables of 19300000 steps in all take about 27 GB; .*",
    ),
    "underground": (
        "{altitude_m: [50e3, 400e3]}",
        r"domain_randomization: altitude_m 5e\+04: altitude_m: must be greater than or equal to 100000, got 50000.0",
    ),
    "other dropout": (
        "{loss_probability_factor: [0, 1]}",
        "domain_randomization.loss_probability_factor: dropout gilbert_elliott has no loss_probability",
    ),
    "outage below the step": (
        "{outage_length_factor: [0.01, 1]}",
        "domain_randomization: outage_length_factor 0.01: dropout.mean_outage_s: a mean of 6 s is shorter .*",
    ),
    "far": (
        "{formation_size_factor: [1, 100]}",
        "domain_randomization: formation_size_factor 100: start.formation: .* beyond limits.max_distance_m = 50000 m",
    ),
}


@pytest.mark.parametrize("fault", FAULTS)
def test_faults_are_one_line_that_names_key_and_value(fault: str, tmp_path: Path) -> None:
    """Also what only a drawn scenario shows to be impossible."""
    text, message = FAULTS[fault]
    path = tmp_path / "own.yaml"
    path.write_text(BASE + text, encoding="utf-8")
    with pytest.raises(ConfigError, match=rf"^\S*own.yaml: {message}$|^{message}$") as caught:
        load_scenario(path)
    assert "\n" not in str(caught.value)


def test_bernoullis_probability_is_varied() -> None:
    """The one quantity that the shipped scenario has not."""
    data = {
        "phases": [{"formation": {"kind": "following"}, "hold_orbits": 1}],
        "dropout": {"kind": "bernoulli", "loss_probability": 0.2},
        "domain_randomization": {"variants": 8, "loss_probability_factor": [0, 5]},
    }
    shares = [variant.dropout.loss_probability for variant in draw_variants(build(Scenario, data, "test"))]  # type: ignore[attr-defined]
    assert 0 <= min(shares) < 0.125
    assert 0.875 < max(shares) <= 1
