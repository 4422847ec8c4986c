"""The report: complete, self-contained, on equal seeds, and written all or nothing."""

import json
import re
import signal
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from plotly.offline import get_plotlyjs
from typer.testing import CliRunner

from baselines.__main__ import app
from baselines.controllers.reference_policies import Random, RandomSettings, Zero, ZeroSettings
from baselines.controllers.registry import POLICIES as CLASSICAL
from baselines.experiments.comparison import Flown
from baselines.experiments.estimates import significant
from baselines.experiments.statistics import Results, analyse
from baselines.experiments.sweep import BOUND
from baselines.experiments.variations import FRONT, VARIATIONS
from baselines.report import FILES, ReportOptions, Table, style, write_report
from baselines.report.flight_figures import outage_path
from baselines.report.scales import Scale, round_values
from baselines.report.text import numbers
from formation_env import ConfigError, Scenario, load_scenario
from formation_env.files import write_texts
from formation_env.kernel.metrics import METRICS
from formation_env.settings import build

EPISODES = 3
COMMAND = "python -m baselines report --episodes 3"
SHORT = {
    "title": "A short flight <with> a transfer & a hold",
    "phases": [
        {"formation": {"kind": "following", "y0_m": 200}, "transfer_orbits": 0.05, "hold_orbits": 0.05},
        {"formation": {"kind": "space_circle", "x0_m": 100, "vx0_m_s": 0.1}, "hold_orbits": 0.05},
    ],
    "dropout": {"kind": "bernoulli", "loss_probability": 0.3},
}


def zero(original: Scenario, believed: Scenario) -> Zero:
    return Zero(believed, ZeroSettings())


def random(original: Scenario, believed: Scenario) -> Random:
    return Random(believed, RandomSettings())


def only_short(original: Scenario, believed: Scenario) -> Zero | None:
    return zero(original, original) if len(original.phases) == 2 else None


POLICIES = {"zero": zero, "random": random, "learned_one": only_short}
FEW = 2
OPTIONS = ReportOptions(
    episodes=EPISODES,
    slow_episodes=FEW,
    sweep_episodes=2,
    sweep_bound_episodes=1,
    slow=("random",),
    unswept=("random",),
)


def short_scenarios() -> list[Scenario]:
    one = SHORT | {"phases": SHORT["phases"][:1], "title": "One phase"}
    return [build(Scenario, SHORT, "test"), build(Scenario, one, "test")]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("report") / "deep" / "folder"
    assert write_report(POLICIES, short_scenarios(), OPTIONS, out, COMMAND) == out / "report.html"
    return out


def test_all_files_and_nothing_else_are_written(folder: Path) -> None:
    """What the command promises, without temporaries."""
    assert sorted(path.name for path in folder.iterdir()) == sorted((*FILES, "bounds"))
    assert len([*(folder / "bounds").iterdir()]) == 2 * EPISODES


def test_policies_are_held_against_the_bound(folder: Path) -> None:
    """The cost ratio in the data is the mean of cost over bound of the tables, and no policy gets below the bound."""
    data = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    episodes = pd.read_csv(folder / "episodes.csv").set_index(["env", "policy", "seed"]).sort_index()
    for env, found in data["environments"].items():
        assert len(found["bounds"]) == EPISODES
        for policy, line in found["policies"].items():
            costs = -episodes.loc[(env, policy), "return"].to_numpy()
            ratios = costs / np.array(found["bounds"])[: len(costs)]
            assert line["cost_ratio"]["mean"] == pytest.approx(ratios.mean(), rel=1e-9)
            assert (ratios > 1).all()
    assert "over bound" in (folder / "report.html").read_text(encoding="utf-8")


def test_one_line_per_environment_policy_and_seed(folder: Path) -> None:
    """The same seeds for all, the first of them for slow policies; who has none for a scenario is left out there."""
    table = pd.read_csv(folder / "episodes.csv")
    assert list(table.columns) == ["env", "policy", "seed", *METRICS]
    flown = table.groupby(["env", "policy"])["seed"].apply(list).to_dict()
    titles = [scenario.title for scenario in short_scenarios()]
    expected = {(title, name) for title in titles for name in ("zero", "random")} | {(titles[0], "learned_one")}
    assert set(flown) == expected
    assert all(seeds == list(range(FEW if name == "random" else EPISODES)) for (_, name), seeds in flown.items())


