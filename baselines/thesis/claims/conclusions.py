"""Summary of chapter 5 and conclusions of chapter 6, where no section has decided them."""

from dataclasses import replace
from typing import Final

import numpy as np
import pandas as pd

from baselines.design.riccati import closed_loop, least_fuel_gains
from baselines.thesis import figure_flights, scenarios
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.maneuver import Maneuvers, assumption_of
from baselines.thesis.claims.shared_flights import ClaimOptions, LawFlights
from baselines.thesis.claims.tuned_comparison import LINEAR
from baselines.thesis.claims.verdict import Between, Statement
from formation_env.dynamics import NONLINEAR
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

ERROR_WEIGHT: Final = 1e-2
"""Error weight of the headline comparison, (m/s) per m; that of the scenarios."""
DAY_S: Final = 86400.0


def claims(keep: LawFlights, flown: Maneuvers, fair: pd.DataFrame, options: ClaimOptions) -> list[Claim]:
    """The claims of the summary and of chapter 6."""
    return [*_axes(keep, options), *_fair(fair, options), _optimal(flown, options), _fidelity()]


def _axes(keep: LawFlights, options: ClaimOptions) -> list[Claim]:
    effort_m_s = keep.flights.effort()
    shares = effort_m_s[..., 2] / effort_m_s.sum(axis=-1)
    linear = Statement(
        section="6.1",
        sentence="control effort from a linear controller dominated in the direction perpendicular to the orbit plane",
        thesis_value="z-axis",
        quantity="z-axis share {} of the LQR's effort",
        expected=Between(low=0.5),
        assumption=options.assumption,
        explanation=(
            "Only because k is misprinted: the resulting disturbance is entirely cross-track. With the n restored the "
            "share is one half."
        ),
    )
    equal = Statement(
        section="6.1",
        sentence="SMC could distribute the control effort in three axes directions equally",
        thesis_value="1/3 each",
        quantity="z-axis share {} of the SMC's effort",
        expected=Between(0.2, 0.5),
        assumption=options.assumption,
        explanation=(
            "Any law that keeps the path must thrust against the same disturbance along the same axis. The SMC's x "
            "share is larger only because its surface is slow there and opposes the orbital motion for hours."
        ),
    )
    return [linear.decide(shares[keep.row("lqr")]), equal.decide(shares[keep.row("smc")])]


def _fair(fair: pd.DataFrame, options: ClaimOptions) -> list[Claim]:
    """Comparison of the tuned laws at the headline's error weight."""
    cheaper, dearer = Between(high=0.0), Between(low=0.0)
    rows = [
        ("5.2", "for short-time formation, a linear controller is more suitable than a nonlinear one", False, dearer),
        ("6.1", "when large uncertainties take place, SMC shows its great superiority", True, cheaper),
        ("5.2", "when meeting system uncertainties, a nonlinear control is necessarily demanded", True, cheaper),
    ]
    truths = [LINEAR[0], LINEAR[0], NONLINEAR if (fair["truth"] == NONLINEAR).any() else LINEAR[0]]
    return [_compared(fair, truth, *row, options) for truth, row in zip(truths, rows, strict=True)]


def _compared(
    fair: pd.DataFrame, truth: str, section: str, sentence: str, fails: bool, expected: Between, options: ClaimOptions
) -> Claim:
    lines = fair[(fair["truth"] == truth) & (fair["failure"] == fails)]
    line = lines[lines["price_m_s_per_m"] == ERROR_WEIGHT].iloc[0]
    shares = 100 * lines["smc_minus_lqr_m_s"] / lines["lqr_cost_m_s"]
    others = ", ".join(f"{share:+.2g} %" for share in shares)
    statement = Statement(
        section=section,
        sentence=sentence,
        thesis_value="SMC better" if expected.high == 0 else "LQR better",
        quantity="tuned SMC's cost minus tuned LQR's {} m/s",
        expected=expected,
        assumption=(
            f"truth {truth}, {'failure of 3000 s' if fails else 'no failure'}, T = {options.coarse_dt_s:g} s, "
            f"{options.grid_periods} periods, {options.seeds} seeds; cost: delta-v plus {ERROR_WEIGHT:g} m/s per m of "
            "mean error; "
            f"{options.noise.text}"
        ),
        explanation=(
            f"Cost of SMC relative to LQR at error weights from {lines['price_m_s_per_m'].min():g} to "
            f"{lines['price_m_s_per_m'].max():g} (m/s)/m: {others}. Both follow the same estimate, and during a "
            "failure the error is the estimate's; near its surface the sliding mode is a linear law with fewer gains."
        ),
    )
    return statement.decide_interval(line["smc_minus_lqr_m_s"], line["low"], line["high"])


