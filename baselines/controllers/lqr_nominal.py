"""LQR about a nominal trajectory: the undisturbed flight of least cost through all phases, from a cone program."""

from dataclasses import replace
from functools import lru_cache

from baselines.controllers.affine_law import AffineLaw, shown
from baselines.controllers.policy import AccelerationPolicy
from baselines.controllers.search_space import REWEIGHTED_LQG
from baselines.design.phase_tables import by_steps_left
from baselines.design.reweighted_lqg import ReweightedLQGSettings, reweighted_gains
from baselines.optimal import OptimalPlan, fuel_optimal
from baselines.optimal.cone_solver import SOLVER
from formation_env.dynamics.perturbations import Perturbations
from formation_env.numerics.arrays import Array, Observations
from formation_env.settings import settings
from formation_env.task.scenario import Scenario


@settings(renamed={"expected_cost": "reweighted_lqg"})
class LQRNominalSettings:
    """Settings of `lqr_nominal`.

    Attributes:
        reweighted_lqg: design of the feedback's gains.
    """

    reweighted_lqg: ReweightedLQGSettings = ReweightedLQGSettings()


class LQRNominal(AccelerationPolicy):
    """u = u_p - K (x_hat - x_p) about the plan x_p, u_p; K as of `lqr` with design `reweighted_lqg`.

    `lqr` designs each phase by itself; the plan knows what comes after, and where it pays to be when a phase ends.
    """

    name = "lqr_nominal"
    Settings = LQRNominalSettings
    settings: LQRNominalSettings
    search_space = REWEIGHTED_LQG
    library = SOLVER
    proportional = True
    color, symbol, dash = "#6C5CE7", "hexagram", "dashdot"

    def __init__(self, scenario: Scenario, settings: LQRNominalSettings) -> None:
        """Plan, and find the gains.

        Raises:
            ModuleNotFoundError: Clarabel is not installed.
        """
        super().__init__(scenario, settings)
        plan, K = mission_plan(scenario), reweighted_gains(scenario, settings.reweighted_lqg)
        path = by_steps_left(scenario, lambda leg: plan.states[leg.start : leg.end])
        thrust = by_steps_left(scenario, lambda leg: plan.controls[leg.start : leg.end])
        self._law = AffineLaw(scenario, by_steps_left(scenario, lambda leg: K[leg.index]), path, thrust)

    def acceleration(self, observation: Observations) -> Array:
        """Accelerations (..., 3), m/s^2."""
        estimate = shown(observation, "error") + shown(observation, "reference")
        return self._law.acceleration(estimate, self._law.instants(observation))


@lru_cache(maxsize=32)
def mission_plan(scenario: Scenario) -> OptimalPlan:
    """The undisturbed flight of least cost from the nominal start, by the filter's model.

    Raises:
        ModuleNotFoundError: Clarabel is not installed.
    """
    filter_model = scenario.filter_model
    design_scenario = replace(
        scenario,
        dynamics=filter_model.dynamics,
        orbit=filter_model.orbit,
        spacecraft=replace(
            filter_model.spacecraft, max_accel_m_s2=scenario.spacecraft.max_accel_m_s2, thrust_noise=0.0
        ),
        perturbations=Perturbations(),
    )
    return fuel_optimal(design_scenario)
