"""Every metric there is, declared once, in the order of summary.json and of the tables."""

from collections.abc import Iterable, Mapping

from hj_cosim.errors import MetricError
from hj_cosim.metrics.declaration import Fact, Metric, PercentileOfSamples
from hj_cosim.metrics.declared_driving import DRIVING_METRICS
from hj_cosim.metrics.declared_filter import FILTER_METRICS, METRICS_OF_MANY_EPISODES
from hj_cosim.metrics.declared_paper import PAPER_METRICS
from hj_cosim.metrics.declared_prediction import PREDICTION_METRICS

FACTS = (
    Fact("planner", "which planner drove"),
    Fact("filter", "which safety filter drove"),
    Fact("scheme", "what the filter did about what must hold: mi (minimal intervention) or sw (switching)"),
    Fact("seed", "of the traffic"),
    Fact("scenario", "the scenario's name"),
    Fact("duration", "recorded time; shorter than asked for if the drive ended early", "s"),
    Fact("ended", "why the drive was over: duration, collision, or what the world says"),
    Fact("samples", "recorded steps"),
)

# timing.json: what depends on the machine, so that everything else is the same for the same seed.
TIMING = (
    Fact("wall_seconds", "what the drive took, without writing and drawing", "s"),
    Fact("real_time_factor", "recorded time over wall time"),
)

METRICS: Mapping[str, Metric] = {
    metric.name: metric
    for metric in (*PAPER_METRICS, *DRIVING_METRICS, *FILTER_METRICS, *PREDICTION_METRICS, *METRICS_OF_MANY_EPISODES)
}
SUMMARY_KEYS = (
    *(fact.name for fact in FACTS),
    *(metric.name for metric in METRICS.values() if metric.is_of_an_episode),
)
SAMPLE_COLUMNS = tuple(
    dict.fromkeys(m.pooling.column for m in METRICS.values() if isinstance(m.pooling, PercentileOfSamples))
)


def require_declared(names: Iterable[str]) -> None:
    """Check that a summary holds declared metrics and facts only.

    Raises:
        MetricError: if one of them is not declared.
    """
    for name in names:
        if name not in SUMMARY_KEYS:
            raise MetricError(f"no metric is declared as {name!r}; declare it in hj_cosim.metrics.catalogue")


def shown_in_run() -> tuple[Metric, ...]:
    """Return the metrics that a run's table shows, in their order; see `Metric.shown`."""
    return tuple(metric for metric in METRICS.values() if metric.is_of_an_episode and metric.shown != "on demand")


def shown_in_study() -> tuple[Metric, ...]:
    """Return the metrics that have a column in a study's table in the terminal, in their order."""
    return tuple(metric for metric in METRICS.values() if metric.shown == "study")
