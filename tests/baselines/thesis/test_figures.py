"""The thesis's figures: they draw what was flown, the numbers behind them are the printed ones, and files are whole."""

import base64
import html
import json
import re
import signal
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from typer.testing import CliRunner

from baselines.cli import app
from baselines.controllers.registry import make_policy
from baselines.experiments import parallel
from baselines.thesis import claim_files, figure_flights, scenarios, write_thesis
from baselines.thesis.claims import claims_table
from baselines.thesis.claims.claim import Claim
from baselines.thesis.figures import FIGURES, drawings, orbits, style
from baselines.thesis.flight_recorder import desired_path
from baselines.thesis.fly_laws import fly_laws
from baselines.thesis.recorded_flights import Flights
from baselines.thesis.thesis_page import Content, Picture, render, verdict_summary
from formation_env import load_scenario
from formation_env.evaluation.rollout import evaluate
from formation_env.formations import Following, InTrack
from formation_env.orbital.constants import OMEGA_EARTH, R_EARTH
from formation_env.orbital.orbit import Orbit
from formation_env.task.phases import Limits

ROOT = Path(__file__).parents[3]
COARSE_S = 30.0
FACTS = {"command": "c", "episodes": 1, "step_s": "1", "step_warning": "", "versions": {"python": "3"}}
PRINTED_START = [2000, 369.3, 3464.1, 0.2, -4.3, 0.3]
CLAIM = Claim("5.2.1", "a < b & c", "< 30 m", "26.6 m", 26.5, None, "holds", "T = 1 s", "the lag")
TABLES = claims_table.ClaimTables(
    [CLAIM],
    noise=pd.DataFrame([{"section": "5.2.2", "low": 0.123456, "high": np.nan}]),
    readings=pd.DataFrame([{"reading": "k <printed>", "gives_the_figures": True}]),
    fair=pd.DataFrame([{"truth": "nonlinear", "fails": False}]),
)


@pytest.fixture(scope="module")
def flown() -> dict[str, Flights]:
    """All flights of the figures in little: coarse steps, two seeds, little more than two periods of keeping."""
    return parallel.run(figure_flights.figure_jobs(range(2), COARSE_S, periods=2.3), lambda cost: None, workers=1)


# What is flown.


def test_scenarios_start_where_the_thesis_prints() -> None:
    """Section 5.2.2's start and section 5.2.4's entry, to the digits that are printed."""
    keeping, reconfiguration = scenarios.keeping(), scenarios.reconfiguration()
    start = keeping.start.formation.state(keeping.orbit)
    np.testing.assert_allclose(start, PRINTED_START, atol=0.05)
    entry = desired_path(reconfiguration, "automatic")[0]
    np.testing.assert_allclose(entry, [0, 3324, 0, 1.8, 0, 3.6], atol=0.5)
    np.testing.assert_array_equal(scenarios.with_velocity(reconfiguration, (1, 2, 3)), [0, 5000, 0, 1, 2, 3])


def test_the_failure_has_its_window() -> None:
    """3000 s as shipped, another length if asked for, and none for zero."""
    times_s = np.array([0.0, 2999.0, 3000.0])
    for wanted, closed in ((None, [True, True, False]), (10.0, [True, False, False]), (0.0, [False, False, False])):
        dropout = scenarios.keeping_failure(duration_s=wanted).dropout
        np.testing.assert_array_equal(dropout.closed(times_s), closed)


def test_control_weights_are_swapped_everywhere() -> None:
    """A law of another weight is the shipped one with that weight alone; sliding mode has none."""
    scenario = scenarios.keeping(1.0, COARSE_S)
    for name in ("lqr", "lqr_quasi_static"):
        same = scenarios.law(name, scenario, "thesis_keeping", 12000.0)
        np.testing.assert_array_equal(same.K, scenarios.law(name, scenario, "thesis_keeping").K)  # type: ignore[attr-defined]
        assert np.abs(scenarios.law(name, scenario, "thesis_keeping", 1.0).K).max() > np.abs(same.K).max()  # type: ignore[attr-defined]
    with pytest.raises(ValueError, match="SMCSettings has no control weight"):
        scenarios.law("smc", scenario, "thesis_keeping", 1.0)


# What is recorded.