def test_means_are_those_of_the_episodes(folder: Path) -> None:
    """summary.csv against pandas over episodes.csv; they differ by the rounding of sums only."""
    episodes = pd.read_csv(folder / "episodes.csv")
    summary = pd.read_csv(folder / "summary.csv").set_index(["env", "policy", "metric"])
    means = episodes[episodes["policy"] != "random"].groupby(["env", "policy"])[list(METRICS)].mean().stack()
    np.testing.assert_allclose(summary.loc[means.index, "mean"], means, rtol=1e-12)
    assert (summary["low"] <= summary["mean"] + 1e-12).all()
    assert (summary["mean"] <= summary["high"] + 1e-12).all()


def test_means_of_fewer_seeds_are_estimates_for_all(folder: Path) -> None:
    """By hand: what all seeds gave the policy that flew them, and the mean difference to it on the first ones.

    For the return, the bound in that policy's place, if the difference to it scatters less.
    """
    environments = json.loads((folder / "report.json").read_text())["environments"]
    episodes = pd.read_csv(folder / "episodes.csv").set_index(["env", "policy", "seed"]).sort_index()
    summary = pd.read_csv(folder / "summary.csv").set_index(["env", "policy", "metric"]).sort_index()
    for env in episodes.index.unique("env"):
        zero, few = episodes.loc[env, "zero"], episodes.loc[env, "random"]
        bound = -pd.Series(environments[env]["bounds"], zero.index)
        if (few["return"] - bound.loc[: FEW - 1]).std() < (few["return"] - zero["return"].loc[: FEW - 1]).std():
            zero = zero.assign(**{"return": bound})
        expected = zero.mean() + (few - zero.loc[: FEW - 1]).mean()
        for metric in METRICS:
            line = summary.loc[env, "random", metric]
            assert line["mean"] == pytest.approx(expected[metric], rel=1e-9, abs=1e-9)
            assert line["low"] <= line["mean"] <= line["high"]
            assert line["episodes"] == FEW


def test_easy_seeds_do_not_win() -> None:
    """A slow policy that flew the easy half and costs 1 m/s more on each seed is not ranked first."""

    def table(costs: list[float]) -> pd.DataFrame:
        values = dict.fromkeys(METRICS, 1.0) | {"seed": range(len(costs)), "return": [-cost for cost in costs]}
        return pd.DataFrame(values, index=range(len(costs)))

    full, slow = [1.0, 1.1, 5.0, 5.1], [2.0, 2.1]
    flown = Flown("env", short_scenarios()[0], {"slow": table(slow), "full": table(full)}, 0, {}, {})
    (results,) = analyse([flown], {"env": np.full(4, 0.5)})
    assert (results.ranking, results.reference, results.partial) == (["full", "slow"], "full", ["slow"])
    assert results.cost("slow")[0] == pytest.approx(np.mean(full) + 1)
    assert results.behind("full", "slow") == pytest.approx((1, 1, 1))
    assert results.cost_ratios_flown["slow"][0] == pytest.approx(np.mean(slow) / 0.5)
    assert results.cost_ratios["slow"][0] == pytest.approx((np.mean(full) + 1) / 0.5)  # the basis of its cost
    low, high = results.cost("slow")[1:]
    # the difference is the same everywhere, so all that is uncertain is the reference's mean
    assert (low, high) == pytest.approx(tuple(end + 1 for end in results.cost("full")[1:]))
    # nor is it ranked below what was possible: with a bound that it follows more closely, that is what is carried over
    bounds = np.array([1.9, 2.0, 2.2, 2.3])
    (results,) = analyse([flown], {"env": bounds})
    assert results.cost("slow")[0] == pytest.approx(np.mean(full) + 1)
    uneven = Flown("env", flown.scenario, {"slow": table([2.0, 2.1]), "full": table([3.0, 2.2, 5.0, 5.1])}, 0, {}, {})
    (results,) = analyse([uneven], {"env": bounds})
    assert results.cost("slow")[0] == pytest.approx(bounds.mean() + 0.1)


