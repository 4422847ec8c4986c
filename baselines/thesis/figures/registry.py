"""Which figure shows what, beside which sentence of the thesis.

To add a figure: a function that draws it from the flights of `baselines.thesis.plan`, and an entry in `FIGURES`.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

import matplotlib.figure

from baselines.thesis import plan
from baselines.thesis.figures import comparisons, orbits, panels, paths, style
from baselines.thesis.figures.comparisons import Course
from baselines.thesis.figures.notes import nothing
from baselines.thesis.figures.panels import Line, Window
from baselines.thesis.flights import Flights
from formation_env.formations import ProjectedCircle, SpaceCircle, XYEllipse

Flown = Mapping[str, Flights]
BLUE, RED, SKY = style.COLORS["lqr"], style.COLORS["smc"], style.COLORS["lqr_tracking"]


@dataclass(frozen=True)
class Figure:
    """A figure of the thesis, drawn anew.

    Attributes:
        title: what it shows.
        sentence: of the thesis, which it supports.
        draw: draws it from the flights.
    """

    title: str
    sentence: str
    draw: Callable[[Flown], matplotlib.figure.Figure]

    def note(self, number: str, flown: Flown) -> str:
        """What came out, in a sentence or two; empty if there is nothing to say."""
        return nothing(flown)


def _initialization(flown: Flown, periods: str) -> matplotlib.figure.Figure:
    return panels.four_panels([Line("tracking LQR", flown[f"initialization {periods}"], 0, SKY)])


def _keeping(flown: Flown) -> matplotlib.figure.Figure:
    return panels.four_panels(
        [
            Line("LQR, k as printed", flown["keeping"], 0, BLUE),
            Line("tracking LQR, k as meant", flown["meant"], 1, SKY, "--"),
            Line("LQR, k as meant", flown["meant"], 0, "black", ":"),
        ]
    )


def _one(name: str, policy: int, label: str, color: str) -> Callable[[Flown], matplotlib.figure.Figure]:
    """Four panels of one policy of one job."""
    return lambda flown: panels.four_panels([Line(label, flown[name], policy, color)])


def _path(name: str, policy: int, color: str) -> Callable[[Flown], matplotlib.figure.Figure]:
    """Trajectory of one policy of one job."""
    return lambda flown: paths.flight_path(flown[name], policy, color)


def _sweep(flown: Flown) -> matplotlib.figure.Figure:
    sweeps = [flown["sweep 1"], flown["sweep 2"]]
    end = sweeps[0].time_s[-1] / sweeps[0].scenario.orbit.period_s + 1e-3
    return comparisons.trade(sweeps, [periods for periods in plan.KEEPING_PERIODS if periods <= end])


def _with_and_without(flown: Flown) -> matplotlib.figure.Figure:
    return comparisons.over_time(
        [
            Course("with communication failure", flown["failure"], 0, RED, "s"),
            Course("without communication failure", flown["keeping"], 0, BLUE, "o"),
        ]
    )


def nearest_lqr(flown: Flown) -> Course:
    """Of all LQR weights flown, the one whose mean error is nearest to SMC's."""
    target = flown["keeping"].mean_error()[2].mean()
    flights, policy = min(
        ((flights, policy) for flights in (flown["sweep 1"], flown["sweep 2"]) for policy in range(len(flights.delta_v()))),
        key=lambda found: abs(found[0].mean_error()[found[1]].mean() - target),
    )
    return Course("LQR of nearest mean accuracy", flights, policy, BLUE, "o")


def _lqr_and_smc(flown: Flown) -> matplotlib.figure.Figure:
    return comparisons.in_space([nearest_lqr(flown), Course("SMC", flown["keeping"], 2, RED, "s")])


def _failure_lqr_and_smc(flown: Flown) -> matplotlib.figure.Figure:
    return comparisons.over_time(
        [Course("LQR", flown["failure"], 0, BLUE, "o"), Course("SMC", flown["failure"], 1, RED, "s")]
    )


def _mission_phases(flown: Flown) -> matplotlib.figure.Figure:
    return paths.phase_paths(
        flown["mission"],
        0,
        [
            ("1 Initialization", 0.0, 0.5),
            ("2 x-y ellipse keeping", 0.5, 5.05),
            ("3 Reconfiguration", 5.05, 5.45),
            ("4 y-z circle keeping", 5.45, 10.05),
        ],
    )


