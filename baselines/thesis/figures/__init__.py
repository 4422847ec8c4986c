"""Figures of chapters 3 and 5. To add one: a drawing function, and an entry in `FIGURES`."""

from baselines.thesis.figures.registry import FIGURES, Figure

__all__ = ["FIGURES", "Figure"]
