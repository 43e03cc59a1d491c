"""What a metric is: its name, unit and format, which way is better, and how the metrics of many episodes become one.

Summary, terminal, tables, report and glossary follow from the declarations in `metrics.catalogue`.
"""

import math
from dataclasses import dataclass
from typing import Literal


@dataclass(frozen=True)
class WeightedMean:
    """The mean over episodes, each weighted by another of its metrics; by `samples` it is the mean over samples."""

    by: str

    @property
    def text(self) -> str:
        """Return how episodes are pooled, in words."""
        return "mean over all samples" if self.by == "samples" else f"mean over episodes, weighted by {self.by}"


@dataclass(frozen=True)
class PercentileOfSamples:
    """A percentile of a threat's column of robot.parquet over the samples of all episodes, a sample itself.

    There is no interpolation, for a time to collision may be infinite.
    """

    column: str
    percent: float
    upwards: bool  # the larger of the two neighbours is taken, the more dangerous one; else the smaller

    @property
    def method(self) -> Literal["lower", "higher"]:
        """Return the method of `numpy.percentile` that takes that neighbour."""
        return "higher" if self.upwards else "lower"

    @property
    def text(self) -> str:
        """Return how episodes are pooled, in words."""
        return "percentile of all samples"


@dataclass(frozen=True)
class EpisodesWith:
    """The number of episodes in which another metric is above zero; no metric of one episode."""

    metric: str

    @property
    def text(self) -> str:
        """Return how episodes are pooled, in words."""
        return f"episodes with {self.metric} above 0"


@dataclass(frozen=True)
class OverEpisodes:
    """The mean over episodes, the sum, the smallest or the largest."""

    of: Literal["mean", "sum", "smallest", "largest"]

    @property
    def text(self) -> str:
        """Return how episodes are pooled, in words."""
        return f"{self.of} over episodes"


Pooling = WeightedMean | PercentileOfSamples | OverEpisodes | EpisodesWith

MEAN_OVER_SAMPLES = WeightedMean("samples")
MEAN_OVER_EPISODES = OverEpisodes("mean")
SUM_OVER_EPISODES = OverEpisodes("sum")
SMALLEST = OverEpisodes("smallest")
LARGEST = OverEpisodes("largest")

Better = Literal["higher", "lower", "neither"]
Shown = Literal["study", "run", "where it happened", "on demand"]


@dataclass(frozen=True)
class Metric:
    """A number that says something about an episode, and about many."""

    name: str  # the key in summary.json and the column in the tables
    label: str  # what it is, for people
    unit: str  # "" of a number without one
    format: str  # of `format`, for example ".2f"
    better: Better
    pooling: Pooling
    explanation: str  # one sentence
    shown: Shown = "on demand"  # in a study's table and a run's, in a run's, there where it is not 0, or in files only
    heading: str = ""  # of a narrow column; needed where it is shown in a study's table
    leaves_first: int = 0  # where a terminal is too narrow for a study's table, the largest number is left out first

    @property
    def is_of_an_episode(self) -> bool:
        """Whether summary.json has it; else it is about many episodes only."""
        return not isinstance(self.pooling, EpisodesWith)

    @property
    def label_with_unit(self) -> str:
        """Return the label as axes and headings have it."""
        return f"{self.label} ({self.unit})" if self.unit else self.label

    def text(self, value: float | None) -> str:
        """Return a value as it is shown; a dash where there is none (no car was ever approached)."""
        return "–" if value is None or not math.isfinite(value) else format(value, self.format)


@dataclass(frozen=True)
class Fact:
    """What an episode was, or what the machine took for it; no result, and so never pooled."""

    name: str
    explanation: str
    unit: str = ""