def _optimal(flown: Maneuvers, options: ClaimOptions) -> Claim:
    flights = flown.near.flights
    scenario = replace(flights.scenario, dt_s=options.coarse_dt_s)
    start = scenario.start.formation.state(scenario.orbit)
    statement = Statement(
        section="6.1",
        sentence="automatic transfer with LQR can find the fuel-optimal path in given transfer time",
        thesis_value="delta-v ratio 1",
        quantity="the LQR takes {} times the delta-v of a minimum-fuel plan in the same time",
        expected=Between(high=1.1),
        assumption=f"0.4 periods, {assumption_of(options, options.dt_s)}; plan of T = {options.coarse_dt_s:g} s",
        explanation=(
            "The infinite-horizon law minimises a quadratic cost and ignores the transfer time; it arrives within a "
            "tenth of an orbit, pays for the haste, and then for holding a circle that the printed equations do not "
            "close."
        ),
    )
    return statement.decide(flights.delta_v()[0] / least_fuel_m_s(scenario, start, flights.desired[-1]))


def least_fuel_m_s(scenario: Scenario, start: Array, end: Array) -> float:
    """Delta-v of the minimum-fuel plan (`riccati.least_fuel_gains`) between two states in a scenario's time, m/s.

    Args:
        scenario: its filter's model and number of steps.
        start: state (6,), m and m/s.
        end: state (6,).
    """
    model, steps, n = scenario.filter_dynamics(), scenario.num_steps, scenario.orbit.mean_motion_rad_s
    # the error from the free motion that ends where it should: it has to vanish
    error = start - np.linalg.solve(np.linalg.matrix_power(model.Phi, steps), end)
    R = np.tile(np.eye(3) / n**4, (steps, 1, 1))
    terminal = 1e9 * np.diag([1, 1, 1, n**-2, n**-2, n**-2])
    limit = scenario.spacecraft.max_accel_m_s2
    gains = least_fuel_gains(model.Phi, model.Gamma, R, terminal, error, limit, rounds=30, floor=1e-3)
    _, controls = closed_loop(model.Phi, model.Gamma, gains, error)
    return scenario.dt_s * float(np.linalg.norm(controls, axis=1).sum())


def _fidelity() -> Claim:
    """Compare the free motion of the printed and the corrected equations over a day."""
    scenario = scenarios.keeping(1.0, 60.0)
    state = scenario.start.formation.state(scenario.orbit)
    printed, corrected = (
        replace(scenario, dynamics=name).filter_dynamics().Phi for name in (figure_flights.DYNAMICS, scenario.dynamics)
    )
    first, second, worst = state, state, 0.0
    for _ in range(int(DAY_S / scenario.dt_s)):
        first, second = printed @ first, corrected @ second
        worst = max(worst, float(np.linalg.norm((first - second)[:3])))
    statement = Statement(
        section="6.1",
        sentence="the modified HCW propagator has good fidelity in short-term (less than one day) simulation",
        thesis_value="good",
        quantity=(
            "the printed equations deviate by up to {} m from the corrected ones within a day, on a circle of 4000 m"
        ),
        expected=Between(high=400.0),
        assumption=(
            "no noise, so no interval; good: a tenth of the formation's size; the corrected equations are compared "
            "with the nonlinear truth elsewhere on the page"
        ),
        explanation=(
            "Eq. (2.62) lacks the n of its second term, so the cross-track motion is 31 % too fast and out of phase "
            "after one and a half orbits."
        ),
    )
    return statement.decide(np.array([worst]))
