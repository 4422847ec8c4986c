"""The summary of chapter 5 and the conclusions of chapter 6, as far as no section has decided them already."""

from dataclasses import replace
from typing import Final

import numpy as np
import pandas as pd

from baselines.design.riccati import closed_loop, least_fuel_gains
from baselines.thesis import plan, scenarios
from baselines.thesis.claims.claim import Claim
from baselines.thesis.claims.flights import Deck, Effort
from baselines.thesis.claims.maneuver import Maneuvers, assumption_of
from baselines.thesis.claims.tuned_comparison import LINEAR
from baselines.thesis.claims.verdict import Between, Statement
from formation_env.dynamics import NONLINEAR
from formation_env.numerics.arrays import Array
from formation_env.task.scenario import Scenario

PRICE: Final = 1e-2
"""At which the laws are compared in the headline, (m/s) per m; the scenarios' own."""
DAY_S: Final = 86400.0


def claims(keep: Deck, flown: Maneuvers, fair: pd.DataFrame, effort: Effort) -> list[Claim]:
    """The claims of the summary and of chapter 6."""
    return [*_axes(keep, effort), *_fair(fair, effort), _optimal(flown, effort), _fidelity()]


def _axes(keep: Deck, effort: Effort) -> list[Claim]:
    effort_m_s = keep.flights.effort()
    shares = effort_m_s[..., 2] / effort_m_s.sum(axis=-1)
    linear = Statement(
        "6.1",
        "control effort from a linear controller dominated in the direction perpendicular to the orbit plane",
        "z-axis",
        "z-axis share {} of the LQR's effort",
        Between(low=0.5),
        effort.assumption,
        "Only because k is misprinted: the disturbance that it makes is all across the plane. With its n the "
        "share is a half.",
    )
    equal = Statement(
        "6.1",
        "SMC could distribute the control effort in three axes directions equally",
        "1/3 each",
        "z-axis share {} of the SMC's effort",
        Between(0.2, 0.5),
        effort.assumption,
        "Any law that keeps the path has to thrust against the same disturbance along the same axis. The SMC's "
        "share of x is larger only because its surface is slow there and fights the orbit for hours.",
    )
    return [linear.judge(shares[keep.row("lqr")]), equal.judge(shares[keep.row("smc")])]


def _fair(fair: pd.DataFrame, effort: Effort) -> list[Claim]:
    """The comparison of the tuned laws, at the headline's price."""
    cheaper, dearer = Between(high=0.0), Between(low=0.0)
    said = [
        ("5.2", "for short-time formation, a linear controller is more suitable than a nonlinear one", False, dearer),
        ("6.1", "when large uncertainties take place, SMC shows its great superiority", True, cheaper),
        ("5.2", "when meeting system uncertainties, a nonlinear control is necessarily demanded", True, cheaper),
    ]
    truths = [LINEAR[0], LINEAR[0], NONLINEAR if (fair["truth"] == NONLINEAR).any() else LINEAR[0]]
    return [_compared(fair, truth, *row, effort) for truth, row in zip(truths, said, strict=True)]


def _compared(
    fair: pd.DataFrame, truth: str, section: str, sentence: str, fails: bool, wanted: Between, effort: Effort
) -> Claim:
    lines = fair[(fair["truth"] == truth) & (fair["failure"] == fails)]
    line = lines[lines["price_m_s_per_m"] == PRICE].iloc[0]
    shares = 100 * lines["smc_minus_lqr_m_s"] / lines["lqr_cost_m_s"]
    others = ", ".join(f"{share:+.2g} %" for share in shares)
    statement = Statement(
        section,
        sentence,
        "SMC better" if wanted.high == 0 else "LQR better",
        "tuned SMC's cost minus tuned LQR's {} m/s",
        wanted,
        f"truth {truth}, {'failure of 3000 s' if fails else 'no failure'}, T = {effort.coarse_dt_s:g} s, "
        f"{effort.grid_periods} periods, {effort.seeds} seeds; cost: delta-v plus {PRICE:g} m/s per m of mean error; "
        f"{effort.noise.words}",
        f"SMC against LQR in cost at prices from {lines['price_m_s_per_m'].min():g} to "
        f"{lines['price_m_s_per_m'].max():g} (m/s)/m: {others}. Both follow the same estimate, and during a "
        "failure it is the estimate that errs; near its surface the sliding mode is a linear law with fewer "
        "gains.",
    )
    return statement.between(line["smc_minus_lqr_m_s"], line["low"], line["high"])


def _optimal(flown: Maneuvers, effort: Effort) -> Claim:
    flights = flown.near.flights
    scenario = replace(flights.scenario, dt_s=effort.coarse_dt_s)
    start = scenario.start.formation.state(scenario.orbit)
    statement = Statement(
        "6.1",
        "automatic transfer with LQR can find the fuel-optimal path in given transfer time",
        "delta-v ratio 1",
        "the LQR takes {} times the delta-v of a plan of few burns in the same time",
        Between(high=1.1),
        f"0.4 periods, {assumption_of(effort, effort.dt_s)}; plan of T = {effort.coarse_dt_s:g} s",
        "The infinite-horizon law minimises a quadratic cost and does not know the transfer time; it is there within a "
        "tenth of an orbit, pays for the haste, and then for holding a circle that the printed equations do not close.",
    )
    return statement.judge(flights.delta_v()[0] / least_fuel_m_s(scenario, start, flights.desired[-1]))


def least_fuel_m_s(scenario: Scenario, start: Array, end: Array) -> float:
    """Delta-v of the plan of few burns, see `riccati.least_fuel_gains`, between two states in a scenario's time, m/s.

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
    """The free motion by the printed equations against the corrected ones, over a day."""
    scenario = scenarios.keeping(1.0, 60.0)
    state = scenario.start.formation.state(scenario.orbit)
    printed, meant = (
        replace(scenario, dynamics=name).filter_dynamics().Phi for name in (plan.DYNAMICS, scenario.dynamics)
    )
    first, second, worst = state, state, 0.0
    for _ in range(int(DAY_S / scenario.dt_s)):
        first, second = printed @ first, meant @ second
        worst = max(worst, float(np.linalg.norm((first - second)[:3])))
    statement = Statement(
        "6.1",
        "the modified HCW propagator has good fidelity in short-term (less than one day) simulation",
        "good",
        "the printed equations stray up to {} m from the corrected ones within a day, on a circle of 4000 m",
        Between(high=400.0),
        "no noise, so no interval; good: a tenth of the formation's size; the corrected equations themselves are "
        "held against the nonlinear truth elsewhere on the page",
        "Eq. (2.62) lacks the n of its second term, so the cross-track motion is 31 % too fast and out of phase "
        "after one and a half orbits.",
    )
    return statement.judge(np.array([worst]))
