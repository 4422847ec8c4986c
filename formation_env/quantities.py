"""Physical quantities of settings, with upper bounds far beyond any spacecraft in orbit about the Earth.

The bounds keep every number of an episode finite: squares of distances, sums of rewards, logarithms in observations.
"""

from typing import Annotated, Final

from pydantic import Field

from formation_env.settings import NonNegative, Positive, Real

MAX_DISTANCE_M: Final = 1e9
"""Radius of the Earth's sphere of influence, 9.2e8 m, rounded up."""
MAX_SPEED_M_S: Final = 3e8
"""The speed of light; a sensor that says nothing of the velocity is often given a sigma of 1e6 m/s."""
MAX_ACCEL_M_S2: Final = 1e3
"""A hundred g, beyond any spacecraft's structure."""
MAX_THRUST_NOISE: Final = 1.0
"""A relative error of 100 %, 1-sigma: beyond it the thruster pushes backwards as a rule."""
MAX_DURATION_S: Final = 1e9
"""Thirty years, beyond any mission."""
MAX_ORBITS: Final = 1e9
"""Orbital periods: more than two hundred thousand years."""
MAX_ERROR_WEIGHT: Final = 1e6
"""(m/s) per m: a metre of error would cost more than any spacecraft's delta-v."""
MIN_ERROR_SCALE_M: Final = 1e-3
"""A millimetre, below the noise of any relative navigation."""
MIN_MASS_KG: Final = 1e-3
"""A gram, less than the smallest satellite on a chip."""
MAX_MASS_KG: Final = 1e7
"""Twenty times the International Space Station."""
MAX_AREA_M2: Final = 1e6
"""A square kilometre, larger than any solar sail."""
MAX_COEFFICIENT: Final = 100.0
"""Drag and radiation coefficients are about 2."""
MAX_DENSITY_KG_M3: Final = 1e-4
"""More than a hundred times the air's density at the lowest altitude that is accepted, 100 km."""

Distance = Annotated[NonNegative, Field(le=MAX_DISTANCE_M)]
PositiveDistance = Annotated[Positive, Field(le=MAX_DISTANCE_M)]
Speed = Annotated[NonNegative, Field(le=MAX_SPEED_M_S)]
Acceleration = Annotated[NonNegative, Field(le=MAX_ACCEL_M_S2)]
PositiveAcceleration = Annotated[Positive, Field(le=MAX_ACCEL_M_S2)]
ThrustNoise = Annotated[NonNegative, Field(le=MAX_THRUST_NOISE)]
Coordinate = Annotated[Real, Field(ge=-MAX_DISTANCE_M, le=MAX_DISTANCE_M)]
VelocityComponent = Annotated[Real, Field(ge=-MAX_SPEED_M_S, le=MAX_SPEED_M_S)]
Mass = Annotated[Positive, Field(ge=MIN_MASS_KG, le=MAX_MASS_KG)]
Area = Annotated[NonNegative, Field(le=MAX_AREA_M2)]
Coefficient = Annotated[NonNegative, Field(le=MAX_COEFFICIENT)]
AirDensity = Annotated[NonNegative, Field(le=MAX_DENSITY_KG_M3)]
Duration = Annotated[NonNegative, Field(le=MAX_DURATION_S)]
PositiveDuration = Annotated[Positive, Field(le=MAX_DURATION_S)]
PositiveOrbits = Annotated[Positive, Field(le=MAX_ORBITS)]
ErrorWeight = Annotated[NonNegative, Field(le=MAX_ERROR_WEIGHT)]
ErrorScale = Annotated[Positive, Field(ge=MIN_ERROR_SCALE_M, le=MAX_DISTANCE_M)]
