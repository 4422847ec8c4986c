"""The regulator of textbooks: a finite horizon with a terminal weight, and quadratic weights throughout."""

from baselines.controllers.lqr import LQR, LQRSettings, TransferSettings
from baselines.controllers.weights import Weights
from baselines.design.guidance import Guide
from formation_env.settings import settings
from formation_env.task.scenario import Scenario


@settings
class LQRFiniteSettings:
    """Gains of `lqr_finite`.

    Attributes:
        guidance: the desired path, see `baselines.design.guidance`.
        transfer: weights of the error at the arrival, and of control on the way there.
        hold: weights in hold, without end.
    """

    guidance: Guide = "automatic"
    transfer: Weights = Weights(velocity_s2=(1e6, 1e6, 1e6), control_s2=(1e-3, 1e-3, 1e-3))
    hold: Weights = Weights(velocity_s2=(1e5, 1e5, 1e5), control_s2=(3e5, 3e5, 3e5))


class LQRFinite(LQR):
    """A gain for each step to the arrival: least squares of thrust and of the last error (Ma 2009, eq. 4.12-4.14)."""

    Settings = LQRFiniteSettings

    def __init__(self, scenario: Scenario, gains: LQRFiniteSettings) -> None:
        transfer = TransferSettings(horizon="finite", weights=gains.transfer, rounds=0)
        design = LQRSettings(design="weights", guidance=gains.guidance, hold=gains.hold, transfer=transfer)
        super().__init__(scenario, design)
