"""Verdicts from samples: a sentence holds where its whole 95 % interval does, and fails where none of it does."""

import math
from dataclasses import dataclass

import numpy as np

from baselines.thesis.claims.claim import Claim, Verdict
from formation_env.evaluation.statistics import bootstrap_interval
from formation_env.numerics.arrays import Array


@dataclass(frozen=True)
class Between:
    """What a sentence says of a number: that it lies between two others.

    Attributes:
        low: the number is above it.
        high: the number is below it.
    """

    low: float = -math.inf
    high: float = math.inf

    def verdict(self, low: float, high: float) -> Verdict:
        """The verdict on a number that lies in [low, high] with 95 % confidence; no number (NaN) decides nothing."""
        if self.low < low and high < self.high:
            return "holds"
        if high <= self.low or low >= self.high:
            return "fails"
        return "cannot be decided"

    def share(self, values: Array) -> int:
        """How many of some values are as the sentence says."""
        return int(np.sum((self.low < values) & (values < self.high)))


@dataclass(frozen=True)
class Statement:
    """A sentence of the thesis that a number decides.

    Attributes:
        section: of the thesis.
        sentence: its own words, shortened.
        thesis_value: the number or comparison it gives.
        quantity: what is measured here, and its unit as `{}` followed by the unit, such as `max error {} m`.
        wanted: where the number should lie.
        assumption: what the verdict rests on.
        explanation: why it comes out so.
    """

    section: str
    sentence: str
    thesis_value: str
    quantity: str
    wanted: Between
    assumption: str
    explanation: str

    def judge(self, values: Array) -> Claim:
        """The claim for a number per seed (seeds,), by the interval of its mean; a lone number has no interval."""
        values = np.atleast_1d(np.asarray(values, float))
        mean = float(values.mean())
        if len(values) == 1:
            return self._claim(self.quantity.format(f"{mean:.4g}"), None, None, self.wanted.verdict(mean, mean))
        return self.between(
            mean, *bootstrap_interval(values), f"; as said in {self.wanted.share(values)} of {len(values)} seeds"
        )

    def between(self, mean: float, low: float, high: float, more: str = "") -> Claim:
        """The claim for a mean and its interval; `more` is added to the number."""
        ours = self.quantity.format(f"{mean:.4g} [{low:.4g}, {high:.4g}]")
        return self._claim(f"{ours}{more}", float(low), float(high), self.wanted.verdict(low, high))

    def undecided(self, ours: str) -> Claim:
        """The claim where no number can decide; the explanation says why."""
        return self._claim(ours, None, None, "cannot be decided")

    def _claim(self, ours: str, low: float | None, high: float | None, verdict: Verdict) -> Claim:
        explanation = self.explanation
        if verdict == "cannot be decided" and low is not None:
            explanation = f"The interval reaches over the limit. {explanation}"
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
