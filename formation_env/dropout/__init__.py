"""Communication dropouts.

To add a model: a file with a `Dropout` subclass and a line here, or `register_dropout` from outside the package.
"""

from typing import Annotated, TypeVar

from formation_env.dropout.base import Dropout
from formation_env.dropout.bernoulli import Bernoulli
from formation_env.dropout.gilbert_elliott import GilbertElliott
from formation_env.dropout.none import NoDropout
from formation_env.dropout.windows import Window, Windows
from formation_env.settings import OneOf, register

D = TypeVar("D", bound=Dropout)

DROPOUTS: dict[str, type[Dropout]] = {
    "none": NoDropout,
    "windows": Windows,
    "bernoulli": Bernoulli,
    "gilbert_elliott": GilbertElliott,
}

AnyDropout = Annotated[Dropout, OneOf(DROPOUTS)]


def register_dropout(cls: type[D]) -> type[D]:
    """Register a dropout model under its `kind`, so that scenario files may name it; usable as a decorator.

    Args:
        cls: a `Dropout` subclass made with `settings`, with a field such as `kind: Literal["jammed"] = "jammed"`.

    Raises:
        ValueError: the class is no such subclass, or another model has this kind.
    """
    register(DROPOUTS, cls, Dropout)
    return cls


__all__ = [
    "DROPOUTS",
    "AnyDropout",
    "Bernoulli",
    "Dropout",
    "GilbertElliott",
    "NoDropout",
    "Window",
    "Windows",
    "register_dropout",
]