def test_json_is_complete(folder: Path) -> None:
    """Seeds, versions, command, settings that build the same scenario, summaries, paired differences."""

    def refuse(word: str) -> None:
        raise AssertionError(f"not strict JSON: {word}")

    data = json.loads((folder / "report.json").read_text(encoding="utf-8"), parse_constant=refuse)
    assert data["seeds"] == list(range(EPISODES))
    assert data["command"] == COMMAND
    assert {"python", "numpy", "gymnasium", "formation_env"} <= set(data["versions"])
    for scenario in short_scenarios():
        environment = data["environments"][scenario.title]
        assert _rebuilt(environment["scenario"]) == scenario
        for name, policy in environment["policies"].items():
            assert set(policy["summary"]) == set(METRICS)
            assert policy["episodes"] == (FEW if name == "random" else EPISODES)
            assert policy["action_time_us"] > 0
            assert policy["cost_m_s"]["mean"] == -policy["summary"]["return"]["mean"]
            best = environment["best"]
            assert name == best or set(policy["paired_differences"][best]["return"]) == {"mean", "low", "high"}
            assert policy["estimated"] == (name == "random")


def _rebuilt(settings: dict[str, object]) -> Scenario:
    """Settings from JSON, whose lists stand for YAML's and whose null leader was never given."""
    return build(Scenario, settings, "report.json")


def test_page_holds_everything_and_loads_nothing(folder: Path) -> None:
    """Every environment and policy is there; apart from plotly.js (once, inline) nothing names another resource."""
    page = (folder / "report.html").read_text(encoding="utf-8")
    library = get_plotlyjs()
    assert page.count(library) == 1
    own = page.replace(library, "")
    assert "A short flight &lt;with&gt; a transfer &amp; a hold" in own
    assert "One phase" in own
    assert all(name in own for name in POLICIES)
    assert not re.search(r"https?://|<link|<iframe|@import|url\(|\bsrc\s*=", own)
    assert "default-src 'none'" in own
    assert own.count('class="plot"') == 1 + 6 * len(short_scenarios()) + 1  # paired differences need two policies
    assert len(page) < 8e6


def test_the_page_says_who_wins_and_who_flew_less(folder: Path) -> None:
    """A sentence per environment at the top, with the numbers of the data; why some flew fewer seeds."""
    page = (folder / "report.html").read_text(encoding="utf-8").replace(get_plotlyjs(), "")
    data = json.loads((folder / "report.json").read_text(encoding="utf-8"))
    top = page[page.index("Result by environment") : page.index('class="environment"')]
    for found in data["environments"].values():
        best = found["best"]
        cost, over = (found["policies"][best][key] for key in ("cost_m_s", "cost_ratio"))
        mean, (ratio, low, high) = numbers(tuple(cost.values()))[0], numbers(tuple(over.values()))
        assert f"{best} has the lowest mean cost, {mean} m/s, {ratio} [{low}, {high}] times" in top
        assert f"next in rank is {next(name for name in found['ranking'] if name != best)}, " in top
        assert "too few for a verdict" in top
        assert "significant" not in top
    assert page.count("Too slow for all 3 seeds: random (2) flew only the first.") == len(data["environments"])


def test_fronts_and_robustness_are_in_the_report(folder: Path) -> None:
    """Every point of a sweep is flown by all policies but the left out, on the first test seeds."""
    lines = pd.read_csv(folder / "sweep.csv")
    flown = lines.groupby(["env", "quantity", "value", "policy"])["seed"].apply(list)
    for scenario in short_scenarios():
        crew = {"zero", "learned_one"} if len(scenario.phases) == 2 else {"zero"}
        for quantity, variation in VARIATIONS.items():
            for value in variation.few:
                found = flown.loc[scenario.title, quantity, value].to_dict()
                expected = {name: [0, 1] for name in crew} | ({BOUND: [0]} if quantity == FRONT else {})
                assert found == expected


