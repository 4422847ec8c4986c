"""The stages run as vector instructions: LLVM itself tells which loops it vectorised.

This file, run as a program, compiles every stage and lets LLVM write its remarks to stderr; the tests read them.
"""

import importlib
import inspect
import os
import pkgutil
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType
from typing import Any, Final

import llvmlite.binding as llvm
import numba
import pytest
from numba import types

from formation_env.kernel import stages
from formation_env.kernel.stages import (
    closest_approach,
    closest_coast,
    group,
    inter_satellite_link,
    kalman_filter,
    link,
    memory,
    neighbour_lines,
    neighbours,
    noise,
    nonlinear_motion,
    observe,
    plan,
    reward,
    sensor,
    start,
    thruster,
    true_motion,
)
from formation_env.kernel.stages.inter_satellite_link import LinkSettings

INT, BOOL = types.intp, types.boolean
FIELDS, FIELDS32, STREAM = types.float64[::1], types.float32[::1], types.uint32[::1]
TABLE, TABLE32 = types.float64[:, ::1], types.float32[:, ::1]
FLAGS, INTEGERS = types.boolean[:, ::1], types.int64[:, ::1]
PLANS, VIEWS = types.float64[:, :, ::1], types.float32[:, :, ::1]

LINK: Final = types.NamedUniTuple(types.float64, len(LinkSettings._fields), LinkSettings)
LANE_LIST, LANE_TABLE = types.intp[::1], types.intp[:, ::1]
MOTION: Final = (FIELDS, FIELDS, TABLE, INT, INT)
FILTER: Final = (FIELDS, FIELDS, TABLE, INT)
SENSE: Final = (FIELDS, FIELDS, FIELDS32, TABLE, INT)
STAGES: Final = {
    plan.advance: ((FIELDS, INT), 1),
    plan.broadcast_line: ((FIELDS, INT, INT, FIELDS, INT, INT), 1),
    plan.read_plan: ((FIELDS, FIELDS, FIELDS32, PLANS, VIEWS, INT, INT), 15),
    noise.draw: ((STREAM, FIELDS32, INT), 2),
    thruster.thrust_ideal: ((TABLE32, INT, FIELDS, FIELDS32, TABLE, INT), 1),
    link.change: ((FIELDS, FIELDS32, TABLE, INT), 1),
    link.receive: (FILTER, 1),
    true_motion.push: ((FIELDS, FIELDS32, TABLE, INT), 3),
    true_motion.fly_constant: (MOTION, 1),
    true_motion.fly_varying: (MOTION, 1),
    nonlinear_motion.fly_near: (MOTION, 25),
    nonlinear_motion.fly_far: (MOTION, 25),
    kalman_filter.predict_constant: (FILTER, 2),
    kalman_filter.predict_varying: (FILTER, 2),
    sensor.sense_position: (SENSE, 3),
    sensor.sense_position_and_velocity: (SENSE, 6),
    kalman_filter.innovate: ((FIELDS, FIELDS, INT), 6),
    kalman_filter.measure_position: (FILTER, 1),
    kalman_filter.measure_position_and_velocity: (FILTER, 2),
    closest_approach.remember: ((FIELDS, FIELDS, INT), 1),
    closest_approach.approach_leader: (FILTER, 2),
    closest_approach.approach: ((*(FIELDS,) * 6, types.float64, INT), 2),
    reward.check_distance: (FILTER, 1),
    reward.check_safety: (FILTER, 1),
    inter_satellite_link.begin: ((FIELDS, INT, STREAM, LINK, INT), 2),
    inter_satellite_link.change: ((FIELDS, INT, STREAM, LINK, INT), 1),
    inter_satellite_link.hear: ((FIELDS, INT, FIELDS, FIELDS, LINK, FIELDS, INT), 2),
    closest_approach.end_approach: ((FIELDS, INT), 2),
    closest_coast.closest_coast: ((*(FIELDS32,) * 3, INT), 1),
    neighbours.scale: ((FIELDS, FIELDS, FIELDS32, FIELDS32, INT), 3),
    neighbours._differences: ((*(FIELDS32,) * 4, INT), 3),
    neighbours.meet: ((FIELDS32, FIELDS32, FIELDS32, FIELDS, FIELDS32, FIELDS32, INT), 4),
    neighbour_lines.rank: ((TABLE32, LANE_TABLE, INT), 2),
    neighbour_lines.collect: ((TABLE32, LANE_TABLE, FIELDS32, LANE_LIST, INT), 1),
    group.end_together: ((TABLE, INT), 1),
    memory.write_safety: ((FIELDS, TABLE, INT, INT), 1),
    reward.score: ((FIELDS, FIELDS, TABLE, INT), 2),
    observe.observe: ((FIELDS, FIELDS, FIELDS32, INT), 8),
    start.begin: ((FIELDS, FIELDS32, BOOL, TABLE, INT), 5),
    memory.write_results: ((FIELDS, FIELDS, TABLE, FLAGS, INTEGERS, INT, INT, BOOL), 8),
}
"""Each stage that loops over the rows of a tile: its signature, and how many of its loops are vectorised with AVX2.

Loops of the functions that a stage calls are its own. LLVM unrolls many loops over fields first, so the loop over rows
inside counts once for each field.
"""
OVER_ROWS: Final = "range(min(n, LANES))"
MODULES: Final = [
    importlib.import_module(f"{stages.__name__}.{module.name}") for module in pkgutil.iter_modules(stages.__path__)
]


