"""The random numbers of the rows: published vectors, and the distributions that the simulation needs.

Keys are fixed, so every test gives the same p-value on each run; P_LOW is what chance alone would fall below once in a
thousand tests.
"""

from collections.abc import Callable

import numba
import numpy as np
import pytest
from numpy.typing import NDArray
from scipy import stats

from formation_env.kernel.stages.noise import STREAM_SIZE, begin_streams
from formation_env.numerics import random_streams
from formation_env.numerics.jit import LANES

Array = NDArray[np.float64]
Array32 = NDArray[np.float32]
Words = NDArray[np.uint64]
Words32 = NDArray[np.uint32]
P_LOW = 1e-3
KEYS = [(1, 2), (0xDEADBEEF, 1 << 63), (0, 0)]
ONES = 2**64 - 1
PI = [0x243F6A8885A308D3, 0x13198A2E03707344, 0xA4093822299F31D0, 0x082EFA98EC4E6C89]


@numba.njit
def words_at(key0: np.uint64, key1: np.uint64, counter0: Words, counter1: Words) -> Words:
    """Two words (N, 2) at each of N counters."""
    out = np.empty((len(counter0), 2), np.uint64)
    for i in range(len(counter0)):
        out[i, 0], out[i, 1] = random_streams.threefry2x64(key0, key1, counter0[i], counter1[i])
    return out


@numba.njit
def words_of(state: tuple[np.uint32, ...], count: int) -> Words32:
    """The next words of a stream."""
    out = np.empty(count, np.uint32)
    for k in range(count):
        out[k], state = random_streams.next_word(state[0], state[1], state[2], state[3])
    return out


@numba.njit
def uniforms_of(words: Words32) -> Array32:
    """A uniform of each word."""
    out = np.empty(len(words), np.float32)
    for i in range(len(words)):
        out[i] = random_streams.uniform(words[i])
    return out


@numba.njit
def normals_of(words: Words32) -> Array32:
    """Normals (N, 2) of pairs of words (N, 2)."""
    out = np.empty(words.shape, np.float32)
    for i in range(len(words)):
        out[i, 0], out[i, 1] = random_streams.normal_pair(words[i, 0], words[i, 1])
    return out


@numba.njit
def begin(state: Words32, keys: Words) -> None:
    begin_streams(state, keys, np.zeros(1, np.intp), 0, 1)


def stream(key: tuple[int, int], episode: int = 0) -> tuple[np.uint32, ...]:
    """The state of a key's stream at the start of an episode, as the reset makes it."""
    keys = np.array([[*key, episode]], np.uint64)
    state = np.zeros(STREAM_SIZE, np.uint32)
    begin(state, keys)
    assert keys[0, 2] == episode + 1
    return tuple(state[::LANES])


def words(key: tuple[int, int], count: int, episode: int = 0) -> Words32:
    """The first words of a key's stream."""
    return words_of(stream(key, episode), count)


def uniforms(key: tuple[int, int], count: int, episode: int = 0) -> Array:
    """Uniforms (count, 4), four after four."""
    return uniforms_of(words(key, 4 * count, episode)).reshape(count, 4).astype(float)


def normals(key: tuple[int, int], count: int) -> Array:
    """Normals (count, 4), four after four."""
    return normals_of(words(key, 4 * count).reshape(-1, 2)).reshape(count, 4).astype(float)


def assert_uncorrelated(first: Array, second: Array) -> None:
    """Their values, and how far they lie from the middle, have no correlation beyond chance."""
    for view in (lambda u: u, lambda u: np.abs(u - np.median(u))):
        assert stats.pearsonr(view(first), view(second)).pvalue > P_LOW


@pytest.mark.parametrize(
    ("counter", "key", "expected"),
    [
        ((0, 0), (0, 0), (0xF167B032C3B480BD, 0xE91F9FEE4B7A6FB5)),
        ((ONES, ONES), (ONES, ONES), (0xCCDEC5C917A874B1, 0x4DF53ABCA26CEB01)),
        (PI[:2], PI[2:], (0xC3AAC71561042993, 0x3FE7AE8801AFF316)),
    ],
    ids=["zeros", "ones", "pi"],
)
def test_known_answers(counter: tuple[int, int], key: tuple[int, int], expected: tuple[int, int]) -> None:
    """Threefry-2x64 with 13 rounds, from the kat_vectors of Random123 (Salmon et al. 2011): every bit."""
    key_words, counter_words = np.array(key, np.uint64), np.array(counter, np.uint64)
    actual = words_at(key_words[0], key_words[1], counter_words[:1], counter_words[1:])
    assert tuple(int(word) for word in actual[0]) == expected


@pytest.mark.parametrize("bit", [0, 1, 31, 32, 63])
def test_one_bit_of_key_or_counter_changes_half_of_the_output(bit: int) -> None:
    """Of 2000 x 128 bits half flip, binomially (the band is 4 sigma), whichever input word the bit is in."""
    counters = np.arange(2000, dtype=np.uint64)
    inputs = [np.uint64(5), np.uint64(6), counters, counters]
    before = words_at(*inputs)
    for place in range(4):
        flipped = [word ^ np.uint64(1 << bit) if i == place else word for i, word in enumerate(inputs)]
        changed = np.bitwise_count(before ^ words_at(*flipped)).sum()
        assert changed / before.size / 64 == pytest.approx(0.5, abs=4 * 0.5 / np.sqrt(before.size * 64))


