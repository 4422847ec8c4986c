"""The report: complete, self-contained, on equal seeds, and written all or nothing."""

import json
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from plotly.offline import get_plotlyjs
from typer.testing import CliRunner

from baselines.cli import app
from baselines.controllers.reference_policies import Random, RandomSettings, Zero, ZeroSettings
from baselines.controllers.registry import POLICIES as CLASSICAL
from baselines.experiments.comparison import Flown
from baselines.experiments.estimates import significant
from baselines.experiments.statistics import Results, analyse
from baselines.experiments.sweep import BOUND
from baselines.experiments.variations import FRONT, VARIATIONS
from baselines.report import FILES, Quantity, ReportOptions, Table, results_page, style, write_report
from baselines.report.csv_text import csv_text
from baselines.report.flight_figures import THRUST_FLOOR, outage_path, time_figure
from baselines.report.scales import Scale, round_values
from baselines.report.text import column, headline, numbers
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


def zero(original: Scenario, design: Scenario) -> Zero:
    return Zero(design, ZeroSettings())


def random(original: Scenario, design: Scenario) -> Random:
    return Random(design, RandomSettings())


def only_short(original: Scenario, design: Scenario) -> Zero | None:
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
            assert line["cost_ratio_on_seeds_flown"]["mean"] == pytest.approx(ratios.mean(), rel=1e-9)
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
        assert f"{next(name for name in found['ranking'] if name != best)}, " in top
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
    policies = {"zero": zero, "failing": lambda original, design: Failing(design, ZeroSettings())}
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
        write_report({"none": lambda original, design: None}, ["keeping_nonlinear"], OPTIONS, tmp_path, COMMAND)
    assert not list(tmp_path.iterdir())


def test_ctrl_c_ends_in_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    """SIGINT during the flights of the real command: non-zero exit, one line after the progress bar, no file."""
    out = tmp_path / "out"
    arguments = ["report", "--episodes", "20000", "keeping_nonlinear", "--policy", "zero"]
    arguments += ["--processes", "1", "--out", str(out)]
    process = subprocess.Popen([sys.executable, "-m", "baselines", *arguments], stderr=subprocess.PIPE, text=True)
    assert process.stderr is not None
    shown = ""
    while "episodes and bounds (1 of 2): started" not in shown:
        shown += process.stderr.readline()
        assert process.poll() is None, shown
    time.sleep(1)  # the flights take 4 s and the statistics a minute
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 130
    assert errors.endswith("interrupted, no report written\n")
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
    run = CliRunner().invoke(app, ["report", "--episodes", "1", "keeping", "--out", str(tmp_path)])
    assert run.exit_code == 2
    assert run.stderr == f"error: needs {library}; in a checkout: pip install -e '.[report]', or make\n"


@pytest.mark.parametrize("arguments", [["keping"], ["--policy", "lqrr"]])
def test_a_mistake_is_one_line(arguments: list[str], tmp_path: Path) -> None:
    """A misspelt name ends the command with its neighbour's name."""
    run = CliRunner().invoke(app, ["report", *arguments, "--out", str(tmp_path)])
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


# Verdicts.


def costing(costs: dict[str, list[float]]) -> Results:
    """Results of policies that cost so much on their seeds."""
    tables = {
        name: pd.DataFrame(dict.fromkeys(METRICS, 1.0) | {"seed": range(len(each)), "return": -np.array(each)})
        for name, each in costs.items()
    }
    times = {name: pd.DataFrame({"action_time_us": [20.0]}) for name in costs}
    (results,) = analyse([Flown("env", short_scenarios()[0], tables, 0, times, {})], {})
    return results


@pytest.mark.parametrize(("episodes", "verdict"), [(19, None), (20, True)])
def test_few_episodes_allow_no_verdict(episodes: int, verdict: bool | None) -> None:
    """A clear difference on each seed is called significant from 20 episodes on."""
    costs = [1.0 + 0.01 * seed for seed in range(episodes)]
    results = costing({"lqr": costs, "smc": [cost + 1 + 0.001 * (cost % 0.1) for cost in costs]})
    assert results.verdict("smc", "lqr") is verdict
    text = headline(results)
    assert ("costs least" in text) == ("significant" in text) == (verdict is True)
    assert ("too few for a verdict" in text) == (verdict is None)


def test_few_seeds_do_not_make_the_best() -> None:
    """An estimate from 5 seeds may lead the ranking, but the best policy flew enough of them."""
    costs = [1.0 + 0.01 * seed for seed in range(40)]
    results = costing({"mpc": [cost - 0.5 for cost in costs[:5]], "lqr": costs, "smc": [cost + 0.2 for cost in costs]})
    assert (results.ranking[0], results.best) == ("mpc", "lqr")
    assert results.verdict("mpc", "lqr") is None
    assert "mpc" not in results.best_of("return")


# The page.


def test_tables_can_be_read_aloud_and_scrolled_by_keys(folder: Path) -> None:
    """Every heading says what it heads; every box that scrolls takes the focus and has a name."""
    page = (folder / "report.html").read_text(encoding="utf-8").replace(get_plotlyjs(), "")
    headings = re.findall(r"<th\b[^>]*>", page)
    assert headings
    assert all(re.search('scope="(col|row)"', heading) for heading in headings)
    boxes = re.findall(r'<div class="scroll"[^>]*>', page)
    assert boxes
    assert all('tabindex="0"' in box and "aria-label=" in box for box in boxes)
    assert "IntersectionObserver" in page


