"""Communication dropouts. To add a model: a file with a `Dropout` subclass, and a line here."""

from typing import Annotated

from formation_env.dropout.base import Dropout
from formation_env.dropout.bernoulli import Bernoulli
from formation_env.dropout.gilbert_elliott import GilbertElliott
from formation_env.dropout.none import NoDropout
from formation_env.dropout.windows import Window, Windows
from formation_env.settings import OneOf

DROPOUTS: dict[str, type[Dropout]] = {
    "none": NoDropout,
    "windows": Windows,
    "bernoulli": Bernoulli,
    "gilbert_elliott": GilbertElliott,
}

AnyDropout = Annotated[Dropout, OneOf(DROPOUTS)]

__all__ = ["DROPOUTS", "AnyDropout", "Bernoulli", "Dropout", "GilbertElliott", "NoDropout", "Window", "Windows"]
