"""Drawings of the figures of chapter 5 from the flights of `baselines.thesis.figure_flights`."""

from collections.abc import Callable, Mapping

from matplotlib.figure import Figure

from baselines.thesis import figure_flights
from baselines.thesis.figures import comparisons, panels, paths, style
from baselines.thesis.figures.comparisons import Course
from baselines.thesis.figures.panels import Line
from baselines.thesis.flight_recorder import whole_periods
from baselines.thesis.recorded_flights import Flights

Flown = Mapping[str, Flights]
Draw = Callable[[Flown], Figure]

LQR, TIGHTER, SMC = (
    figure_flights.KEEPING.index(law) for law in (figure_flights.LQR, figure_flights.TIGHTER, figure_flights.SMC)
)
FAILED_LQR, FAILED_SMC = (figure_flights.FAILURE.index(law) for law in (figure_flights.LQR, figure_flights.SMC))
CORRECTED_LQR, CORRECTED_TRACKING = (
    figure_flights.CORRECTED.index(law) for law in (figure_flights.LQR, figure_flights.TRACKING)
)
WEIGHTS = [figure_flights.KEEPING.index(law) for law in figure_flights.WEIGHTS]
BLUE, RED, SKY = (style.COLORS[name] for name in ("lqr", "smc", "lqr_quasi_static"))


def initialization(flown: Flown, periods: str) -> Figure:
    """Four panels of a following initialization."""
    return panels.four_panels([Line("tracking LQR", flown[f"initialization {periods}"], 0, SKY)])


def keeping(flown: Flown) -> Figure:
    """Four panels of LQR with k as printed and with its n."""
    return panels.four_panels(
        [
            Line("LQR, k as printed", flown["keeping"], LQR, BLUE),
            Line("LQR, k with its n", flown["corrected"], CORRECTED_LQR, "black", "--"),
        ]
    )


def one_flight(name: str, policy: int, label: str, color: str) -> Draw:
    """Four panels of one policy of one job."""
    return lambda flown: panels.four_panels([Line(label, flown[name], policy, color)])


def one_path(name: str, policy: int, color: str) -> Draw:
    """Trajectory of one policy of one job."""
    return lambda flown: paths.flight_path(flown[name], policy, color)


def weights(flown: Flown) -> Figure:
    """Consumption against accuracy of all LQR weights."""
    flown_periods = whole_periods(flown["keeping"].scenario)
    return comparisons.trade(
        flown["keeping"], WEIGHTS, [time for time in figure_flights.KEEPING_PERIODS if time in flown_periods]
    )


def with_and_without_failure(flown: Flown) -> Figure:
    """LQR with and without communication failure."""
    return comparisons.over_time(
        [
            Course("with communication failure", flown["failure"], FAILED_LQR, "black", "s"),
            Course("without communication failure", flown["keeping"], LQR, BLUE, "o"),
        ]
    )


def nearest_lqr(keeping: Flights) -> Course:
    """LQR whose mean error on the space circle is nearest to SMC's."""
    means = keeping.mean_error().mean(axis=1)
    policy = min(WEIGHTS, key=lambda index: abs(means[index] - means[SMC]))
    return Course("LQR of nearest mean accuracy", keeping, policy, BLUE, "o")


def lqr_and_smc(flown: Flown) -> Figure:
    """SMC beside an LQR of the same accuracy."""
    return comparisons.in_space([nearest_lqr(flown["keeping"]), Course("SMC", flown["keeping"], SMC, RED, "s")])


def lqr_and_smc_in_failure(flown: Flown) -> Figure:
    """LQR and SMC, both with communication failure."""
    return comparisons.over_time(
        [Course("LQR", flown["failure"], FAILED_LQR, BLUE, "o"), Course("SMC", flown["failure"], FAILED_SMC, RED, "s")]
    )


def mission_phases(flown: Flown) -> Figure:
    """Trajectory of each phase of the mission."""
    return paths.phase_paths(
        flown["mission"],
        0,
        [
            ("1 Initialization", 0.0, 0.5),
            ("2 x-y ellipse keeping", 0.5, 5.05),
            ("3 Reconfiguration", 5.05, 5.45),
            ("4 y-z circle keeping", 5.45, 10.05),
        ],
        BLUE,
    )
