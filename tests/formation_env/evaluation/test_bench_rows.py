"""Time and memory of a row: tables and plot, no value of a time."""

from pathlib import Path

import numpy as np
import pytest

from formation_env.evaluation.bench_rows import bytes_per_row, plot_time_per_row, time_per_row
from formation_env.kernel.tile import STATE_SIZE
from formation_env.numerics.jit import LANES
from formation_env.task.loading import load_scenario
from formation_env.task.observation import SIZE


def test_times_and_their_plot(tmp_path: Path) -> None:
    """A line for each size with both environments; the plot is a PNG."""
    times = time_per_row("keeping", rows=(1, 3), row_steps=6)
    assert times["rows"].tolist() == [1, 3]
    assert (times[["env_ns", "cartpole_ns"]] > 0).all(axis=None)
    plot_time_per_row(times, "keeping", tmp_path / "rows.png")
    assert (tmp_path / "rows.png").read_bytes().startswith(b"\x89PNG")


def test_memory_is_that_of_the_arrays() -> None:
    """Full tiles: float64 of state, four words of a random stream, three keys, float32 observations, by hand."""
    held = bytes_per_row(load_scenario("keeping"), 2 * LANES).set_index("what")["bytes_per_row"]
    assert held["state"] == 8 * STATE_SIZE / LANES
    assert held["random streams"] == 4 * 4
    assert held["keys"] == 3 * 8
    assert held["observations"] == 4 * SIZE
    assert held["total"] == pytest.approx(held.drop("total").sum())


def test_a_tile_that_is_not_full_has_its_whole_memory() -> None:
    """One row holds the state of all lanes."""
    one, full = (bytes_per_row(load_scenario("keeping"), rows).set_index("what") for rows in (1, LANES))
    np.testing.assert_array_equal(one.loc["state"], LANES * full.loc["state"])