def test_sums_are_those_of_evaluate() -> None:
    """Whatever is kept of a flight, its sums and maxima are evaluate's, over transfer and hold together or apart."""
    scenario, seeds = replace(load_scenario("keeping"), dt_s=COARSE_S), [5, 6, 7]
    policies = [make_policy(name, scenario) for name in ("lqr", "zero")]
    flights = fly_laws(policies, scenario, seeds, every=50)
    for index, policy in enumerate(policies):
        table = evaluate(policy, scenario, seeds)
        # Sums in another order differ by rounding; maxima are kept in single precision.
        np.testing.assert_allclose(flights.mean_error()[index], table["position_error_mean_m"], rtol=1e-12)
        np.testing.assert_allclose(flights.delta_v()[index], table["delta_v_m_s"], rtol=1e-12, atol=1e-15)
        np.testing.assert_allclose(flights.max_error()[index], table["position_error_max_m"], rtol=1e-6)
    final = np.linalg.norm(flights.error_m(0)[-1])
    assert final == pytest.approx(evaluate(policies[0], scenario, seeds)["position_error_final_m"][0], rel=1e-3)


def test_what_is_kept_changes_no_sum(flown: Mapping[str, Flights]) -> None:
    """Coarser instants are a subset of the finer ones, and windows add up to the whole."""
    scenario = scenarios.mission(COARSE_S)
    every = [fly_laws([figure_flights.MISSION.make(scenario)], scenario, [1], every=step) for step in (1, 77)]
    np.testing.assert_array_equal(every[0].truth[every[1].steps], every[1].truth)
    assert set(every[1].steps) >= {0, scenario.steps(5.05), scenario.steps(1), scenario.num_steps}
    for quantity in ("delta_v", "effort", "mean_error", "max_error", "max_accel"):
        fine, coarse = (getattr(flights, quantity)(9, 2) for flights in every)
        np.testing.assert_allclose(coarse, fine, rtol=1e-12)
    apart = every[1].delta_v(4) + every[1].delta_v(start=4)
    np.testing.assert_allclose(apart, every[1].delta_v(), rtol=1e-12)
    with pytest.raises(ValueError, match=r"0\.123 periods after the start was not recorded"):
        every[1].index(0.123)


def test_measurements_are_the_sensors(flown: Mapping[str, Flights]) -> None:
    """Kept measurements scatter about the truth as the sensor says, and there are none while the link is closed.

    A standard deviation of n numbers scatters by 1 / sqrt(2 n), with n > 400 below 4 %; 5 of these.
    """
    flights = flown["failure"]
    measured = ~np.isnan(flights.measurement[..., 0])
    np.testing.assert_array_equal(measured[:, 0, 0], ~flights.scenario.dropout.closed(flights.time_s))
    error = (flights.measurement - flights.truth[..., :3])[measured]
    assert error.std() == pytest.approx(2.0, rel=0.2)
    assert np.isnan(flown["mission"].measurement).all()


def test_axes_bound_the_magnitude(flown: Mapping[str, Flights]) -> None:
    """Delta-v of the axes: at least the vector's together, at most sqrt(3) times it (norms of R^3)."""
    for flights in flown.values():
        together = flights.effort().sum(axis=-1)
        assert (together >= flights.delta_v() * (1 - 1e-12)).all()
        assert (together <= np.sqrt(3) * flights.delta_v() * (1 + 1e-12)).all()


def test_nothing_is_told_of_what_was_not_flown() -> None:
    """After an early end everything is NaN, so that no mean can hide it; the other policy goes on."""
    scenario = replace(scenarios.reconfiguration(dt_s=COARSE_S), limits=Limits(max_distance_m=1700.0))
    flights = fly_laws(
        [make_policy("zero", scenario), figure_flights.RECONFIGURATION.make(scenario)], scenario, [0], every=7, few=1
    )
    ended = int(np.isnan(flights.position_error_m[:, 0, 0]).argmax())
    assert 0 < ended < len(flights.steps)
    for values in (flights.position_error_m, flights.accel_m_s2, flights.truth, flights.estimate, flights.thrust_m_s2):
        assert np.isnan(values[ended:, 0]).all()
        assert np.isfinite(values[:ended, 0]).all()
        assert np.isfinite(values[:, 1]).all()
    assert np.isnan(flights.delta_v()[0, 0])
    assert np.isfinite(flights.delta_v()[1, 0])