def test_stream_keys_follow_their_generator() -> None:
    """Equal generators give equal keys, and one generator's next key is another; both words use all 64 bits."""
    generator = np.random.default_rng(1)
    first, second = random_streams.stream_key(generator), random_streams.stream_key(generator)
    np.testing.assert_array_equal(first, random_streams.stream_key(np.random.default_rng(1)), strict=True)
    assert first.shape == (2,)
    assert (first != second).all()
    keys = np.array([random_streams.stream_key(generator) for _ in range(64)])
    assert (np.bitwise_or.reduce(keys) == ONES).all()


@pytest.mark.parametrize("key", KEYS)
def test_uniforms_are_uniform(key: tuple[int, int]) -> None:
    """Kolmogorov-Smirnov for each of four in turn, and for all."""
    sample = uniforms(key, 100_000)
    assert min(stats.kstest(column, "uniform").pvalue for column in sample.T) > P_LOW
    assert stats.kstest(sample.ravel(), "uniform").pvalue > P_LOW


def test_uniforms_never_reach_1() -> None:
    """The upper 24 bits count: 0 and 1 - 2^-24 are the extremes, so a loss of 0 or 1 is certain."""
    extremes = uniforms_of(np.array([0, 255, 256, 2**32 - 1], np.uint32))
    np.testing.assert_array_equal(extremes, [0, 0, 2.0**-24, 1 - 2.0**-24])


def test_the_stream_is_xoshiro() -> None:
    """The first ten words of xoshiro128++ from the state (1, 2, 3, 4), as other implementations publish them."""
    state = tuple(np.uint32(k) for k in (1, 2, 3, 4))
    expected = [
        641,
        1573767,
        3222811527,
        3517856514,
        836907274,
        4247214768,
        3867114732,
        1355841295,
        495546011,
        621204420,
    ]
    np.testing.assert_array_equal(words_of(state, 10), expected)


@pytest.mark.parametrize("key", KEYS)
def test_normals_are_normal(key: tuple[int, int]) -> None:
    """Kolmogorov-Smirnov for each of four in turn; Cramer-von Mises for all."""
    sample = normals(key, 100_000)
    assert min(stats.kstest(column, "norm").pvalue for column in sample.T) > P_LOW
    assert stats.cramervonmises(sample.ravel(), "norm").pvalue > P_LOW


def test_moments_of_the_normals() -> None:
    """Mean 0, variance 1, skewness 0, kurtosis 3, each within 4 of its standard errors (1, 2, 15, 96 over N)."""
    sample = normals((3, 4), 1_000_000).ravel()
    powers = sample**1, sample**2, sample**3, sample**4
    for power, expected, variance in zip(powers, (0, 1, 0, 3), (1, 2, 15, 96), strict=True):
        assert power.mean() == pytest.approx(expected, abs=4 * np.sqrt(variance / sample.size))


@pytest.mark.parametrize("sigmas", [1.0, 2.0, 3.0, 4.0, 4.5])
def test_tails_of_the_normals(sigmas: float) -> None:
    """How many of 8 million lie beyond, on either side, is binomial."""
    sample = normals((5, 6), 2_000_000).ravel()
    for count in ((sample > sigmas).sum(), (sample < -sigmas).sum()):
        assert stats.binomtest(int(count), sample.size, stats.norm.sf(sigmas)).pvalue > P_LOW


def test_normals_end_where_the_smallest_word_puts_them() -> None:
    """sqrt(-2 ln 2^-32) = 6.66 sigma, and finite at every corner of the square."""
    extremes = np.array([0, 1, 2**31 - 1, 2**31, 2**32 - 1], np.uint32)
    corners = np.array([[u, v] for u in extremes for v in extremes])
    sample = normals_of(corners)
    assert np.isfinite(sample).all()
    assert np.abs(sample).max() == pytest.approx(np.sqrt(64 * np.log(2)), rel=1e-6)


@pytest.mark.parametrize("draw", [uniforms, normals])
def test_neighbours_are_independent(draw: Callable[[tuple[int, int], int], Array]) -> None:
    """Each pair of four in turn, as values and as distances from the middle: no sine without its cosine shows."""
    sample = draw((7, 8), 100_000)
    for i, j in zip(*np.triu_indices(4, 1), strict=True):
        assert_uncorrelated(sample[:, i], sample[:, j])


@pytest.mark.parametrize("lag", [1, 2, 8, 64])
def test_steps_are_independent(lag: int) -> None:
    """What a stream gives says nothing about what it gives later."""
    sample = uniforms((9, 10), 100_000)
    for column in sample.T:
        assert_uncorrelated(column[:-lag], column[lag:])


@pytest.mark.parametrize("other", [(12, 12), (11, 13), (11 ^ (1 << 63), 12), (12, 11)])
def test_neighbouring_keys_are_independent(other: tuple[int, int]) -> None:
    """Keys that differ in one bit, or in their order, give unrelated streams."""
    first, second = uniforms((11, 12), 100_000), uniforms(other, 100_000)
    for left, right in zip(first.T, second.T, strict=True):
        assert_uncorrelated(left, right)


@pytest.mark.parametrize("episode", [1, 2, 2**32])
def test_episodes_are_independent(episode: int) -> None:
    """A row's next episode has nothing of the one before."""
    first, second = uniforms((15, 16), 100_000), uniforms((15, 16), 100_000, episode)
    for left, right in zip(first.T, second.T, strict=True):
        assert_uncorrelated(left, right)


def test_pairs_fill_the_square() -> None:
    """Chi-squared over 32 x 32 cells, of every fourth number and the next such."""
    first = uniforms((13, 14), 400_001)[:, 0]
    counts, _, _ = np.histogram2d(first[:-1], first[1:], bins=32, range=[[0, 1], [0, 1]])
    assert stats.chisquare(counts.ravel()).pvalue > P_LOW
