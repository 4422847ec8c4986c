"""Effort of a report: how many episodes and sweeps it flies."""

from dataclasses import dataclass, field

from baselines.controllers.registry import reference_policies, slow_policies


@dataclass(frozen=True, kw_only=True)
class ReportOptions:
    """Effort of a report.

    Attributes:
        episodes: test seeds of each environment.
        slow_episodes: slow policies fly the first so many of them.
        sweep_episodes: test seeds of each point of trade-off and robustness; 0 leaves both out.
        sweep_bound_episodes: seeds, among them, for which the trade-off bound is solved; 0 disables it.
        coarse: whether a sweep takes only a few values of each quantity.
        resume: whether finished jobs are cached, and cached ones are not run again.
        slow: labels of the slow policies.
        unswept: labels of the policies without trade-off and robustness.
    """

    episodes: int = 100
    slow_episodes: int = 5
    sweep_episodes: int = 10
    sweep_bound_episodes: int = 2
    coarse: bool = True
    resume: bool = False
    slow: tuple[str, ...] = field(default_factory=slow_policies)
    unswept: tuple[str, ...] = field(default_factory=lambda: (*slow_policies(), *reference_policies()))
