"""Contracts of the pictures: shape, what changes them, and that they leave the rest of the process alone."""

import copy
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium.wrappers import RecordVideo
from matplotlib import pyplot
from numpy.typing import NDArray

import formation_env
from formation_env import FormationEnv, load_scenario
from formation_env.dropout.windows import Window, Windows
from formation_env.rendering.moment import Moment
from formation_env.rendering.renderer import Renderer
from formation_env.rendering.scene import Scene, _readable

ACTION = np.array([0.5, -0.5, 0.5], np.float32)


def _started(scenario: str = "keeping", steps: int = 0) -> FormationEnv:
    env = FormationEnv(scenario, render_mode="rgb_array")
    env.reset(seed=1)
    for _ in range(steps):
        env.step(ACTION)
        env.render()
    return env


def _outage(start_s: float) -> FormationEnv:
    """The keeping scenario without measurements for two steps from start_s on."""
    dropout = Windows(windows=(Window(start_s=start_s, duration_s=60.0),))
    env = FormationEnv(replace(load_scenario("keeping"), dropout=dropout), render_mode="rgb_array")
    env.reset(seed=1)
    env.step(ACTION)
    return env


def _reddish(frame: NDArray[np.uint8]) -> int:
    """Pixels of the colour of a lost link, Okabe and Ito's vermilion #D55E00."""
    return int((frame == (0xD5, 0x5E, 0x00)).all(axis=-1).sum())


