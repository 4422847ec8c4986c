"""The compiled program: what it is made of, and how its settings get into it."""

import ast
import dataclasses
import itertools
import shutil
from collections.abc import Iterator
from pathlib import Path

import numba
import numpy as np
import pytest
from env_helpers import assert_same, random_actions

import formation_env
from formation_env import FormationVectorEnv, load_scenario, scenario_names
from formation_env.dynamics import NONLINEAR
from formation_env.kernel import packing, program, tile, unpacking
from formation_env.kernel.simulation import Simulation
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.task.observation import SIZE

PACKAGE = Path(formation_env.__file__).parent
TREES = {
    path.relative_to(PACKAGE).with_suffix("").as_posix(): ast.parse(path.read_text(encoding="utf-8"))
    for path in PACKAGE.rglob("*.py")
}


@numba.njit
def unpacked(settings):  # type: ignore[no-untyped-def]
    """All tuples that `unpack` gives, in the order in which `pack` writes them."""
    return unpacking.unpack(settings)


@pytest.mark.parametrize("name", scenario_names())
def test_unpack_reads_what_pack_wrote(name: str) -> None:
    """The same numbers in the same named places, for every element."""
    filter_model = KalmanFilter(dynamics="hcw", sigma_pos_m=3.0, process_noise_m_s2=1e-4)
    scenario = dataclasses.replace(load_scenario(name), filter=filter_model)
    settings = packing.pack(scenario)
    groups = unpacked(settings)
    flat = np.concatenate([np.ravel(values) for group in groups for values in group])
    np.testing.assert_array_equal(flat, settings)
    truth, believed, _, sensor, _, scalars = groups
    models = [(believed, scenario.filter_dynamics())]
    if scenario.dynamics != NONLINEAR:
        models.append((truth, scenario.true_dynamics()))
    for model, expected in models:
        Phi, Gamma = np.zeros((6, 6)), np.zeros((6, 3))
        Phi[np.ix_([0, 1, 3, 4], [0, 1, 3, 4])] = np.reshape(model.Phi_in_plane, (4, 4))
        Phi[np.ix_([2, 5], [2, 5])] = np.reshape(model.Phi_cross_track, (2, 2))
        Gamma[np.ix_([0, 1, 3, 4], [0, 1])] = np.reshape(model.Gamma_in_plane, (4, 2))
        Gamma[[2, 5], 2] = model.Gamma_cross_track
        np.testing.assert_array_equal(Phi, expected.Phi)
        np.testing.assert_array_equal(Gamma, expected.Gamma)
    assert sensor.variances == (9.0, scenario.sensor.sigma_vel_m_s**2)
    assert scalars._asdict() == packing._scalars(scenario)._asdict()
    assert scalars.dt_s == scenario.dt_s
    assert scalars.num_steps == scenario.num_steps
    assert scalars.max_accel == scenario.spacecraft.max_accel_m_s2