def test_no_front_where_none_is_possible(tmp_path: Path) -> None:
    """An error without a price has no front; the report says so, and is written all the same."""
    free = build(Scenario, SHORT | {"reward": {"error_weight": 0.0}}, "test")
    page = write_report(
        {"random": random, "zero": zero}, [free], ReportOptions(episodes=2, unswept=()), tmp_path, COMMAND
    )
    assert "No trade-off and no robustness: sweep: " in page.read_text(encoding="utf-8")
    assert "must be &gt; 0 for a trade-off, got 0" in page.read_text(encoding="utf-8")
    assert len(pd.read_csv(tmp_path / "sweep.csv")) == 0


def test_further_tables_stand_on_the_page_and_beside_it(tmp_path: Path) -> None:
    """The caller makes them of the results; as Markdown, as data and, escaped, as HTML."""

    def tables(results: Sequence[Results]) -> list[Table]:
        rows = tuple((item.flown.label, f"<{item.best}>") for item in results)
        return [Table("own", "A table", ("environment", "best, m/s"), rows, "What it means.")]

    (scenario,) = short_scenarios()[1:]
    write_report(
        {"zero": zero}, [scenario], ReportOptions(episodes=2, sweep_episodes=0), tmp_path, COMMAND, tables=tables
    )
    lines = ["| environment | best, m/s |", "| --- | --- |", f"| {scenario.title} | <zero> |", "", "What it means."]
    assert (tmp_path / "own.md").read_text().splitlines() == lines
    page = (tmp_path / "report.html").read_text()
    assert "<h2>A table</h2>" in page
    assert "&lt;zero&gt;" in page
    data = json.loads((tmp_path / "report.json").read_text())
    assert data["tables"][0]["rows"] == [{"environment": scenario.title, "best, m/s": "<zero>"}]


def test_a_failure_leaves_the_old_files(folder: Path, tmp_path: Path) -> None:
    """A policy that fails in mid-flight: no file changes, none appears but the bounds, which are as good as new."""

    class Failing(Zero):
        def predict(self, observation, state=None, episode_start=None, deterministic=True):  # type: ignore[no-untyped-def]
            raise RuntimeError("in mid-flight")

    (tmp_path / "report.html").write_text("old")
    policies = {"zero": zero, "failing": lambda original, believed: Failing(believed, ZeroSettings())}
    with pytest.raises(RuntimeError, match="in mid-flight"):
        write_report(policies, short_scenarios(), OPTIONS, tmp_path, COMMAND)
    assert {path.name for path in tmp_path.iterdir()} <= {"report.html", "bounds"}
    assert (tmp_path / "report.html").read_text() == "old"


@pytest.mark.parametrize("failure", [OSError("disk full"), KeyboardInterrupt()])
def test_files_are_written_all_or_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, failure: BaseException) -> None:
    """The second of two files cannot be written: the first keeps its old content, no temporary stays."""
    (tmp_path / "a.csv").write_text("old")
    write_bytes = Path.write_bytes

    def failing(self: Path, data: bytes) -> int:
        if self.name.startswith(".b."):
            raise failure
        return write_bytes(self, data)

    monkeypatch.setattr(Path, "write_bytes", failing)
    with pytest.raises(type(failure)):
        write_texts(tmp_path, {"a.csv": "new", "b.csv": "new"})
    assert [path.name for path in tmp_path.iterdir()] == ["a.csv"]
    assert (tmp_path / "a.csv").read_text() == "old"


@pytest.mark.parametrize(
    ("envs", "message"),
    [(["keping"], "did you mean 'keeping'"), (["keeping", "keeping"], "name each once"), ([], "no environment")],
)
def test_wrong_environments_are_named(tmp_path: Path, envs: list[str], message: str) -> None:
    """A mistake in the command is found before anything flies."""
    with pytest.raises(ConfigError, match=message):
        write_report(POLICIES, envs, OPTIONS, tmp_path / "out", COMMAND)
    assert not (tmp_path / "out").exists()


