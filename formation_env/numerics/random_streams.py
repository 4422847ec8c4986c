"""Counter-based random numbers.

The generator is Threefry-2x64 with 13 rounds (Salmon et al. 2011, "Parallel random numbers: as easy as 1, 2, 3", the
fewest that pass all tests there); normals come from it by Box & Muller (1958).

A stream is a 128-bit key. Its numbers depend on (key, episode, step, block) alone, so rows need no shared state, and
what one row draws never moves another's.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.fastmath import cos_sin_turns, from_integer, log
from formation_env.numerics.jit import inline_scalar

BLOCKS_PER_STEP: Final = 8
"""Counter values of one step; each gives four uniforms."""

_PARITY: Final = np.uint64(0x1BD11BDAA9FC1A22)
_LOW: Final = np.uint64(0xFFFFFFFF)
_32: Final = np.uint64(32)
_64: Final = np.uint64(64)
_2_TO_MINUS_32: Final = 2.0**-32


def stream_key(generator: np.random.Generator) -> NDArray[np.uint64]:
    """Draw the key (2,) of a new stream."""
    return generator.integers(0, 2**64, size=2, dtype=np.uint64)


@inline_scalar
def _mix(x0: np.uint64, x1: np.uint64, rotation: int) -> tuple[np.uint64, np.uint64]:
    """One round: add, rotate, exclusive or."""
    x0 = x0 + x1
    left = np.uint64(rotation)
    x1 = (x1 << left) | (x1 >> (_64 - left))
    return x0, x1 ^ x0


@inline_scalar
def _even_rounds(x0: np.uint64, x1: np.uint64) -> tuple[np.uint64, np.uint64]:
    x0, x1 = _mix(x0, x1, 16)
    x0, x1 = _mix(x0, x1, 42)
    x0, x1 = _mix(x0, x1, 12)
    return _mix(x0, x1, 31)


@inline_scalar
def _odd_rounds(x0: np.uint64, x1: np.uint64) -> tuple[np.uint64, np.uint64]:
    x0, x1 = _mix(x0, x1, 16)
    x0, x1 = _mix(x0, x1, 32)
    x0, x1 = _mix(x0, x1, 24)
    return _mix(x0, x1, 21)


@inline_scalar
def threefry2x64(
    key0: np.uint64, key1: np.uint64, counter0: np.uint64, counter1: np.uint64
) -> tuple[np.uint64, np.uint64]:
    """Two random 64-bit words from a 128-bit key and a 128-bit counter."""
    key2 = _PARITY ^ key0 ^ key1
    x0, x1 = counter0 + key0, counter1 + key1
    x0, x1 = _even_rounds(x0, x1)
    x0, x1 = x0 + key1, x1 + key2 + np.uint64(1)
    x0, x1 = _odd_rounds(x0, x1)
    x0, x1 = x0 + key2, x1 + key0 + np.uint64(2)
    x0, x1 = _even_rounds(x0, x1)
    x0, x1 = x0 + key0, x1 + key1 + np.uint64(3)
    return _mix(x0, x1, 16)


@inline_scalar
def uniform_pair(word: np.uint64) -> tuple[float, float]:
    """Two numbers in (0, 1) from 64 random bits, at the centres of 2^32 equal cells."""
    return (
        (from_integer(word >> _32) + 0.5) * _2_TO_MINUS_32,
        (from_integer(word & _LOW) + 0.5) * _2_TO_MINUS_32,
    )


@inline_scalar
def normal_pair(u0: float, u1: float) -> tuple[float, float]:
    """Two independent standard normals from two uniforms in (0, 1); the tails end at 6.7 sigma."""
    radius = np.sqrt(-2.0 * log(u0))
    cosine, sine = cos_sin_turns(u1)
    return radius * cosine, radius * sine
