"""Dropout models: the statistics of their chains, and their windows."""

from decimal import Decimal

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import binom

from formation_env.dropout import DROPOUTS, Bernoulli, Dropout, GilbertElliott, NoDropout, Window, Windows
from formation_env.dropout.base import LinkChain
from formation_env.orbital.orbit import Orbit

ORBIT = Orbit()
PERIOD_S = 5801.2
DT_S = 30.0
NUM_LINKS, NUM_STEPS = 2000, 300
MODELS = [NoDropout(), Bernoulli(loss_probability=0.3), GilbertElliott(), GilbertElliott(mean_outage_s=90.0)]


def in_band(count: int, trials: int, probability: float) -> bool:
    """Whether a count lies in the middle 99.99 % of its binomial distribution."""
    return bool(binom.ppf(5e-5, trials, probability) <= count <= binom.isf(5e-5, trials, probability))


def simulate(chain: LinkChain, seed: int) -> NDArray[np.bool_]:
    """Whether each of many links is down at each step (steps, links), from the chain's definition alone."""
    uniforms = np.random.default_rng(seed).random((NUM_STEPS, NUM_LINKS))
    down = np.empty(uniforms.shape, bool)
    down[0] = uniforms[0] < chain.stationary_loss
    for step in range(1, NUM_STEPS):
        down[step] = np.where(down[step - 1], uniforms[step] >= chain.recover, uniforms[step] < chain.fail)
    return down


@pytest.mark.parametrize("model", MODELS)
def test_stationary_loss_is_the_eigenvector(model: Dropout) -> None:
    """The long-run shares are the left eigenvector, to eigenvalue 1, of the transition matrix."""
    chain = model.chain(DT_S, ORBIT)
    transitions = np.array([[1 - chain.fail, chain.fail], [chain.recover, 1 - chain.recover]])
    values, vectors = np.linalg.eig(transitions.T)
    shares = vectors[:, np.argmax(values)]
    assert chain.stationary_loss == pytest.approx(shares[1] / shares.sum(), abs=1e-12)


@pytest.mark.parametrize("seed", [1, 2])
def test_bernoulli_loses_its_share_independently(seed: int) -> None:
    """The loss rate is the probability asked for, after a loss as after none."""
    down = simulate(Bernoulli(loss_probability=0.3).chain(DT_S, ORBIT), seed)
    assert in_band(down.sum(), down.size, 0.3)
    after_loss = down[1:][down[:-1]]
    assert in_band(after_loss.sum(), after_loss.size, 0.3)


@pytest.mark.parametrize("seed", [1, 2])
def test_gilbert_elliott_has_the_mean_lengths_asked_for(seed: int) -> None:
    """Outages of 600 s and open spells of half a period, both geometric: each step ends one with dt / mean.

    So are the losses, which are 600 s / (600 s + T/2) at any step of an ensemble that starts stationary.
    """
    model = GilbertElliott(mean_outage_s=600.0, mean_uptime_orbits=0.5)
    down = simulate(model.chain(DT_S, ORBIT), seed)
    before, after = down[:-1], down[1:]
    assert in_band((before & ~after).sum(), before.sum(), DT_S / 600.0)
    assert in_band((~before & after).sum(), (~before).sum(), DT_S / (0.5 * PERIOD_S))
    share = 600.0 / (600.0 + 0.5 * PERIOD_S)
    assert in_band(down[0].sum(), NUM_LINKS, share)
    assert in_band(down[-1].sum(), NUM_LINKS, share)


@pytest.mark.parametrize("dt_s", [1.0, 10.0, 60.0])
def test_gilbert_elliott_means_do_not_depend_on_the_step(dt_s: float) -> None:
    """Mean lengths in seconds and the share lost are those of the settings at every step."""
    chain = GilbertElliott(mean_outage_s=120.0, mean_uptime_orbits=0.1).chain(dt_s, ORBIT)
    assert dt_s / chain.recover == pytest.approx(120.0, rel=1e-12)
    assert dt_s / chain.fail == pytest.approx(0.1 * PERIOD_S, rel=1e-5)
    assert chain.stationary_loss == pytest.approx(120 / (120 + 0.1 * PERIOD_S), rel=1e-5)