def test_an_environment_without_policy_is_refused(tmp_path: Path) -> None:
    """A report without a line says nothing."""
    with pytest.raises(ConfigError, match="no policy for keeping_nonlinear"):
        write_report({"none": lambda original, believed: None}, ["keeping_nonlinear"], OPTIONS, tmp_path, COMMAND)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_ends_in_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    """SIGINT during the flights of the real command: non-zero exit, one line after the progress bar, no file."""
    out = tmp_path / "out"
    arguments = ["report", "--episodes", "20000", "--env", "keeping_nonlinear", "--policy", "zero"]
    arguments += ["--processes", "1", "--out", str(out)]
    process = subprocess.Popen([sys.executable, "-m", "baselines", *arguments], stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    shown = ""
    while not re.search(r"[1-9]%", shown):  # the kernel is compiled and the flights have begun
        shown += process.stderr.read(1)
        assert process.poll() is None, shown
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.endswith("\nreport: interrupted, no report written\n")
    assert "Traceback" not in errors
    assert not out.exists()


@pytest.mark.parametrize("library", ["plotly", "jinja2", "tqdm"])
def test_a_missing_library_is_one_line(library: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the report's extra the command says what to install."""
    for module in [
        name for name in sys.modules if name.startswith(("baselines.report.", "baselines.experiments.", "plotly."))
    ]:
        monkeypatch.delitem(sys.modules, module)
    monkeypatch.delitem(sys.modules, "baselines.report")
    monkeypatch.setitem(sys.modules, library, None)
    run = CliRunner().invoke(app, ["report", "--episodes", "1", "--env", "keeping", "--out", str(tmp_path)])
    assert run.exit_code == 1
    assert run.stderr == f"report: needs {library}; install it with: pip install 'formation-env[report]'\n"


@pytest.mark.parametrize(("option", "name"), [("--env", "keping"), ("--policy", "lqrr")])
def test_a_mistake_is_one_line(option: str, name: str, tmp_path: Path) -> None:
    """A misspelt name ends the command with its neighbour's name."""
    run = CliRunner().invoke(app, ["report", option, name, "--out", str(tmp_path)])
    assert run.exit_code == 2
    assert run.stderr.count("\n") == 1
    assert "did you mean" in run.stderr


def test_outages_are_the_instants_without_measurement() -> None:
    """Lost at instants 1, 2 and 5 of 6: two bands, each reaching half a step beyond, in orbits."""
    scenario = load_scenario("keeping")
    path = outage_path(pd.DataFrame({"measured": [True, False, False, True, True, False]}), scenario)
    ends = np.array([[float(x) for x in re.findall(r"([\d.]+),0 ", band)] for band in path.split("Z")[:-1]])
    unit = scenario.dt_s / scenario.orbit.period_s
    np.testing.assert_allclose(ends / unit, [[0.5, 2.5], [4.5, 5.5]], atol=2e-3)  # written with five decimals
    assert outage_path(pd.DataFrame({"measured": [True, True]}), scenario) == ""


def test_a_policy_looks_the_same_whoever_else_flies() -> None:
    """The classical policies keep their looks; learned ones get colours that none of them has."""
    alone, together = style.looks(["smc"]), style.looks(["ppo", *CLASSICAL, "sac", "td3"])
    assert alone["smc"] == together["smc"]
    classical, learned = ([together[name] for name in names] for names in (CLASSICAL, ("ppo", "sac", "td3")))
    assert not {look.color for look in classical} & {look.color for look in learned}
    assert len({look.symbol for look in together.values()}) == len(together)
    assert len({(look.color, look.dash) for look in together.values()}) == len(together)


def test_numbers_show_their_interval() -> None:
    """Two digits of the interval's width, four of the number at most; by hand."""
    assert numbers((-1.23456, -1.2501, -1.2199)) == ("−1.235", "−1.250", "−1.220")
    assert numbers((2043.2, 1990.4, 2101.6)) == ("2,043", "1,990", "2,102")
    assert numbers((0.0, 0.0, 0.0)) == ("0", "0", "0")
    assert significant((1.0, 0.1, 2.0))
    assert not significant((1.0, -0.1, 2.0))


def test_scales_hold_their_values() -> None:
    """Logarithmic for wide positive values only; the values are inside; round values lie between their bounds."""
    wide, narrow, zeros = (Scale.fit(np.array(v)) for v in ([1.0, 500.0], [1.0, 2.0], [0.0, 500.0]))
    assert (wide.log, narrow.log, zeros.log) == (True, False, False)
    assert wide.low < 1 < 500 < wide.high
    assert round_values(0.9, 12.0) == [1.0, 2.0, 3.0, 5.0, 7.0, 10.0]
    assert round_values(0.09, 12.0) == [0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0]
