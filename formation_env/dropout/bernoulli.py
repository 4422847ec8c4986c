"""Independent losses."""

from typing import Literal

from formation_env.dropout.base import Dropout, LinkChain
from formation_env.orbital.orbit import Orbit
from formation_env.settings import Probability, settings


@settings
class Bernoulli(Dropout):
    """Each measurement is lost independently.

    Attributes:
        loss_probability: probability that one measurement does not arrive, in [0, 1].
    """

    kind: Literal["bernoulli"] = "bernoulli"
    loss_probability: Probability = 0.1

    def chain(self, dt_s: float, orbit: Orbit) -> LinkChain:
        """The chain whose next state does not depend on the last."""
        return LinkChain(fail=self.loss_probability, recover=1 - self.loss_probability)