def test_processes_fly_the_same() -> None:
    """Two processes give, bit for bit, what one gives, and all progress arrives."""
    wanted = {
        name: job
        for name, job in figure_flights.figure_jobs(range(2), 60.0, 0.1).items()
        if "error" in name or "0.1" in name
    }
    apart: list[int] = []
    here, there = parallel.run(wanted, lambda cost: None, 1), parallel.run(wanted, apart.append, 2)
    assert here.keys() == there.keys() == wanted.keys()
    for name, flights in here.items():
        np.testing.assert_array_equal(flights.truth, there[name].truth)
    assert sum(apart) == sum(job.cost for job in wanted.values())


# The numbers behind the figures, printed in the thesis or read from its axes.


@pytest.mark.parametrize(("periods", "error_m", "accel_m_s2"), [(0.5, 26.6, 0.02), (0.1, 132.8, 0.08)])
def test_initialization_is_the_printed_one(periods: float, error_m: float, accel_m_s2: float) -> None:
    """Figures 5.2 and 5.3 with the printed gains at 1 s: below 30 and 150 m, in the axes of the control.

    The errors to 0.1 m are those of an independent prototype of the trajectory-following law (eq. 4.17-4.19).
    """
    flights = figure_flights.initializations()[f"initialization {periods:g}"].run(lambda cost: None)
    assert flights.max_error()[0, 0] == pytest.approx(error_m, abs=0.1)
    assert flights.max_accel()[0, 0] < accel_m_s2


def test_keeping_is_the_printed_one() -> None:
    """Figure 5.7 at 1 s: 300 m, below 4e-3 m/s^2, most of it across the plane; 2 % for reading off a figure.

    In closed form: k^2 - n^2 times 3464 m is 2.94e-3 m/s^2, which LQR's stiffness n / sqrt(a) answers by about 300 m.
    The rest of the effort undoes the unknown start.
    """
    job = figure_flights.keepings((0,), periods=1.0)["keeping"]
    flights = replace(job, laws=(figure_flights.LQR,)).run(lambda cost: None)
    assert flights.max_error()[0, 0] == pytest.approx(300.0, rel=0.02)
    assert flights.max_accel()[0, 0] < 4e-3
    assert flights.effort()[0, 0, 2] > 0.9 * flights.effort()[0, 0].sum()


def test_in_track_follows_the_track() -> None:
    """Against the geometry of two circles: at the equator the following formation misses by its share of Earth's turn.

    Its delay over ground is y0 / (r (n - w cos i)), in which the Earth turns by w sin i across the track. The in-track
    formation's formula is of first order in w / n = 7 %, so it misses by at most that share.
    """
    orbit, ahead_m = Orbit(), 2000.0
    times_s = np.linspace(0.0, orbit.period_s, 100)
    following = orbits.miss_m(times_s, Following(y0_m=ahead_m), ahead_m, orbit)
    rate = orbit.mean_motion_rad_s - OMEGA_EARTH * np.cos(orbit.inclination_rad)
    across_m = ahead_m * R_EARTH / orbit.radius_m * OMEGA_EARTH * np.sin(orbit.inclination_rad) / rate
    assert following[0] == pytest.approx(across_m, rel=1e-3)
    in_track = orbits.miss_m(times_s, InTrack(y0_m=ahead_m), ahead_m, orbit)
    assert in_track.max() < OMEGA_EARTH / orbit.mean_motion_rad_s * following.max()


# The figures.


def test_all_figures_of_the_thesis_are_there() -> None:
    """3.3 to 3.6 and 5.2 to 5.27; 5.1 is a block diagram."""
    assert list(FIGURES) == [f"3.{k}" for k in range(3, 7)] + [f"5.{k}" for k in range(2, 28)]
    assert all(figure.title and figure.sentence for figure in FIGURES.values())


@pytest.mark.parametrize("number", FIGURES)
def test_every_axis_has_quantity_and_unit(number: str, flown: Mapping[str, Flights]) -> None:
    """Every figure draws from a tiny run; every axis names a quantity and a unit, and something is drawn on it."""
    with style.settings():
        drawn = FIGURES[number].draw(flown)
    assert drawn.axes
    for axes in drawn.axes:
        labels = [getattr(axes, f"get_{name}label")() for name in "xyz" if hasattr(axes, f"get_{name}label")]
        assert all(re.fullmatch(r".+ \[(m|s|m/s|m/s²|period|deg)\]", label) for label in labels), labels
        assert any(np.isfinite(line.get_ydata()).any() for line in axes.lines)
    assert drawn.legends or number.startswith("3")
    assert "nan" not in FIGURES[number].note(number, flown)


