"""Random numbers: each row draws from a stream of its own.

A stream is xoshiro128++ (Blackman & Vigna 2021, "Scrambled linear pseudorandom number generators"), four 32-bit words.
At the start of an episode they are set by Threefry-2x64 with 13 rounds (Salmon et al. 2011, "Parallel random numbers:
as easy as 1, 2, 3") from the row's 128-bit key and the number of the episode. So rows share nothing, and what one draws
never moves another's. Normals come by Box & Muller (1958), in single precision.
"""

from typing import Final

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.jit import inline_scalar
from formation_env.numerics.single_precision import cos_sin, log

Words = tuple[np.uint32, np.uint32, np.uint32, np.uint32]

_PARITY: Final = np.uint64(0x1BD11BDAA9FC1A22)
_64: Final = np.uint64(64)
_32: Final = np.uint32(32)
_ONE: Final = np.uint32(1)
_HALF: Final = np.float32(0.5)
_MINUS_TWO: Final = np.float32(-2)
_2_TO_MINUS_24: Final = np.float32(2.0**-24)
_2_TO_MINUS_31: Final = np.float32(2.0**-31)
_ANGLE: Final = np.float32(np.pi / 2 / 2.0**31)


def stream_key(generator: np.random.Generator) -> NDArray[np.uint64]:
    """Draw the key (2,) of a new stream: the generator's next words, as they are."""
    return generator.bit_generator.random_raw(2)


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
def _rotate(x: np.uint32, left: int) -> np.uint32:
    return np.uint32(np.uint32(x << np.uint32(left)) | np.uint32(x >> np.uint32(_32 - np.uint32(left))))


@inline_scalar
def next_word(s0: np.uint32, s1: np.uint32, s2: np.uint32, s3: np.uint32) -> tuple[np.uint32, Words]:
    """The stream's next random word, and its state behind it."""
    word = np.uint32(_rotate(np.uint32(s0 + s3), 7) + s0)
    shifted = np.uint32(s1 << np.uint32(9))
    s2, s3 = np.uint32(s2 ^ s0), np.uint32(s3 ^ s1)
    s1, s0 = np.uint32(s1 ^ s2), np.uint32(s0 ^ s3)
    return word, (s0, s1, np.uint32(s2 ^ shifted), _rotate(s3, 11))


@inline_scalar
def uniform(word: np.uint32) -> np.float32:
    """A number in [0, 1), a multiple of 2^-24."""
    return np.float32(np.int32(word >> np.uint32(8))) * _2_TO_MINUS_24


@inline_scalar
def normal_pair(a: np.uint32, b: np.uint32) -> tuple[np.float32, np.float32]:
    """Two independent standard normals from two random words; the tails end at 6.7 sigma."""
    radius = np.sqrt(_MINUS_TWO * log((np.float32(np.int32(a >> _ONE)) + _HALF) * _2_TO_MINUS_31))
    # The angle is in the right half-plane; the bit that the radius leaves mirrors half of the points into the left.
    cosine, sine = cos_sin(np.float32(np.int32(b)) * _ANGLE)
    mirrored = radius * cosine
    return -mirrored if (a & _ONE) != 0 else mirrored, radius * sine
