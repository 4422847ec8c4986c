"""Verdicts from samples: a statement holds if its whole 95 % interval does, and fails if none of it does."""

import math
from dataclasses import dataclass

import numpy as np

from baselines.thesis.claims.claim import Claim, Verdict
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.numerics.arrays import Array


@dataclass(frozen=True)
class Between:
    """Interval in which a statement expects a number.

    Attributes:
        low: the number is above it.
        high: the number is below it.
    """

    low: float = -math.inf
    high: float = math.inf

    def verdict(self, low: float, high: float) -> Verdict:
        """Verdict on a number within [low, high] with 95 % confidence; NaN cannot be decided."""
        if self.low < low and high < self.high:
            return "holds"
        if high <= self.low or low >= self.high:
            return "fails"
        return "cannot be decided"

    def share(self, values: Array) -> int:
        """Count the values inside the interval."""
        return int(np.sum((self.low < values) & (values < self.high)))


@dataclass(frozen=True, kw_only=True)
class Statement:
    """A statement of the thesis that a number decides.

    Attributes:
        section: of the thesis.
        sentence: its own words, shortened.
        thesis_value: the number or comparison it gives.
        quantity: measured quantity with its unit as `{}` followed by the unit, such as `max error {} m`.
        expected: where the number should lie.
        assumption: assumptions of the verdict.
        explanation: reason for the outcome.
    """

    section: str
    sentence: str
    thesis_value: str
    quantity: str
    expected: Between
    assumption: str
    explanation: str

    def decide(self, values: Array) -> Claim:
        """Decide by one number per seed (seeds,), using the interval of its mean; a single number has no interval."""
        values = np.atleast_1d(np.asarray(values, float))
        mean = float(values.mean())
        if len(values) == 1:
            return self._claim(self.quantity.format(f"{mean:.4g}"), None, None, self.expected.verdict(mean, mean))
        return self.decide_interval(
            mean, *bootstrap_interval(values), f"; as stated in {self.expected.share(values)} of {len(values)} seeds"
        )

    def decide_interval(self, mean: float, low: float, high: float, more: str = "") -> Claim:
        """Decide by a mean and its interval; `more` is appended to the number."""
        ours = self.quantity.format(f"{mean:.4g} [{low:.4g}, {high:.4g}]")
        return self._claim(f"{ours}{more}", float(low), float(high), self.expected.verdict(low, high))

    def undecided(self, ours: str) -> Claim:
        """Claim that no number can decide; the explanation says why."""
        return self._claim(ours, None, None, "cannot be decided")

    def _claim(self, ours: str, low: float | None, high: float | None, verdict: Verdict) -> Claim:
        explanation = self.explanation
        if verdict == "cannot be decided" and low is not None:
            explanation = f"The interval contains the limit. {explanation}"
        return Claim(
            section=self.section,
            sentence=self.sentence,
            thesis_value=self.thesis_value,
            ours=ours,
            low=low,
            high=high,
            verdict=verdict,
            assumption=self.assumption,
            explanation=explanation,
        )