def test_four_panels_show_the_flight(flown: Mapping[str, Flights]) -> None:
    """The lines are the recorded values: magnitudes are the norms of the components beside them."""
    drawn = drawings.initialization(flown, "0.5")
    errors, magnitudes, _, _ = drawn.axes
    components = np.array([line.get_ydata() for line in errors.lines])
    (magnitude,) = magnitudes.lines
    # single precision of a position of 2000 m
    np.testing.assert_allclose(np.linalg.norm(components, axis=0), magnitude.get_ydata(), atol=1e-3)


# The page and the files.


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory, flown: dict[str, Flights]) -> Path:
    """All files of those flights."""
    out = tmp_path_factory.mktemp("thesis") / "deep" / "folder"
    write_thesis.ThesisOptions(episodes=2, step_s=COARSE_S, periods=2.3, models=False)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(write_thesis.parallel, "run_with_bar", lambda wanted, workers: flown)
        patch.setattr(claims_table, "tables", lambda flown, options: TABLES)
        page = write_thesis.write_thesis(
            out, write_thesis.ThesisOptions(episodes=2, step_s=COARSE_S, periods=2.3, models=False), "the <command>", 1
        )
    assert page == out / write_thesis.PAGE
    return out


def test_all_files_and_nothing_else(folder: Path) -> None:
    """PNG and SVG of each figure, the page, the claims; no temporaries."""
    images = {f"figure-{number.replace('.', '-')}.{kind}" for number in FIGURES for kind in ("png", "svg")}
    images |= {write_thesis.PAGE, "claims.json"}
    images |= {f"{name}.csv" for name in ("claims", "readings", "noise", "fair")}
    assert {path.name for path in folder.iterdir()} == images
    for path in folder.glob("*.png"):
        assert path.read_bytes().startswith(b"\x89PNG")


def test_page_holds_every_figure_and_loads_nothing(folder: Path) -> None:
    """Each figure's own file stands in the page beside its sentence; no address leads out of it."""
    page = (folder / write_thesis.PAGE).read_text(encoding="utf-8")
    embedded = [base64.b64decode(code) for code in re.findall(r"data:image/svg\+xml;base64,([^\"]+)", page)]
    files = [(folder / f"figure-{number.replace('.', '-')}.svg").read_bytes() for number in FIGURES]
    assert embedded == files
    for figure in FIGURES.values():
        assert figure.title in page
    text = re.sub(r"base64,[^\"]+", "", page)
    assert not re.findall(r"https?:|//\w|@import|<script|<link", text)
    assert "the &lt;command&gt;" in text
    anchors = re.findall(r'href="#([^"]+)"', text)
    assert all(f'id="{anchor}"' in text for anchor in anchors)


def test_claims_come_back_from_their_files(folder: Path) -> None:
    """CSV by pandas and JSON by the standard library give what was written; the page shows it for people."""
    table = pd.read_csv(folder / "claims.csv")
    assert table.loc[0, "sentence"] == CLAIM.sentence
    assert np.isnan(table.loc[0, "high"])
    (entry,) = json.loads((folder / "claims.json").read_text(encoding="utf-8"))
    assert Claim(**entry) == CLAIM
    pd.testing.assert_frame_equal(pd.read_csv(folder / "noise.csv", dtype={"section": str}), TABLES.noise)
    page = (folder / write_thesis.PAGE).read_text(encoding="utf-8")
    for cell in ("a &lt; b &amp; c", "0.123", "–", "k &lt;printed&gt;", "yes", "no"):
        assert f"<td>{cell}</td>" in page
    assert claim_files.to_csv([]).strip() == ",".join(table.columns)
    with pytest.raises(ValueError, match=r"claim 5\.2\.1: verdict must be one of"):
        replace(CLAIM, verdict="maybe")  # type: ignore[arg-type]


def test_sections_without_content_are_left_out() -> None:
    """Neither claims nor model errors are announced where there are none; a model error is shown where there is one."""
    empty = render(Content([]), FACTS)
    assert "Claims" not in empty
    assert "linear models" not in empty
    shown = render(Content([], model_errors=[Picture("", "HCW by size", "", "It grows.", b"<svg/>")]), FACTS)
    assert "What the linear models neglect" in shown
    assert "HCW by size" in shown


