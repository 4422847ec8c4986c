"""The sweep: each variation changes what it says, all fly the same seeds, the bound lies below, files are complete."""

import json
import sys
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from baselines.cli import app
from baselines.controllers.registry import make_policy
from baselines.experiments.policy_factories import Classical
from baselines.experiments.sweep import BOUND, COLUMNS, METRICS, Point, mean_hold_error_m, points
from baselines.experiments.variations import FRONT, VARIATIONS, lost_share
from baselines.report import style
from baselines.report.sweep_figures import looks_of, robustness_figure, trade_off_figure
from baselines.report.sweep_section import expensive, reading
from baselines.report.write_sweep import FILES, SweepOptions, write_sweep
from formation_env import ConfigError, Scenario, load_scenario
from formation_env.evaluation.rollout import evaluate, record
from formation_env.settings import build

SHORT = {
    "title": "A short flight <with> a transfer & a hold",
    "spacecraft": {"max_accel_m_s2": 0.02},
    "phases": [{"formation": {"kind": "following", "y0_m": 200}, "transfer_orbits": 0.1, "hold_orbits": 0.1}],
}
COMMAND = "python -m baselines sweep short.yaml --episodes 3"
POLICIES = {name: Classical(name) for name in ("lqr", "smc")}
OPTIONS = SweepOptions(episodes=3, bound_episodes=2)
TOLD = {FRONT, "sensor_noise", "thrust_limit", "initial_error"}
CHANGES = {
    FRONT: {"reward.error_weight"},
    "outage_length": {"dropout.mean_outage_s", "dropout.mean_uptime_orbits"},
    "measurement_loss": {"dropout.mean_uptime_orbits"},
    "sensor_noise": {"sensor.sigma_pos_m", "sensor.sigma_vel_m_s"},
    "thrust_limit": {"spacecraft.max_accel_m_s2"},
    "initial_error": {"start.initial_sigma_pos_m", "start.initial_sigma_vel_m_s"},
    "true_dynamics": {"dynamics"},
    "ballistic_coefficient": {"spacecraft.area_m2", "leader_spacecraft", "filter.spacecraft"},
    "thrust_magnitude": {"spacecraft.max_accel_m_s2"},
}


def flat(settings: Mapping[str, Any], within: str = "") -> dict[str, Any]:
    """Settings by dotted path."""
    result: dict[str, Any] = {}
    for key, value in settings.items():
        path = f"{within}{key}"
        result |= flat(value, f"{path}.") if isinstance(value, Mapping) else {path: value}
    return result


def changed(one: Scenario, other: Scenario) -> set[str]:
    """Settings that differ; a section that only one of them has is named as a whole."""
    a, b = flat(asdict(one)), flat(asdict(other))
    lone = {path for path in a.keys() ^ b.keys() if path.rpartition(".")[0] not in a.keys() | b.keys()}
    return {path for path in a.keys() & b.keys() if a[path] != b[path]} | lone


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("sweep") / "deep"
    assert write_sweep(POLICIES, [build(Scenario, SHORT, "test")], OPTIONS, out, COMMAND, 1) == out / "sweep.html"
    return out


@pytest.fixture(scope="module")
def episodes(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "sweep.csv")


@pytest.mark.parametrize("quantity", VARIATIONS)
def test_a_variation_changes_what_it_says_and_nothing_else(quantity: str) -> None:
    """Field by field against the shipped scenario; the policy's scenario is the flown or the original one."""
    original, variation = load_scenario("keeping"), VARIATIONS[quantity]
    for value in (variation.values[0], variation.values[-1]):
        flown, design = variation.vary(original, value)
        assert changed(original, flown) <= CHANGES[quantity]
        assert design == (flown if quantity in TOLD else original)
    assert changed(original, flown) == CHANGES[quantity]


@pytest.mark.parametrize("name", ["keeping", "bad_communication", "keeping_nonlinear", "mission"])
def test_the_variations_hold_the_scenarios_own_value(name: str) -> None:
    """Factors of 1, differences of 0 %: the scenario's physics; a filter may have its filter_model written out."""
    scenario = load_scenario(name)
    for quantity in (FRONT, "sensor_noise", "thrust_limit", "initial_error", "thrust_magnitude"):
        nominal = 0.0 if quantity == "thrust_magnitude" else 1.0
        assert nominal in VARIATIONS[quantity].values
        assert VARIATIONS[quantity].vary(scenario, nominal)[0] == scenario
    flown, _ = VARIATIONS["ballistic_coefficient"].vary(scenario, 0.0)
    assert (flown.spacecraft, flown.leader, flown.filter_model) == (
        scenario.spacecraft,
        scenario.leader,
        scenario.filter_model,
    )


