"""How much effort a report is worth."""

from dataclasses import dataclass, field

from baselines.controllers.registry import reference_policies, slow_policies


@dataclass(frozen=True)
class Wanted:
    """What to fly for a report.

    Attributes:
        episodes: test seeds of each environment.
        slow_episodes: of these the first ones, for slow policies.
        sweep_episodes: test seeds of each point of fronts and robustness; 0 leaves them out.
        sweep_bound_episodes: of these, seeds of the bound's front.
        coarse: whether a sweep has a few values of each quantity only.
        resume: whether finished flights are kept, and those that were kept are not flown again.
        slow: labels of the slow policies.
        unswept: labels of the policies that fronts and robustness leave out.
    """

    episodes: int = 100
    slow_episodes: int = 5
    sweep_episodes: int = 10
    sweep_bound_episodes: int = 2
    coarse: bool = True
    resume: bool = False
    slow: tuple[str, ...] = field(default_factory=slow_policies)
    unswept: tuple[str, ...] = field(default_factory=lambda: (*slow_policies(), *reference_policies()))
