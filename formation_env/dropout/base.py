"""Interface of dropout models: a two-state Markov chain of the link, and scheduled outages."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from formation_env.numerics.arrays import Array
from formation_env.orbital.orbit import Orbit


@dataclass(frozen=True)
class LinkChain:
    """Markov chain of a link that is up or down, one transition per step.

    Attributes:
        fail: probability that an open link is down at the next step.
        recover: probability that a link that is down is open at the next step.
    """

    fail: float = 0.0
    recover: float = 1.0

    @property
    def stationary_loss(self) -> float:
        """Long-run share of steps at which the link is down; also the probability that it starts so."""
        return self.fail / (self.fail + self.recover)


class Dropout:
    """A link that never fails; subclasses, made with `settings`, override what they change."""

    kind: str = "custom"

    def chain(self, dt_s: float, orbit: Orbit) -> LinkChain:
        """The link's Markov chain at steps of dt_s, s.

        Raises:
            ValueError: no chain has the settings' mean lengths at this step.
        """
        return LinkChain()

    def closed(self, times_s: Array) -> NDArray[np.bool_]:
        """Whether a scheduled outage closes the link at each of the times (T,), s."""
        return np.zeros(len(times_s), bool)