def test_fields_of_the_tile_do_not_overlap() -> None:
    """Each field has its own lanes, and the results are those that the environments read."""
    lanes = formation_env.numerics.jit.LANES
    sizes = {"TRUTH": 6, "ESTIMATE": 6, "P_IN_PLANE": 10, "P_CROSS_TRACK": 3, "KEY": 2, "THRUST": 3, "ACTION": 3}
    spans = [
        (value, value + sizes.get(name, 1) * lanes)
        for name, value in vars(tile).items()
        if name.isupper()
        and name not in ("LANES", "STATE_FIELDS", "NUM_RESULTS", "TILE_FIELDS", "RESULTS", "FIRST_TOTAL", "NUM_TOTALS")
        and isinstance(value, int)
    ]
    spans.sort()
    assert all(end <= start for (_, end), (start, _) in itertools.pairwise(spans))
    named = [
        *tile.STATES.values(),
        *(span._replace(first=span.first + tile.RESULTS // lanes) for span in tile.STEP_RESULTS.values()),
    ]
    assert {(first * lanes, (first + size) * lanes) for first, size in named} <= set(spans)


def test_rows_of_the_padding_do_not_show() -> None:
    """A batch that does not fill its last tile has as many rows as were asked for, everywhere."""
    env = FormationVectorEnv(33)
    env.reset(seed=0)
    outputs = env.step(random_actions(0, 33))
    assert [len(output) for output in outputs[:4]] == [33] * 4
    assert all(len(value) == 33 for value in outputs[4].values())


def imported_modules(tree: ast.AST) -> dict[str, str]:
    """Name in the file: module of this package that it comes from."""
    names: dict[str, str] = {}
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.startswith("formation_env"):
            folder = node.module.removeprefix("formation_env").lstrip(".").replace(".", "/")
            for alias in node.names:
                inner = f"{folder}/{alias.name}".lstrip("/")
                names[alias.asname or alias.name] = inner if inner in TREES else folder
    return names


def is_compiled(function: ast.FunctionDef) -> bool:
    """Whether numba compiles a function, by its decorator."""
    names = {node.id for item in function.decorator_list for node in ast.walk(item) if isinstance(node, ast.Name)}
    return bool(names & {"inline_scalar", "tile_function", "python_and_compiled", "compiled", "numba"})


def names_at_work(tree: ast.Module) -> Iterator[str]:
    """Names that compiled functions use in their bodies, and those that module constants are made of."""
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef) and is_compiled(node):
            used = [inner for statement in node.body for inner in ast.walk(statement)]
        elif isinstance(node, ast.Assign | ast.AnnAssign) and node.value is not None and node in tree.body:
            used = list(ast.walk(node.value))
        else:
            continue
        yield from (inner.id for inner in used if isinstance(inner, ast.Name))


def test_the_hash_covers_all_that_is_compiled() -> None:
    """A cached program that does not see a change would fly yesterday's physics.

    Covered must be: every file with a compiled function, and every file of which such a file uses a name in compiled
    functions or in its constants.
    """
    covered = {
        str(path.relative_to(PACKAGE).with_suffix(""))
        for pattern in program.COMPILED_SOURCES
        for path in PACKAGE.glob(pattern)
    }
    with_functions = {
        name
        for name, tree in TREES.items()
        if any(isinstance(node, ast.FunctionDef) and is_compiled(node) for node in ast.walk(tree))
    }
    assert {
        "kernel/stages/observe",
        "kernel/stages/noise",
        "kernel/kalman",
        "numerics/random_streams",
        "numerics/fastmath",
    } <= with_functions
    assert with_functions <= covered
    for name in with_functions:
        imports = imported_modules(TREES[name])
        needed = {imports[used] for used in names_at_work(TREES[name]) if used in imports}
        assert needed <= covered, f"{name} uses {needed - covered}"
    assert covered <= set(TREES)


SOURCES = (
    "kernel/tile",
    "kernel/stages/true_motion",
    "numerics/jit",
    "orbital/constants",
    "orbital/accelerations",
    "dynamics/nonlinear",
    "task/observation",
    "task/schedule",
)


@pytest.mark.parametrize("module", SOURCES)
def test_the_hash_changes_with_each_source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, module: str) -> None:
    """One changed character in any of the files gives another key of the cache."""
    copy = tmp_path / "formation_env"
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__", "*.nb?"))
    monkeypatch.setattr(program, "__file__", str(copy / "kernel" / "program.py"))
    before = program._source_hash()
    path = copy / f"{module}.py"
    path.write_text(path.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    assert program._source_hash() != before


def test_the_program_carries_the_hash_of_its_sources() -> None:
    """The key is what the sources on the disk give: an equal checkout finds the cache, another does not."""
    assert program._source_hash() == program._source_hash()
    assert 0 <= program._source_hash() < 2**63


@pytest.mark.parametrize("varied", [False, True])
def test_programs_close_over_numbers_only(varied: bool) -> None:
    """numba's cache takes what a function closes over into its key; a function there is another in each process."""
    for function in program.program(packing.TIME_INVARIANT, packing.TIME_INVARIANT, varied):
        cells = [cell.cell_contents for cell in function.py_func.__closure__]
        assert all(type(cell) in (int, bool) for cell in cells)


def test_reset_writes_the_rows_asked_for_only() -> None:
    """Rows are reset in groups of a tile's width; nothing but those asked for is written, nor past the array's end."""
    simulation = Simulation(load_scenario("keeping"), 40)
    guarded = np.full((44, SIZE), 7.0, np.float32)
    observations = guarded[:40]
    rows = np.array([0, 3, 31, 32, 39])
    for row in range(40):
        simulation.seed(row, np.random.default_rng(row))
    simulation.reset(rows, observations)
    others = np.setdiff1d(np.arange(44), rows)
    assert (guarded[others] == 7.0).all()
    assert np.isfinite(observations[rows]).all()
    assert not (observations[rows] == 7.0).any()


def test_read_takes_names_and_rows() -> None:
    """Results and states alike, of any rows in any order, as copies; a wrong name lists the right ones."""
    env = FormationVectorEnv(70)
    env.reset(seed=0)
    infos = env.step(random_actions(0, 70))[4]
    simulation, rows = env.simulation, np.array([69, 0, 33])
    for name, key in (("position_error", "position_error_m"), ("thrust", "accel_m_s2"), ("true_state", "true_state")):
        np.testing.assert_array_equal(simulation.read(name), infos[key])
        np.testing.assert_array_equal(simulation.read(name, rows), infos[key][rows])
        simulation.read(name)[...] = np.nan
        np.testing.assert_array_equal(simulation.read(name), infos[key])
    assert simulation.read("measured", rows, bool).dtype == bool
    assert simulation.read("covariance_in_plane", rows).shape == (3, 10)
    assert (simulation.read("step") == 1).all()
    with pytest.raises(KeyError, match=r"unknown name 'positon'; known: thrust, .*true_state"):
        simulation.read("positon")


def test_nobody_outside_the_kernel_knows_its_offsets() -> None:
    """The environments and all that is built on them read by name."""
    repository = PACKAGE.parent
    paths = [
        path for folder in ("formation_env", "baselines", "agents") for path in (repository / folder).rglob("*.py")
    ]
    outside = [path for path in paths if "kernel" not in path.parts and path.name != "jit.py"]
    assert len(outside) > 100
    text = {path: path.read_text(encoding="utf-8") for path in outside}
    assert not [path for path, source in text.items() if "LANES" in source or "kernel import tile" in source]


def test_drawing_again_changes_no_flight() -> None:
    """The noises of a step are read, and the flight goes on as if they were not; twice the same."""
    env, untouched = FormationVectorEnv(40), FormationVectorEnv(40)
    env.reset(seed=0)
    untouched.reset(seed=0)
    for action in random_actions(1, 3, 40):
        assert_same(env.step(action), untouched.step(action))
        for one, other in zip(env.simulation.step_noises(), env.simulation.step_noises(), strict=True):
            np.testing.assert_array_equal(one, other)
        some = env.simulation.step_noises(np.array([39, 2]))
        np.testing.assert_array_equal(some.measurement, env.simulation.step_noises().measurement[[39, 2]])