FIGURES: Final[dict[str, Figure]] = {
    "3.3": Figure(
        "x-y plane ellipse formation planning",
        "In this type formation, Follower, usually small satellite, can perform multi-direction monitoring activities "
        "about Leader within a certain range.",
        lambda flown: orbits.formation(XYEllipse()),
    ),
    "3.4": Figure(
        "In-track illustration",
        "In-track formation is the formation type in which both satellites share the same ground track.",
        lambda flown: orbits.in_track(),
    ),
    "3.5": Figure(
        "Space circular formation",
        "In this motion, the trajectory of Follower relative to Leader is designed to be a circle in space.",
        lambda flown: orbits.formation(SpaceCircle()),
    ),
    "3.6": Figure(
        "Projected circular formation",
        "In this type of formation, the trajectory of Follower relative to Leader is ellipse in the space, but circle "
        "in y-z plane which means it is projected circle on the ground.",
        lambda flown: orbits.formation(ProjectedCircle()),
    ),
    "5.2": Figure(
        "Control accuracy and control consumption (tf = 0.5p)",
        "The LQR controller is justified to make the position error not greater than 30 m.",
        lambda flown: _initialization(flown, "0.5"),
    ),
    "5.3": Figure(
        "Control accuracy and consumption (tf = 0.1p)",
        "Then, with the transfer time tf = 0.1p and the same LQR control parameters, more control effort is needed to "
        "realize the initialization process. Moreover, the control accuracy decreases if control parameters keeps the "
        "same with the previous one.",
        lambda flown: _initialization(flown, "0.1"),
    ),
    "5.4": Figure(
        "Following initialization relative trajectory (tf = 0.1p)",
        "It indicates that with the LQR controller, Follower can track the pre-designed motion under the "
        "perturbations.",
        _path("initialization 0.1", 0, SKY),
    ),
    "5.5": Figure(
        "Control accuracy/consumption vs. time",
        "Thus, the optimal initialization time is between 0.2p and 0.8p, because the control cost for shortening the "
        "transfer time is too high when tf ≤ 0.1 ≈ 9min and meanwhile it cost the control accuracy.",
        lambda flown: comparisons.against_transfer_time(
            {periods: flown[f"initialization {periods:g}"] for periods in plan.TRANSFER_PERIODS}
        ),
    ),
    "5.6": Figure(
        "Position Kalman estimation (partial enlargement)",
        "Kalman filter performs good estimation in 3-axis position; otherwise, precise position control would not "
        "complete under the existence of noise.",
        lambda flown: panels.estimation(
            flown["keeping"], 0, (Window(12650, 12850), Window(0, 60000), Window(10000, 17000)), BLUE
        ),
    ),
    "5.7": Figure(
        "Control accuracy and consumption",
        "LQR controller parameters: Q = diag([1 1 1 1 1 1]), R = diag([1/n² 1/n² 1/n²]) ∗ a (a = 12000) to make the "
        "position error < 300m. […] control effort in z-axis is dominant which coincides the relative motion with the "
        "direction perpendicular to the reference orbit plane.",
        _keeping,
    ),
    "5.8": Figure(
        "Space circle formation relative trajectory (control accuracy 300m)",
        "Then we modify control-weighting matrix R, let the control accuracy reach 175 m for the comparison with the "
        "previous trajectory (Figure 5.8).",
        _path("keeping", 0, BLUE),
    ),
    "5.9": Figure(
        "Space circle formation relative trajectory (control accuracy 175m)",
        "Then we modify control-weighting matrix R, let the control accuracy reach 175 m (Figure 5.9) for the "
        "comparison with the previous trajectory.",
        _path("keeping", 1, BLUE),
    ),
    "5.10": Figure(
        "Control consumption vs. accuracy with different formation keeping time t",
        "In short-time formation keeping, the relationship between control consumption and accuracy can been roughly "
        "seen as a linear function.",
        _sweep,
    ),
    "5.11": Figure(
        "Position Kalman estimation under early communication failure (partial enlargement)",
        "In the beginning of the formation maintain, a communication failure happens with a time-span of about 3000 s. "
        "Follower keeps tracking with the desired trajectory with the state estimation provided by Kalman filter.",
        lambda flown: panels.estimation(
            flown["failure"], 0, (Window(0, 15000), Window(1000, 2500), Window(0, 60000)), BLUE
        ),
    ),
    "5.12": Figure(
        "Control accuracy and consumption under early communication failure",
        "The position displacement in three axes keeps increasing, although extra control effort has been made.",
        _one("failure", 0, "LQR", BLUE),
    ),
    "5.13": Figure(
        "Comparison of control accuracy and consumption",
        "With the early communication failure, maximum position error shoots up and its average value is over 60% "
        "larger than the value without communication failure.",
        _with_and_without,
    ),
    "5.14": Figure(
        "Control accuracy and consumption (SMC)",
        "The nonlinear controller can also make Follower’s tracking with Leader to the desired accuracy. And the huge "
        "control pulse is needed when large maneuver takes place.",
        _one("keeping", 2, "SMC", RED),
    ),
    "5.15": Figure(
        "Space circle formation keeping trajectory (SMC, accuracy 150m)",
        "Relative trajectory is shown in Figure 5.15 with 150 m accuracy.",
        _path("keeping", 2, RED),
    ),
    "5.16": Figure(
        "Comparison between LQR and SMC",
        "Around mean control accuracy 70 m, nonlinear controller does not have the advantage over LQR, and even with "
        "the same control effort, SMC is not able to provide better control accuracy.",
        _lqr_and_smc,
    ),
    "5.17": Figure(
        "Position Kalman estimation under early communication failure (SMC, partial enlargement)",
        "With communication failure, nonlinear SMC shows its power in governing system uncertainty. Figure 5.17 "
        "depicts the position estimation by Kalman filter.",
        lambda flown: panels.estimation(
            flown["failure"], 1, (Window(0, 6000), Window(2400, 3600), Window(0, 60000)), RED
        ),
    ),
    "5.18": Figure(
        "Control accuracy and consumption (SMC) under early communication failure",
        "Position error is effectively limited under the large uncertainty caused by early communication failure.",
        _one("failure", 1, "SMC", RED),
    ),
    "5.19": Figure(
        "Comparison between LQR and SMC (communication failure)",
        "With relative extra 10% consumption, SMC can provide more control accuracy (5% of system scale, 100% of the "
        "accuracy of LQR).",
        _failure_lqr_and_smc,
    ),
    "5.20": Figure(
        "Reconfiguration control accuracy and consumption",
        "Follower finds the maneuver path automatically switching from following flying to y-z circle formation. The "
        "maneuver time is about t = 0.4p.",
        _one("small position error", 0, "LQR", BLUE),
    ),
    "5.21": Figure(
        "Relative trajectory (small initial position error)",
        "The ”maneuver window” means that the entry point of the latter formation should be as close as possible to "
        "the former formation maneuver point.",
        _path("small position error", 0, BLUE),
    ),
    "5.22": Figure(
        "Relative trajectory (large initial position error)",
        "From control theory, it can be explained as finding a optimal initial state error.",
        _path("large position error", 0, BLUE),
    ),
    "5.23": Figure(
        "Relative trajectory (small initial velocity error)",
        "Moreover, Figure 5.23 and Figure 5.24 compare the initial velocity error’s effect on the formation "
        "reconfiguration.",
        _path("small velocity error", 0, BLUE),
    ),
    "5.24": Figure(
        "Relative trajectory (large initial velocity error)",
        "Definitely, relatively stationary state is best for maneuver so that the following flying orbit might be the "
        "optimal intermediate transfer orbit between two complex formation styles.",
        _path("large velocity error", 0, BLUE),
    ),
    "5.25": Figure(
        "Mission control accuracy and consumption",
        "Finally, we combine all the above scenarios control methods into a comprehensive formation mission with LQG "
        "methods.",
        _one("mission", 0, "LQR", BLUE),
    ),
    "5.26": Figure(
        "Mission trajectory",
        "The initial time and x-y ellipse keeping time are set to be 5.05p; the reconfiguration time and y-z circle "
        "keeping time are 5p too.",
        _path("mission", 0, BLUE),
    ),
    "5.27": Figure(
        "Mission phases trajectory",
        "The mission is divided as four phases: the first is the initialization to x-y ellipse formation; the second "
        "is the x-y formation keeping; then, the reconfiguration to y-z circle formation; the last is the y-z "
        "formation keeping.",
        _mission_phases,
    ),
}
"""By number. Figure 5.1 is a block diagram without numbers, so it is left out."""