@pytest.mark.parametrize("env_id", sorted(formation_env.ENV_IDS))
def test_frame_is_an_image_that_moves(env_id: str) -> None:
    """Gymnasium's contract of rgb_array: (height, width, 3) uint8, of its own memory; each step has its own frame."""
    env = gymnasium.make(env_id, render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    kept = first.copy()
    env.step(ACTION)
    second = env.render()
    env.close()
    assert first.shape == second.shape == (540, 960, 3)
    assert first.dtype == second.dtype == np.uint8
    assert (first != second).any()
    np.testing.assert_array_equal(first, kept)


def test_same_moment_same_frame() -> None:
    """Drawing reads the flight and changes nothing."""
    env = _started(steps=2)
    np.testing.assert_array_equal(env.render(), env.render())


def test_outage_is_unmistakable() -> None:
    """The frame's border alone is over 2 x (960 + 540) px; with a link, only the legend's line has the colour."""
    lost, linked = _outage(30.0).render(), _outage(3000.0).render()
    assert _reddish(lost) > 3000
    assert _reddish(linked) < 300


def test_reset_clears_the_trail() -> None:
    """A frame after a reset shows nothing of the episode before: it equals that of a new environment."""
    env = _started(steps=5)
    env.reset(seed=7)
    fresh = FormationEnv("keeping", render_mode="rgb_array")
    fresh.reset(seed=7)
    np.testing.assert_array_equal(env.render(), fresh.render())


def test_view_widens_for_a_follower_that_leaves_it() -> None:
    """20 km away the follower is still drawn (its colour is Okabe and Ito's blue), and the next episode fits again."""
    env = _started()
    near = env.render()
    env.reset(seed=1, options={"initial_state": [0, 20e3, 0, 0, 0, 0]})
    main_views = env.render()[100:460, :780]
    assert (main_views == (0x00, 0x72, 0xB2)).all(axis=-1).sum() > 50
    env.reset(seed=1)
    assert env.render().shape == near.shape


@pytest.mark.parametrize("duplicate", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copy_after_render_draws_the_same(duplicate) -> None:  # type: ignore[no-untyped-def]
    """A copy goes on with the flight and its trail."""
    env = _started(steps=3)
    twin = duplicate(env)
    for flown in (env, twin):
        flown.step(ACTION)
    np.testing.assert_array_equal(env.render(), twin.render())


def test_wrong_mode_is_named() -> None:
    """The error names what was given and what there is."""
    with pytest.raises(ValueError, match=r"render_mode: must be one of .*rgb_array.*'ansi'"):
        Renderer(load_scenario("keeping"), "ansi")


def test_images_leave_pyplot_alone() -> None:
    """No figure of the user's is made, closed or made current, and the backend stays."""
    before = pyplot.get_fignums(), pyplot.get_backend()
    _started(steps=1).close()
    assert (pyplot.get_fignums(), pyplot.get_backend()) == before


def test_human_mode_without_display_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    """One line that names the mode, the reason and the way out."""
    monkeypatch.setattr("matplotlib.get_backend", lambda: "agg")
    env = FormationEnv("keeping", render_mode="human")
    with pytest.raises(RuntimeError, match=r"\Arender_mode: 'human' needs a display.*agg.*use 'rgb_array'\Z"):
        env.reset(seed=1)


def test_human_mode_shows_frames_in_a_window(monkeypatch: pytest.MonkeyPatch) -> None:
    """Every reset and step shows a frame; the environment closes its window. (pyplot runs on Agg, named otherwise.)"""
    pyplot.switch_backend("agg")
    monkeypatch.setattr("matplotlib.get_backend", lambda: "tkagg")
    monkeypatch.setattr(pyplot, "show", lambda block: None)
    before = pyplot.get_fignums()
    env = FormationEnv("keeping", render_mode="human")
    env.reset(seed=1)
    (number,) = set(pyplot.get_fignums()) - set(before)
    image = pyplot.figure(number).axes[0].images[0]
    first = np.array(image.get_array())
    env.step(ACTION)
    assert (np.array(image.get_array()) != first).any()
    assert env.render() is None
    env.close()
    assert pyplot.get_fignums() == before


@pytest.mark.filterwarnings("ignore::DeprecationWarning")
def test_record_video_writes_a_film(tmp_path: Path) -> None:
    """Gymnasium's own wrapper gets along with the frames: an mp4 file (its header names the type ftyp)."""
    env = gymnasium.make("FormationKeeping-v0", render_mode="rgb_array")
    env = RecordVideo(env, str(tmp_path / "films"), video_length=4)
    env.reset(seed=1)
    for _ in range(5):
        env.step(ACTION)
    env.close()
    (film,) = tmp_path.glob("films/*.mp4")
    assert film.read_bytes()[4:8] == b"ftyp"


def test_the_trail_holds_every_step() -> None:
    """A frame at the end of a flight equals that of a flight in which every step was drawn."""
    drawn, once = _started(steps=7), FormationEnv("keeping", render_mode="rgb_array")
    once.reset(seed=1)
    for _ in range(7):
        once.step(ACTION)
    np.testing.assert_array_equal(once.render(), drawn.render())


def test_steps_record_nothing_without_a_render_mode() -> None:
    """Who does not draw does not pay."""
    env = FormationEnv("keeping")
    env.reset(seed=1)
    assert env._trail is None


@pytest.mark.parametrize("backend", ["inline", "module://matplotlib_inline.backend_inline"])
def test_human_mode_in_a_notebook_says_so(monkeypatch: pytest.MonkeyPatch, backend: str) -> None:
    """The inline backend shows a figure once and closes it: refused, with the way out."""
    monkeypatch.setattr("matplotlib.get_backend", lambda: backend)
    with pytest.raises(
        RuntimeError, match=r"\Arender_mode: 'human' needs a display.*still pictures only; use 'rgb_array'"
    ):
        FormationEnv("keeping", render_mode="human").reset(seed=1)


@pytest.mark.parametrize(
    ("value", "decimals", "text"),
    [
        (0.0, 2, "0.00"),
        (0.00321, 1, "0.0032"),
        (0.96, 1, "0.96"),
        (12.34, 1, "12.3"),
        (0.0457, 2, "0.046"),
        (0.457, 2, "0.46"),
        (4.5e-7, 3, "4.5e-07"),
        (1.2346, 3, "1.235"),
    ],
)
def test_small_numbers_keep_two_digits(value: float, decimals: int, text: str) -> None:
    """A good sensor's sigma and a weak thruster's thrust are not shown as zero."""
    assert _readable(value, decimals) == text


def test_a_frame_of_good_sensors_and_weak_thrusters_shows_their_numbers() -> None:
    """No number of the header but an exact zero is shown as zero."""
    scenario = load_scenario("keeping")
    scene = Scene(replace(scenario, spacecraft=replace(scenario.spacecraft, max_accel_m_s2=1e-6)))
    moment = Moment(
        step=3,
        truth=np.zeros(3),
        estimate=np.zeros(3),
        covariance=np.diag([1e-6, 1e-6, 1e-6]),
        thrust=np.array([1.0, 0, 0]),
        measured=True,
        age_s=0.0,
        position_error_m=0.002,
        delta_v_m_s=3e-5,
    )
    assert scene._values(moment)[3:] == ["0.002 m", "0.001 m", "0.001 mm/s²", "3e-05 m/s"]


def test_matplotlib_waits_for_the_first_picture() -> None:
    """Who does not draw does not pay for matplotlib."""
    code = "import sys, formation_env; sys.exit('matplotlib' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], check=True, timeout=120)
