"""Registry of the figures, each with the statement of the thesis that it supports.

To add a figure: a function that draws it from the flights of `baselines.thesis.figure_flights`, and an entry in
`FIGURES`.
"""

from dataclasses import dataclass
from typing import Final

from baselines.thesis import figure_flights
from baselines.thesis.figures import comparisons, drawings, orbits, panels
from baselines.thesis.figures.drawings import BLUE, FAILED_LQR, FAILED_SMC, LQR, RED, SKY, SMC, TIGHTER, Draw, Flown
from baselines.thesis.figures.notes import NOTES
from baselines.thesis.figures.panels import TimeSpan
from formation_env.formations import ProjectedCircle, SpaceCircle, XYEllipse


@dataclass(frozen=True)
class Figure:
    """A redrawn figure of the thesis.

    Attributes:
        title: what it shows.
        sentence: of the thesis, which it supports.
        draw: draws it from the flights.
    """

    title: str
    sentence: str
    draw: Draw

    def note(self, number: str, flown: Flown) -> str:
        """Outcome in a sentence or two; empty if there is none."""
        return NOTES[number](flown) if number in NOTES else ""


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
        lambda flown: drawings.initialization(flown, "0.5"),
    ),
    "5.3": Figure(
        "Control accuracy and consumption (tf = 0.1p)",
        "Then, with the transfer time tf = 0.1p and the same LQR control parameters, more control effort is needed to "
        "realize the initialization process. Moreover, the control accuracy decreases if control parameters keeps the "
        "same with the previous one.",
        lambda flown: drawings.initialization(flown, "0.1"),
    ),
    "5.4": Figure(
        "Following initialization relative trajectory (tf = 0.1p)",
        "It indicates that with the LQR controller, Follower can track the pre-designed motion under the "
        "perturbations.",
        drawings.one_path("initialization 0.1", 0, SKY),
    ),
    "5.5": Figure(
        "Control accuracy/consumption vs. time",
        "Thus, the optimal initialization time is between 0.2p and 0.8p, because the control cost for shortening the "
        "transfer time is too high when tf ≤ 0.1 ≈ 9min and meanwhile it cost the control accuracy.",
        lambda flown: comparisons.against_transfer_time(
            {periods: flown[f"initialization {periods:g}"] for periods in figure_flights.TRANSFER_PERIODS}, SKY
        ),
    ),
    "5.6": Figure(
        "Position Kalman estimation (partial enlargement)",
        "Kalman filter performs good estimation in 3-axis position; otherwise, precise position control would not "
        "complete under the existence of noise.",
        lambda flown: panels.estimation(
            flown["keeping"], LQR, (TimeSpan(12650, 12850), TimeSpan(0, 60000), TimeSpan(10000, 17000)), BLUE
        ),
    ),
    "5.7": Figure(
        "Control accuracy and consumption",
        "LQR controller parameters: Q = diag([1 1 1 1 1 1]), R = diag([1/n⁻² 1/n² 1/n²] ∗ a) (a = 12000) to make the "
        "position error < 300m. […] control effort in z-axis is dominant which coincides the relative motion with the "
        "direction perpendicular to the reference orbit plane.",
        drawings.keeping,
    ),
    "5.8": Figure(
        "Space circle formation relative trajectory (control accuracy 300m)",
        "Then we modify control-weighting matrix R, let the control accuracy reach 175 m for the comparison with the "
        "previous trajectory (Figure 5.8).",
        drawings.one_path("keeping", LQR, BLUE),
    ),
    "5.9": Figure(
        "Space circle formation relative trajectory (control accuracy 175m)",
        "Then we modify control-weighting matrix R, let the control accuracy reach 175 m (Figure 5.9) for the "
        "comparison with the previous trajectory.",
        drawings.one_path("keeping", TIGHTER, BLUE),
    ),
    "5.10": Figure(
        "Control consumption vs. accuracy with different formation keeping time t",
        "In short-time formation keeping, the relationship between control consumption and accuracy can been roughly "
        "seen as a linear function.",
        drawings.weights,
    ),
    "5.11": Figure(
        "Position Kalman estimation under early communication failure (partial enlargement)",
        "In the beginning of the formation maintain, a communication failure happens with a time-span of about 3000 s. "
        "Follower keeps tracking with the desired trajectory with the state estimation provided by Kalman filter.",
        lambda flown: panels.estimation(
            flown["failure"], FAILED_LQR, (TimeSpan(0, 15000), TimeSpan(1000, 2500), TimeSpan(0, 60000)), BLUE
        ),
    ),
    "5.12": Figure(
        "Control accuracy and consumption under early communication failure",
        "The position displacement in three axes keeps increasing, although extra control effort has been made.",
        drawings.one_flight("failure", FAILED_LQR, "LQR", BLUE),
    ),
    "5.13": Figure(
        "Comparison of control accuracy and consumption",
        "With the early communication failure, maximum position error shoots up and its average value is over 60% "
        "larger than the value without communication failure.",
        drawings.with_and_without_failure,
    ),
    "5.14": Figure(
        "Control accuracy and consumption (SMC)",
        "The nonlinear controller can also make Follower’s tracking with Leader to the desired accuracy. And the huge "
        "control pulse is needed when large maneuver takes place.",
        drawings.one_flight("keeping", SMC, "SMC", RED),
    ),
    "5.15": Figure(
        "Space circle formation keeping trajectory (SMC, accuracy 150m)",
        "Relative trajectory is shown in Figure 5.15 with 150 m accuracy.",
        drawings.one_path("keeping", SMC, RED),
    ),
    "5.16": Figure(
        "Comparison between LQR and SMC",
        "Around mean control accuracy 70 m, nonlinear controller does not have the advantage over LQR, and even with "
        "the same control effort, SMC is not able to provide better control accuracy.",
        drawings.lqr_and_smc,
    ),
    "5.17": Figure(
        "Position Kalman estimation under early communication failure (SMC, partial enlargement)",
        "With communication failure, nonlinear SMC shows its power in governing system uncertainty. Figure 5.17 "
        "depicts the position estimation by Kalman filter.",
        lambda flown: panels.estimation(
            flown["failure"], FAILED_SMC, (TimeSpan(0, 6000), TimeSpan(2400, 3600), TimeSpan(0, 60000)), RED
        ),
    ),
    "5.18": Figure(
        "Control accuracy and consumption (SMC) under early communication failure",
        "Position error is effectively limited under the large uncertainty caused by early communication failure.",
        drawings.one_flight("failure", FAILED_SMC, "SMC", RED),
    ),
    "5.19": Figure(
        "Comparison between LQR and SMC (communication failure)",
        "With relative extra 10% consumption, SMC can provide more control accuracy (5% of system scale, 100% of the "
        "accuracy of LQR).",
        drawings.lqr_and_smc_in_failure,
    ),
    "5.20": Figure(
        "Reconfiguration control accuracy and consumption",
        "Follower finds the maneuver path automatically switching from following flying to y-z circle formation. The "
        "maneuver time is about t = 0.4p.",
        drawings.one_flight("small position error", 0, "LQR", BLUE),
    ),
    "5.21": Figure(
        "Relative trajectory (small initial position error)",
        "The ”maneuver window” means that the entry point of the latter formation should be as close as possible to "
        "the former formation maneuver point.",
        drawings.one_path("small position error", 0, BLUE),
    ),
    "5.22": Figure(
        "Relative trajectory (large initial position error)",
        "From control theory, it can be explained as finding a optimal initial state error.",
        drawings.one_path("large position error", 0, BLUE),
    ),
    "5.23": Figure(
        "Relative trajectory (small initial velocity error)",
        "Moreover, Figure 5.23 and Figure 5.24 compare the initial velocity error’s effect on the formation "
        "reconfiguration.",
        drawings.one_path("small velocity error", 0, BLUE),
    ),
    "5.24": Figure(
        "Relative trajectory (large initial velocity error)",
        "Definitely, relatively stationary state is best for maneuver so that the following flying orbit might be the "
        "optimal intermediate transfer orbit between two complex formation styles.",
        drawings.one_path("large velocity error", 0, BLUE),
    ),
    "5.25": Figure(
        "Mission control accuracy and consumption",
        "Finally, we combine all the above scenarios control methods into a comprehensive formation mission with LQG "
        "methods.",
        drawings.one_flight("mission", 0, "LQR", BLUE),
    ),
    "5.26": Figure(
        "Mission trajectory",
        "The initial time and x-y ellipse keeping time are set to be 5.05p; the reconfiguration time and y-z circle "
        "keeping time are 5p too.",
        drawings.one_path("mission", 0, BLUE),
    ),
    "5.27": Figure(
        "Mission phases trajectory",
        "The mission is divided as four phases: the first is the initialization to x-y ellipse formation; the second "
        "is the x-y formation keeping; then, the reconfiguration to y-z circle formation; the last is the y-z "
        "formation keeping.",
        drawings.mission_phases,
    ),
}
"""Figures by number. Figure 5.1 is a block diagram and is omitted."""
