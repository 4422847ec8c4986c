"""The figures of chapters 3 and 5. To add one: a function below or beside, and a line in `FIGURES`."""

from baselines.thesis.figures.registry import FIGURES, Figure

__all__ = ["FIGURES", "Figure"]
