"""Disjoint ranges of episode seeds: no policy is tested on seeds that it was trained or tuned on."""

from typing import Final, Literal

from formation_env.settings import ConfigError

Split = Literal["test", "validation", "tuning", "training"]

_SIZE: Final = 1_000_000
_ORDER: Final[tuple[Split, ...]] = ("test", "validation", "tuning", "training")


def seeds(split: Split, count: int) -> range:
    """The first seeds of a split.

    Args:
        split: `test` for reports, `validation` to choose among trained models, `tuning` for controllers' settings,
            `training` for learning.
        count: number of seeds.

    Raises:
        ValueError: the split has fewer seeds.
    """
    if not 1 <= count <= _SIZE:
        raise ConfigError(f"seeds: count must be between 1 and {_SIZE}, got {count}")
    first = _ORDER.index(split) * _SIZE
    return range(first, first + count)
