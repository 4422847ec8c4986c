"""Parts of a scenario with several followers: what is safe, the links between them, and what each has of its own."""

from typing import Annotated, Final, Literal

from pydantic import Field, Strict

from formation_env.dropout import AnyDropout, NoDropout
from formation_env.dynamics.spacecraft import Spacecraft
from formation_env.navigation.filter_settings import KalmanFilter
from formation_env.navigation.sensor import Sensor
from formation_env.quantities import Distance, PositiveDistance
from formation_env.settings import NonNegative, settings

MAX_FOLLOWERS: Final = 12
"""A group's episode has a plan for each follower in each slot, so its tables grow with the square."""

Followers = Annotated[int, Strict(), Field(ge=1, le=MAX_FOLLOWERS)]
Neighbours = Annotated[int, Strict(), Field(ge=1, lt=MAX_FOLLOWERS)]


@settings
class Safety:
    """What counts as unsafe, and what ends an episode.

    Distances are those between two spacecraft, the leader included, and the least along each step's arc.

    Attributes:
        min_distance_m: a smaller distance costs 1 in `info["cost"]` for each follower and step; 0 for none.
        max_error_m: so does a position error above this during a hold; 0 for none.
        collision_distance_m: a smaller distance ends the episode; 0 for none.
        ends: whose episode ends with a collision, or beyond the scenario's limits: the `follower`'s, or that of the
            whole `group`.
        cost_budget: sum of the costs that an episode of a follower may have.
    """

    min_distance_m: Distance = 0.0
    max_error_m: Distance = 0.0
    collision_distance_m: Distance = 0.0
    ends: Literal["follower", "group"] = "group"
    cost_budget: NonNegative = 0.0


@settings
class InterSatelliteLink:
    """Links between followers: over each pair's link both send their estimate and its covariance at each instant.

    Attributes:
        range_m: true distance beyond which nothing is heard, m.
        dropout: when a link is down, for each pair by itself.
    """

    range_m: PositiveDistance = 50e3
    dropout: AnyDropout = NoDropout()


@settings
class FollowerSettings:
    """What one follower has of its own; each value left out is the scenario's.

    Attributes:
        spacecraft: the follower.
        sensor: its relative navigation.
        filter: its Kalman filter.
        dropout: when its measurements are lost.
    """

    spacecraft: Spacecraft | None = None
    sensor: Sensor | None = None
    filter: KalmanFilter | None = None
    dropout: AnyDropout | None = None