def luminance(color: str) -> float:
    """Relative luminance of #rrggbb (WCAG 2.2)."""
    parts = [int(color[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return float(np.dot([0.2126, 0.7152, 0.0722], linear))


def test_colours_are_seen_on_light_and_on_dark() -> None:
    """WCAG asks for a contrast of 3 for parts of figures; the cards are #ffffff and #1d2026."""
    css = (Path(style.__file__).parent / "templates" / "page.css").read_text()
    cards = re.findall(r"--card: (#\w{6})", css)
    assert len(cards) == 2
    for name, look in style.looks([*CLASSICAL, "ppo", "sac"]).items():
        for card in cards:
            low, high = sorted([luminance(look.color), luminance(card)])
            assert (high + 0.05) / (low + 0.05) >= 3, (name, card)


def test_a_column_has_one_number_of_decimals() -> None:
    """So that ranks can be read; the median of what each number needs."""
    cells = column([(1.0712, 1.059, 1.079), (1.1, 1.09, 1.11), None, (20.43, 19.9, 21.01)])
    assert cells == [("1.071", "1.059", "1.079"), ("1.100", "1.090", "1.110"), None, ("20.430", "19.900", "21.010")]
    assert column([(-0.0001, -0.2, 0.2)], -1.0) == [("0.00", "−0.20", "0.20")]


def test_a_solvers_dust_is_not_drawn() -> None:
    """Thrust of 1e-10 m/s^2, where zero is meant, is a gap; the axis ends at the floor."""
    scenario = short_scenarios()[1]
    results = costing({"lqr": [1.0, 2.0]})
    length = scenario.num_steps + 1
    names = ["time_s", "position_error_m", "delta_v_m_s", "ax_m_s2", "ay_m_s2", "az_m_s2"]
    flight = pd.DataFrame({name: np.ones(length) for name in names} | {"measured": True})
    flight["time_s"] = scenario.dt_s * np.arange(length)
    limit = scenario.spacecraft.max_accel_m_s2
    flight[names[3:]] = 0.0
    flight.loc[:5, "ax_m_s2"] = limit
    flight.loc[6:, "ax_m_s2"] = 1e-10
    results.flown.flights["lqr"] = flight
    figure = time_figure(results, style.looks(["lqr"]))
    thrust = np.array(figure.data[1].y, float)
    assert np.nanmin(thrust) == pytest.approx(1e3 * limit, rel=1e-6)
    assert np.isnan(thrust[6:]).all()
    assert 10 ** figure.layout.yaxis2.range[0] == pytest.approx(THRUST_FLOOR * 1e3 * limit)


# Files.


def test_a_spreadsheet_runs_nothing() -> None:
    """Texts that begin like a formula get an apostrophe; numbers stay numbers."""
    table = pd.DataFrame({"env": ["=1+1", "+a", "-a", "@a", "a=b"], "cost": [-1.0, 2.0, 3.0, 4.0, 5.0]})
    lines = csv_text(table).splitlines()
    assert lines == ["env,cost", "'=1+1,-1.0", "'+a,2.0", "'-a,3.0", "'@a,4.0", "a=b,5.0"]


def test_a_folder_that_cannot_be_written_is_found_first(tmp_path: Path) -> None:
    """Nothing is flown before."""

    def never(original: Scenario, design: Scenario) -> Zero:
        raise AssertionError("flown")

    blocked = tmp_path / "file"
    blocked.touch()
    with pytest.raises(OSError, match="cannot be written") as caught:
        write_report({"never": never}, short_scenarios(), OPTIONS, blocked / "out", COMMAND)
    assert caught.value.filename == str(blocked / "out")


def test_tables_hold_numbers() -> None:
    """Mean, low, high and count in report.json; the same as text on the page."""
    table = Table("t", "T", ("policy", "cost"), (("ppo", Quantity((1.0, 0.9, 1.1), 30, "lqr")), ("sac", None)), "")
    rows = table.as_data()["rows"]
    assert rows[0] == {"policy": "ppo", "cost": {"mean": 1.0, "low": 0.9, "high": 1.1, "n": 30, "note": "lqr"}}
    assert rows[1] == {"policy": "sac", "cost": None}
    assert table.texts() == [["ppo", "1.00 [0.90, 1.10] (lqr)"], ["sac", "–"]]


def test_the_results_page_has_every_policy_and_environment(folder: Path) -> None:
    """Markdown tables whose rows have as many cells as their headings; written beside the page, and made again."""
    text = (folder / "results.md").read_text(encoding="utf-8")
    blocks = [block.splitlines() for block in text.split("\n\n") if block.startswith("|")]
    assert len(blocks) == 5
    titles = [scenario.title for scenario in short_scenarios()]
    for block in blocks:
        assert len({line.count("|") for line in block}) == 1
        assert block[0] == f"| policy | {' | '.join(titles)} |"
    assert all(any(f"`{name}`" in line for line in blocks[0]) for name in POLICIES)
    results = costing({"lqr": [1.49, 1.5, 1.51]})
    assert "| `lqr` | 1.500 [" in results_page([results])