def probe(numbers: Any) -> None:
    """A loop that every compiler of a processor with vectors turns into vector instructions."""
    for i in range(len(numbers)):
        numbers[i] += 1.0


def compile_stages() -> None:
    """Compile the probe and the stages; LLVM's remarks follow each name on stderr."""
    llvm.set_option("", "--pass-remarks=loop-vectorize")
    functions = {numba.njit(error_model="numpy")(probe): (FIELDS,)} | {each: own for each, (own, _) in STAGES.items()}
    for function, signature in functions.items():
        print(f"stage: {name_of(function)}", file=sys.stderr, flush=True)
        called(function).compile((types.StarArgTuple(signature),))


def called(function: Any) -> Any:
    """A compiled function that calls a stage, which is code for its callers only."""

    def call(*arguments: Any) -> Any:
        return function(*arguments)

    return numba.njit(error_model="numpy")(call)


def name_of(function: Any) -> str:
    """Name of a compiled function behind that of its module."""
    return f"{function.py_func.__module__.rpartition('.')[2]}.{function.py_func.__name__}"


@pytest.fixture(scope="module")
def widths() -> dict[str, list[int]]:
    """Rows that each vectorised loop of a stage takes at once."""
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[3])}
    command = [sys.executable, __file__]
    found = subprocess.run(command, env=environment, capture_output=True, text=True, check=True, timeout=300)
    parts = re.split(r"^stage: (\S+)$", found.stderr, flags=re.MULTILINE)[1:]
    remarks = {
        name: [int(width) for width in re.findall(r"vectorized loop \(vectorization width: (\d+)", text)]
        for name, text in zip(parts[::2], parts[1::2], strict=True)
    }
    if not remarks.pop(next(iter(remarks))):
        pytest.skip("LLVM gives no remarks here, or this processor has no vectors")
    return remarks


def has_avx2() -> bool:
    """Whether numba compiles for AVX2, that is four float64 at once."""
    target: Any = numba.core.registry.cpu_target.target_context.codegen()
    return "+avx2" in str(target._get_host_cpu_features()).split(",")


def test_every_stage_is_vectorised(widths: dict[str, list[int]]) -> None:
    """A loop that became scalar is missing: its rows take two to eight times as long, with the same results."""
    width = 4 if has_avx2() else 2
    scalar = {}
    for stage, (_, loops) in STAGES.items():
        vectorised = sum(each >= width for each in widths[name_of(stage)])
        if vectorised < (loops if has_avx2() else 1):  # without AVX2 some small loops are not worth it to LLVM
            scalar[name_of(stage)] = f"{vectorised} of {loops} loops"
    assert scalar == {}


@pytest.mark.parametrize("module", MODULES, ids=lambda module: module.__name__.rpartition(".")[2])
def test_no_stage_is_left_out(module: ModuleType) -> None:
    """Every public function that loops over a tile's rows is in the table above; private ones are compiled with it."""
    looping = [
        name
        for name, function in vars(module).items()
        if loops_over_rows(function) and function.__module__ == module.__name__ and not name.startswith("_")
    ]
    assert set(looping) <= {stage.py_func.__name__ for stage in STAGES}


def loops_over_rows(function: Callable[..., Any]) -> bool:
    """Whether this is a compiled function with a loop over the rows of a tile."""
    return hasattr(function, "py_func") and OVER_ROWS in inspect.getsource(function.py_func)


if __name__ == "__main__":
    compile_stages()
