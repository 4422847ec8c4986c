"""Sources of `evaluate` that are missing: said in one line that names the file."""

from pathlib import Path

import pytest

from agents.results.evaluate import choose
from formation_env import ConfigError


@pytest.mark.parametrize("name", ["none.zip", "none.safetensors", "none"])
@pytest.mark.parametrize("env", [None, "keeping"])
def test_a_missing_source_is_said_to_be_missing(name: str, env: str | None, tmp_path: Path) -> None:
    """Whatever its ending, and before anything else is asked of it."""
    with pytest.raises(ConfigError, match=rf"{name}: cannot be read: No such file"):
        choose(tmp_path / name, env, allow_pickle=False, throttle_power=None)
