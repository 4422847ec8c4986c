"""The regulator of textbooks: a finite horizon with a terminal weight, and quadratic weights throughout."""

from baselines.controllers.lqr import LQR, LQRSettings, TransferSettings
from baselines.controllers.search_space import REGULATOR
from baselines.controllers.weights import Weights
from baselines.design.guidance import GuidanceName
from formation_env.settings import settings
from formation_env.task.scenario import Scenario


@settings
class LQRFiniteSettings:
    """Settings of `lqr_finite`.

    Attributes:
        guidance: the desired path, see `baselines.design.guidance`.
        transfer: weights of the error at the arrival, and of control on the way there.
        hold: weights in hold, without end.
    """

    guidance: GuidanceName = "automatic"
    transfer: Weights = Weights(velocity_s2=(1e6, 1e6, 1e6), control_s2=(1e-3, 1e-3, 1e-3))
    hold: Weights = Weights(velocity_s2=(1e5, 1e5, 1e5), control_s2=(3e5, 3e5, 3e5))


class LQRFinite(LQR):
    """A gain for each step to the arrival: least squares of thrust and of the last error (Ma 2009, eq. 4.12-4.14)."""

    name = "lqr_finite"
    Settings = LQRFiniteSettings
    search_space = REGULATOR
    color, symbol, dash = "#8E7CC3", "diamond", "dot"

    def __init__(self, scenario: Scenario, settings: LQRFiniteSettings) -> None:
        transfer = TransferSettings(horizon="finite", weights=settings.transfer, rounds=0)
        design = LQRSettings(design="weights", guidance=settings.guidance, hold=settings.hold, transfer=transfer)
        super().__init__(scenario, design)