def test_the_verdicts_stand_at_the_top(folder: Path) -> None:
    """A table of all verdicts, with the number of each by section, comes before the first figure."""
    page = (folder / write_thesis.PAGE).read_text(encoding="utf-8")
    assert 0 < page.index('id="verdicts"') < page.index('id="figures"') < page.index("data:image")
    top = page[page.index('id="verdicts"') : page.index('id="figures"')]
    assert "a &lt; b &amp; c" in top
    fails = replace(CLAIM, verdict="fails")
    later = replace(CLAIM, section="6.1", verdict="cannot be decided")
    assert verdict_summary([later, CLAIM, fails, CLAIM]) == [
        ("5.2.1", [2, 1, 0]),
        ("6.1", [0, 0, 1]),
        ("all", [2, 1, 1]),
    ]


def test_another_step_than_the_thesis_s_is_said(folder: Path) -> None:
    """On the page and by the options; with the thesis's step there is nothing to say."""
    warning = write_thesis.ThesisOptions(step_s=COARSE_S).step_warning
    assert "30 s instead of the thesis's 1 s" in warning
    page = (folder / write_thesis.PAGE).read_text(encoding="utf-8")
    assert html.escape(warning, quote=False).replace("'", "&#39;") in page
    assert write_thesis.ThesisOptions().step_warning == ""
    assert "instead of the thesis" not in render(Content([]), FACTS)


def test_the_command_warns_of_another_step(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """The warning comes before any flight, on standard error."""

    def stop(jobs: object, workers: int) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(write_thesis.parallel, "run_with_bar", stop)
    for step_s, expected in ((COARSE_S, True), (1.0, False)):
        options = write_thesis.ThesisOptions(episodes=1, step_s=step_s, claims=False, models=False)
        with pytest.raises(KeyboardInterrupt):
            write_thesis.write_thesis(tmp_path, options, "c", 1)
        assert ("verdicts can differ" in capsys.readouterr().err) is expected


def test_a_failure_leaves_the_old_files(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """If the last figure cannot be drawn, nothing in the folder has changed."""
    before = {path.name: path.read_bytes() for path in folder.iterdir()}

    def broken(flown: object) -> None:
        raise RuntimeError("no ink")

    monkeypatch.setitem(FIGURES, "5.27", replace(FIGURES["5.27"], draw=broken))
    monkeypatch.setattr(write_thesis.parallel, "run_with_bar", lambda wanted, workers: {})
    for number in list(FIGURES)[:-1]:
        monkeypatch.delitem(FIGURES, number)
    with pytest.raises(RuntimeError, match="no ink"):
        write_thesis.write_thesis(folder, write_thesis.ThesisOptions(episodes=1), "c", 1)
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


# The command.


def test_command_says_what_is_wrong_in_one_line(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Options out of range are refused before anything is flown; a folder that cannot be written is named."""
    runner = CliRunner()
    for option in ("--episodes", "--step-s", "--processes"):
        assert runner.invoke(app, ["thesis", option, "0"]).exit_code == 2
    blocked = tmp_path / "file"
    blocked.touch()

    def write(out: Path, *rest: object) -> Path:
        out.mkdir(parents=True)
        return out

    monkeypatch.setattr(write_thesis, "write_thesis", write)
    result = runner.invoke(app, ["thesis", "--out", str(blocked / "thesis")])
    assert result.exit_code == 1
    assert result.output.splitlines()[-1] == f"error: {blocked / 'thesis'}: cannot be written: Not a directory"


def test_ctrl_c_ends_all_processes_in_one_line(tmp_path: Path) -> None:
    """An interrupt while two processes fly: code 130, one line, nothing written."""
    out = tmp_path / "thesis"
    command = [sys.executable, "-m", "baselines", "thesis", "--out", str(out), "--episodes", "2", "--processes", "2"]
    with subprocess.Popen(command, cwd=ROOT, stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr is not None
        process.stderr.read(1)  # the progress bar is there
        process.send_signal(signal.SIGTERM)
        rest = process.stderr.read()
    assert process.returncode == 130
    assert rest.endswith("interrupted, no report written\n")
    assert "Traceback" not in rest
    assert not out.exists()