@pytest.mark.parametrize(("probability", "share"), [(0.0, 0.0), (1.0, 1.0)])
def test_bernoulli_bounds(probability: float, share: float) -> None:
    """Never and always are allowed, and mean it."""
    chain = Bernoulli(loss_probability=probability).chain(DT_S, ORBIT)
    assert chain.stationary_loss == share
    assert simulate(chain, 1).mean() == share


@pytest.mark.parametrize(
    ("model", "key"),
    [
        (GilbertElliott(mean_outage_s=29.0), "mean_outage_s: a mean of 29 s"),
        (GilbertElliott(mean_uptime_orbits=0.001), "mean_uptime_orbits: a mean of 5.80123 s"),
    ],
)
def test_spells_shorter_than_a_step_are_refused(model: GilbertElliott, key: str) -> None:
    """A geometric length has at least one step; the error names the key."""
    with pytest.raises(ValueError, match=rf"^dropout\.{key} is shorter than the step dt_s = 30 s$"):
        model.chain(DT_S, ORBIT)


def test_a_spell_of_one_step_is_the_shortest() -> None:
    """At mean_outage_s = dt every outage lasts exactly one step."""
    assert GilbertElliott(mean_outage_s=30.0).chain(30.0, ORBIT).recover == 1.0


def test_the_window_of_the_thesis() -> None:
    """Ma 2009, section 5.2.2: no measurement for the first 3000 s, and at 3000 s there is one again."""
    times = np.array([0.0, 1.0, 2999.0, 2999.999, 3000.0, 3001.0, 1e6])
    np.testing.assert_array_equal(Windows().closed(times), [True, True, True, True, False, False, False])


@pytest.mark.parametrize("dt", ["0.1", "0.3", "0.7", "1", "2.3", "4.35", "30", "1e-3"])
def test_windows_on_whole_steps_begin_and_end_at_these_steps(dt: str) -> None:
    """Decimal arithmetic says which step; k dt in binary is often just below it."""
    instants = np.arange(4000) * float(dt)
    for first, count in ((1, 1), (3, 7), (29, 10), (1000, 1234), (2417, 1)):
        start, duration = Decimal(dt) * first, Decimal(dt) * count
        closed = Windows(windows=(Window(start_s=float(start), duration_s=float(duration)),)).closed(instants)
        np.testing.assert_array_equal(np.flatnonzero(closed), np.arange(first, first + count))


def test_windows_join() -> None:
    """A time is closed if any window covers it: from its start, up to but without its end."""
    windows = Windows(windows=(Window(start_s=10.0, duration_s=20.0), Window(start_s=25.0, duration_s=10.0)))
    times = np.array([0.0, 9.9, 10.0, 24.0, 27.0, 30.0, 34.9, 35.0])
    np.testing.assert_array_equal(windows.closed(times), [False, False, True, True, True, True, True, False])
    assert not Windows(windows=()).closed(times).any()


@pytest.mark.parametrize("name", DROPOUTS)
def test_every_model_answers(name: str) -> None:
    """Registered under its own name; probabilities are probabilities; one flag for each time."""
    model = DROPOUTS[name]()
    chain = model.chain(DT_S, ORBIT)
    assert model.kind == name
    assert 0 <= chain.fail <= 1
    assert 0 <= chain.recover <= 1
    assert model.closed(np.arange(4.0)).shape == (4,)


def test_without_dropouts_nothing_is_lost() -> None:
    """Neither a window nor the chain takes a measurement."""
    assert NoDropout().chain(DT_S, ORBIT).stationary_loss == 0
    assert not simulate(NoDropout().chain(DT_S, ORBIT), 1).any()
    assert not NoDropout().closed(np.arange(4.0)).any()
