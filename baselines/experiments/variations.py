"""Variations of a scenario. To add a quantity: a function here, and a line in `VARIATIONS`."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

from formation_env.dropout import GilbertElliott
from formation_env.dynamics import NONLINEAR
from formation_env.task.scenario import Scenario

Pair = tuple[Scenario, Scenario]
"""The scenario that is simulated, and the one that policies are designed for."""


@dataclass(frozen=True)
class Variation:
    """A quantity that is varied.

    Attributes:
        vary: makes the scenarios for one of its values, each from the same scenario.
        values: of the quantity, ascending.
        label: title of the axis, with the unit.
        log: whether the axis is logarithmic.
        names: tick labels in place of values, where the values are kinds.
    """

    vary: Callable[[Scenario, float], Pair]
    values: tuple[float, ...]
    label: str
    log: bool = False
    names: dict[float, str] = field(default_factory=dict)

    @property
    def few(self) -> tuple[float, ...]:
        """Every second value and the middle one, for a quick look."""
        middle = len(self.values) // 2
        return tuple(value for index, value in enumerate(self.values) if index % 2 == 0 or index == middle)


def error_weight(scenario: Scenario, factor: float) -> Pair:
    """Error weight, in units of the scenario's."""
    weight = factor * scenario.reward.error_weight
    return _same(replace(scenario, reward=replace(scenario.reward, error_weight=weight)))


def outage_length(scenario: Scenario, mean_outage_s: float) -> Pair:
    """Mean outage, s, with the scenario's share of lost measurements."""
    return _bursts(scenario, mean_outage_s, lost_share(scenario)), scenario


def measurement_loss(scenario: Scenario, share: float) -> Pair:
    """Share of lost measurements, with the scenario's mean outage."""
    dropout = scenario.dropout
    known = dropout if isinstance(dropout, GilbertElliott) else GilbertElliott()
    return _bursts(scenario, known.mean_outage_s, share), scenario


def lost_share(scenario: Scenario) -> float:
    """The scenario's long-run share of lost measurements; where its chain loses none, Gilbert-Elliott's default."""
    models = (scenario.dropout, GilbertElliott())
    shares = [model.chain(scenario.dt_s, scenario.orbit).stationary_loss for model in models]
    return shares[0] or shares[1]


def _bursts(scenario: Scenario, mean_outage_s: float, share: float) -> Scenario:
    # share = outage / (outage + between)
    between_s = mean_outage_s * (1 - share) / share
    periods = between_s / scenario.orbit.period_s
    return replace(scenario, dropout=GilbertElliott(mean_outage_s=mean_outage_s, mean_uptime_orbits=periods))


def sensor_noise(scenario: Scenario, factor: float) -> Pair:
    """The sensor's sigmas, in units of the scenario's."""
    known = scenario.sensor
    noisier = replace(known, sigma_pos_m=factor * known.sigma_pos_m, sigma_vel_m_s=factor * known.sigma_vel_m_s)
    return _same(replace(scenario, sensor=noisier))


def thrust_limit(scenario: Scenario, factor: float) -> Pair:
    """Thrust limit, in units of the scenario's."""
    return _same(_with_thrust(scenario, factor))


def initial_error(scenario: Scenario, factor: float) -> Pair:
    """Spread of the start, in units of the scenario's."""
    known = scenario.start
    wider = replace(
        known,
        initial_sigma_pos_m=factor * known.initial_sigma_pos_m,
        initial_sigma_vel_m_s=factor * known.initial_sigma_vel_m_s,
    )
    return _same(replace(scenario, start=wider))


def true_dynamics(scenario: Scenario, nonlinear: float) -> Pair:
    """The filter's linear model as the truth (0), or the nonlinear one (1)."""
    return replace(scenario, dynamics=NONLINEAR if nonlinear else scenario.filter_model.dynamics), scenario


def ballistic_coefficient(scenario: Scenario, percent: float) -> Pair:
    """The follower's ballistic coefficient m / (C_d S) off by by some per cent; leader and filter are unchanged."""
    known = scenario.spacecraft
    true = replace(known, area_m2=known.area_m2 / (1 + percent / 100))
    filter_settings = replace(scenario.filter, spacecraft=scenario.filter_model.spacecraft)
    return replace(scenario, spacecraft=true, leader_spacecraft=scenario.leader, filter=filter_settings), scenario


def thrust_magnitude(scenario: Scenario, percent: float) -> Pair:
    """Thrust some per cent above the command; the filter knows the thrust that acts."""
    return _with_thrust(scenario, 1 + percent / 100), scenario


def _with_thrust(scenario: Scenario, factor: float) -> Scenario:
    limit = factor * scenario.spacecraft.max_accel_m_s2
    return replace(scenario, spacecraft=replace(scenario.spacecraft, max_accel_m_s2=limit))


def _same(scenario: Scenario) -> Pair:
    return scenario, scenario


FRONT: Final = "error_weight"
"""The quantity that is varied along the trade-off."""

VARIATIONS: Final[dict[str, Variation]] = {
    FRONT: Variation(error_weight, (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0), "error weight, × the scenario's", log=True),
    "outage_length": Variation(outage_length, (60.0, 300.0, 600.0, 1200.0, 3000.0), "mean outage, s", log=True),
    "measurement_loss": Variation(measurement_loss, (0.02, 0.1, 0.3, 0.5, 0.7), "share of lost measurements"),
    "sensor_noise": Variation(sensor_noise, (0.1, 0.3, 1.0, 3.0, 10.0), "sensor noise, × the scenario's", log=True),
    "thrust_limit": Variation(thrust_limit, (0.3, 0.5, 1.0, 2.0, 5.0), "thrust limit, × the scenario's", log=True),
    "initial_error": Variation(initial_error, (0.1, 0.3, 1.0, 3.0, 10.0), "initial error, × the scenario's", log=True),
    "true_dynamics": Variation(
        true_dynamics, (0.0, 1.0), "true dynamics", names={0.0: "as the filter's", 1.0: "nonlinear"}
    ),
    "ballistic_coefficient": Variation(
        ballistic_coefficient, (-50.0, 0.0, 50.0), "ballistic coefficient, % above the design value"
    ),
    "thrust_magnitude": Variation(
        thrust_magnitude, (-20.0, -10.0, 0.0, 10.0, 20.0), "thrust magnitude, % above the command"
    ),
}
"""Quantities by name, the trade-off's first. Policies are designed for error weight, noise, limit and start only."""