def test_a_quick_look_has_ends_and_middle() -> None:
    """Every quantity keeps the scenario's own value and both ends, and flies no more values than before."""
    for variation in VARIATIONS.values():
        assert {variation.values[0], variation.values[len(variation.values) // 2]} <= set(variation.few)
        assert variation.values[-1] == variation.few[-1]
        assert set(variation.few) <= set(variation.values)
    assert VARIATIONS[FRONT].few == (0.1, 0.5, 1.0, 2.0, 10.0)


def test_the_scenario_itself_is_flown_once() -> None:
    """Quantities whose own value leaves the scenario as it is share a point, and all of them show it."""
    made = points({"keeping": load_scenario("keeping")}, POLICIES, (0,), 0)
    own = [point for point in made.values() if point.flown == point.design == point.original]
    (point,) = own
    assert {quantity for quantity, _ in point.places} >= TOLD | {"thrust_magnitude"}
    places = [place for point in made.values() for place in point.places]
    assert len(places) == len(set(places)) == sum(len(item.values) for item in VARIATIONS.values())


def test_bursts_have_the_share_and_the_length_asked_for() -> None:
    """The long-run loss of the two-state chain, fail / (fail + recover), and its mean outage dt / recover."""
    scenario = load_scenario("mission")
    share = lost_share(scenario)
    for mean_outage_s in VARIATIONS["outage_length"].values:
        flown, _ = VARIATIONS["outage_length"].vary(scenario, mean_outage_s)
        chain = flown.dropout.chain(flown.dt_s, flown.orbit)
        assert flown.dt_s / chain.recover == pytest.approx(mean_outage_s, rel=1e-12)
        assert chain.fail / (chain.fail + chain.recover) == pytest.approx(share, rel=1e-12)
    for value in VARIATIONS["measurement_loss"].values:
        flown, _ = VARIATIONS["measurement_loss"].vary(scenario, value)
        chain = flown.dropout.chain(flown.dt_s, flown.orbit)
        assert chain.fail / (chain.fail + chain.recover) == pytest.approx(value, rel=1e-12)


def test_a_wrong_ballistic_coefficient_is_hidden_from_the_filter() -> None:
    """The truth's along-track drag difference is -rho v^2 / 2 (1/B' - 1/B) with B' = 1.5 B; the filter has none."""
    scenario = load_scenario("keeping")
    flown, _ = VARIATIONS["ballistic_coefficient"].vary(scenario, 50.0)
    craft, v = scenario.spacecraft, scenario.orbit.speed_m_s
    inverse = craft.drag_coefficient * craft.area_m2 / craft.mass_kg
    push_m_s2 = -0.5 * craft.air_density_kg_m3 * v**2 * (inverse / 1.5 - inverse)
    true, design = flown.true_dynamics(), flown.filter_dynamics()
    # along-track velocity gained in one 30 s step; coupling into it is of the order (n dt)^2 = 1e-3
    assert true.delta[4] == pytest.approx(push_m_s2 * scenario.dt_s, rel=5e-3)
    assert np.abs(design.delta).max() == 0
    np.testing.assert_array_equal(design.Phi, scenario.filter_dynamics().Phi)


def test_a_stronger_thruster_thrusts_more_than_commanded() -> None:
    """+10 %: what acts is 1.1 times what the policy commands, on the first step, where both know the same."""
    scenario = load_scenario("initialization")
    flown, design = VARIATIONS["thrust_magnitude"].vary(scenario, 10.0)
    axes = ["ax_m_s2", "ay_m_s2", "az_m_s2"]
    policy = make_policy("lqr", design)
    acted, commanded = (record(policy, which, 0)[axes].iloc[1].to_numpy() for which in (flown, scenario))
    # actions are single precision
    np.testing.assert_allclose(acted, 1.1 * commanded, rtol=1e-6, atol=1e-12)


def test_all_fly_the_same_seeds_at_every_value(episodes: pd.DataFrame) -> None:
    """One line per quantity, value, policy and seed, and the bound on the first of them along the front only."""
    assert list(episodes.columns) == COLUMNS
    flown = episodes.groupby(["quantity", "value", "policy"])["seed"].apply(list).to_dict()
    expected = {
        (quantity, value, policy): [0, 1, 2]
        for quantity, variation in VARIATIONS.items()
        for value in variation.values
        for policy in POLICIES
    }
    bounds: dict[tuple[str, float, str], list[int]] = {
        (FRONT, value, BOUND): [0, 1] for value in VARIATIONS[FRONT].values
    }
    assert flown == expected | bounds


def test_the_bound_is_below_every_policy_at_each_price(episodes: pd.DataFrame) -> None:
    """Seed by seed, cost against the clairvoyant's least cost; it is proved to 1e-5 m/s (`LARGEST_GAP_M_S`)."""
    front = episodes[episodes["quantity"] == FRONT]
    costs = front.pivot(index=["value", "seed"], columns="policy", values="cost_m_s").dropna()
    assert len(costs) == 2 * len(VARIATIONS[FRONT].values)
    for policy in POLICIES:
        assert (costs[policy] > costs[BOUND]).all()


def test_the_bounds_front_is_one(episodes: pd.DataFrame) -> None:
    """A dearer error never makes the optimum's error larger or its thrust smaller (exchange argument).

    Costs are known to 1e-5 m/s, so at neighbouring prices the order may slip by that over the price's step.
    """
    bound = episodes[episodes["policy"] == BOUND]
    for _, line in bound.groupby("seed"):
        assert line["value"].is_monotonic_increasing
        assert (np.diff(line["position_error_mean_m"]) < 1e-2).all()
        assert (np.diff(line["delta_v_m_s"]) > -1e-4).all()


def test_cost_is_thrust_plus_price_times_error(episodes: pd.DataFrame) -> None:
    """The linear reward's definition, for policies and for the bound (to its gap)."""
    front = episodes[episodes["quantity"] == FRONT]
    price = front["value"] * build(Scenario, SHORT, "test").reward.error_weight
    np.testing.assert_allclose(
        front["cost_m_s"], front["delta_v_m_s"] + price * front["position_error_mean_m"], rtol=1e-9, atol=2e-5
    )


def test_the_mean_error_is_the_environments() -> None:
    """Of a recorded path against the metric that the kernel sums up; only rounding of sums differs."""
    scenario = build(Scenario, SHORT, "test")
    policy = make_policy("lqr", scenario)
    flight = record(policy, scenario, 4)
    states = flight[["x_m", "y_m", "z_m", "vx_m_s", "vy_m_s", "vz_m_s"]].to_numpy()
    expected = evaluate(policy, scenario, [4])["position_error_mean_m"].iloc[0]
    assert mean_hold_error_m(scenario, states) == pytest.approx(expected, rel=1e-9)


def test_gains_are_those_of_the_original() -> None:
    """A varied scenario equals no shipped one; it must not fall back to the default gains."""
    scenario = load_scenario("keeping")
    flown, design = VARIATIONS["outage_length"].vary(scenario, 60.0)
    point = Point("keeping", (("outage_length", 60.0),), flown, design, scenario, {"smc": Classical("smc")}, (0,))
    table = point.run(lambda _: None)
    own = evaluate(make_policy("smc", "keeping"), flown, [0])
    assert table["cost_m_s"].iloc[0] == -own["return"].iloc[0]


def drawn(figure: Any) -> dict[str, Any]:
    """The first trace of each name."""
    return {trace.name: trace for trace in reversed(figure.data)}


def test_a_policy_of_one_price_is_a_dot() -> None:
    """What flies the same at every price, as a learned policy does, has no line to follow."""
    rows = []
    for value in VARIATIONS[FRONT].values:
        rows += [(FRONT, value, "lqr", value, 10 / value), (FRONT, value, "ppo", 2.0, 3.0)]
    columns = ["quantity", "value", "policy", "delta_v_m_s", "position_error_mean_m"]
    front = pd.DataFrame(rows, columns=columns).assign(cost_m_s=1.0)
    traces = drawn(trade_off_figure(front, looks_of(["lqr", "ppo"]), ()))
    assert (traces["lqr"].mode, traces["ppo"].mode) == ("lines+markers", "markers")
    assert traces["ppo"].marker.color not in [look.color for look in style.looks(["lqr", "smc"]).values()]


def test_what_would_squash_the_others_starts_hidden(folder: Path) -> None:
    """Four times the cost at most points: hidden in both pictures, and the axes fit the rest."""
    data = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    summary = pd.DataFrame(data["summary"])
    lqr = summary[summary["policy"] == "lqr"]
    measured = ["cost_m_s", "cost_low_m_s", "cost_high_m_s", "delta_v_m_s", "position_error_mean_m"]
    dear = lqr.assign(policy="dear", **{name: 4 * lqr[name] for name in measured})
    both = pd.concat([lqr, dear])
    assert expensive(both) == ["dear"]
    for draw in (trade_off_figure, robustness_figure):
        figure, alone = (draw(table, looks_of(["lqr", "dear"]), ["dear"]) for table in (both, lqr))
        assert (drawn(figure)["dear"].visible, drawn(figure)["lqr"].visible in (None, True)) == ("legendonly", True)
        assert figure.layout.yaxis.range == alone.layout.yaxis.range


def test_files_are_complete(folder: Path, episodes: pd.DataFrame) -> None:
    """Three files and no temporaries; the page loads nothing; strict JSON whose means are pandas' of the lines."""
    assert sorted(path.name for path in folder.iterdir()) == sorted(FILES)
    page = (folder / "sweep.html").read_text(encoding="utf-8")
    assert all(mark in page for mark in ("&lt;with&gt;", COMMAND, 'id="trade-off-0"', 'id="robustness-0"'))
    assert "<with>" not in page
    assert not any(mark in page for mark in ('src="http', "<link"))
    data = json.loads((folder / "sweep.json").read_text(encoding="utf-8"))
    assert (data["command"], data["seeds"], data["bound_seeds"]) == (COMMAND, [0, 1, 2], [0, 1])
    summary = pd.DataFrame(data["summary"]).set_index(["quantity", "value", "policy"])
    means = episodes.groupby(["quantity", "value", "policy"])[METRICS].mean()
    np.testing.assert_allclose(summary.loc[means.index, METRICS].to_numpy(float), means, rtol=1e-12)
    assert (summary["cost_low_m_s"] <= summary["cost_m_s"] + 1e-12).all()
    assert (summary["cost_m_s"] <= summary["cost_high_m_s"] + 1e-12).all()


def test_the_reading_names_who_costs_least() -> None:
    """Two policies that swap places along the front, and are told apart elsewhere only where each seed agrees."""
    rows = []
    for value, a, b, bound in ((0.1, 2.0, 3.0, 1.0), (10.0, 8.0, 6.0, 4.0)):
        rows += [(FRONT, value, name, 0, cost) for name, cost in (("a", a), ("b", b), (BOUND, bound))]
    unlike = [(seed, sign * 1.0) for seed, sign in enumerate((1, -1) * 12)]
    for quantity in [name for name in VARIATIONS if name != FRONT]:
        rows += [(quantity, 0.0, "a", seed, 10.0) for seed, _ in unlike]
        rows += [(quantity, 0.0, "b", seed, 10.1 + difference) for seed, difference in unlike]
    episodes = pd.DataFrame(rows, columns=["quantity", "value", "policy", "seed", "cost_m_s"])
    text = reading(episodes, episodes.assign(episodes=1, ended_early=0))
    assert text[0].endswith("a 2 to 2, b 1.5 to 3 times.")
    assert text[1].endswith(": a at 0.1; b at 10.")
    assert all(line.endswith(": a or b at every value.") for line in text[2:])
    assert len(text) == 1 + len(VARIATIONS)


@pytest.mark.parametrize(
    ("arguments", "named"),
    [
        (["nowhere"], "no scenario named 'nowhere'"),
        (["keeping", "--policy", "lqg"], "no policy named 'lqg'"),
        (["keeping", "keeping"], "two environments are called 'keeping'"),
    ],
)
def test_a_mistake_is_one_line(arguments: list[str], named: str, tmp_path: Path) -> None:
    """Exit code 2, one line that names it, and no files."""
    run = CliRunner().invoke(app, ["sweep", *arguments, "--out", str(tmp_path)])
    assert run.exit_code == 2
    assert named in run.stderr
    assert run.stderr.count("\n") == 1
    assert not list(tmp_path.iterdir())


def test_a_missing_solver_is_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the extra of the bound the command says what to install, before it flies."""
    monkeypatch.setitem(sys.modules, "clarabel", None)
    run = CliRunner().invoke(app, ["sweep", "keeping", "--out", str(tmp_path)])
    assert run.exit_code == 2
    assert run.stderr == "error: needs clarabel; in a checkout: pip install -e '.[optimal]', or make\n"
    assert not list(tmp_path.iterdir())


def test_what_does_not_fit_is_named(tmp_path: Path) -> None:
    """A step longer than the shortest outage, and an error without a price, by environment, key and value."""
    slow = build(Scenario, SHORT | {"dt_s": 90.0}, "test")
    with pytest.raises(ConfigError, match=r"outage_length = 60: dropout\.mean_outage_s: a mean of 60 s is shorter"):
        write_sweep(POLICIES, [slow], OPTIONS, tmp_path, COMMAND, 1)
    free = build(Scenario, SHORT | {"reward": {"error_weight": 0.0}}, "test")
    with pytest.raises(ConfigError, match=r"reward\.error_weight: must be > 0 for a trade-off, got 0"):
        write_sweep(POLICIES, [free], OPTIONS, tmp_path, COMMAND, 1)
