"""How the metrics of an episode stand in tables for people."""

from dataclasses import dataclass


@dataclass(frozen=True)
class MetricColumn:
    """A metric's column.

    Attributes:
        heading: name in tables.
        unit: unit in tables.
        better: which values are better; None if neither is.
        factor: from the metric to the number in tables.
    """

    heading: str
    unit: str
    better: str | None
    factor: float = 1.0


METRIC_COLUMNS = {
    "return": MetricColumn("cost", "m/s", "higher", -1.0),
    "delta_v_m_s": MetricColumn("Δv", "m/s", "lower"),
    "position_error_mean_m": MetricColumn("mean error", "m", "lower"),
    "position_error_rms_m": MetricColumn("rms error", "m", "lower"),
    "position_error_max_m": MetricColumn("max error", "m", "lower"),
    "position_error_arrival_m": MetricColumn("arrival error", "m", "lower"),
    "position_error_final_m": MetricColumn("final error", "m", "lower"),
    "in_tolerance": MetricColumn("in tolerance", "% of hold", "higher", 100.0),
    "measurements_lost": MetricColumn("data lost", "%", None, 100.0),
}
