"""The declarations: complete, and enough for whoever shows or pools a metric."""

import math

import pytest

from hj_cosim.errors import MetricError
from hj_cosim.metrics import catalogue
from hj_cosim.metrics.catalogue import FACTS, METRICS, SUMMARY_KEYS, TIMING, require_declared, shown_in_study
from hj_cosim.metrics.declaration import EpisodesWith, WeightedMean
from hj_cosim.metrics.declared_driving import DRIVING_METRICS
from hj_cosim.metrics.declared_filter import FILTER_METRICS, METRICS_OF_MANY_EPISODES
from hj_cosim.metrics.declared_paper import PAPER_METRICS
from hj_cosim.metrics.declared_prediction import PREDICTION_METRICS


def test_no_name_is_declared_twice():
    names = [
        entry.name
        for entry in (
            *FACTS,
            *TIMING,
            *PAPER_METRICS,
            *DRIVING_METRICS,
            *FILTER_METRICS,
            *PREDICTION_METRICS,
            *METRICS_OF_MANY_EPISODES,
        )
    ]
    assert len(names) == len(set(names))
    assert set(METRICS) | {fact.name for fact in (*FACTS, *TIMING)} == set(names)


@pytest.mark.parametrize("metric", METRICS.values(), ids=lambda metric: metric.name)
def test_every_declaration_can_be_shown_and_pooled(metric):
    assert metric.label
    assert metric.explanation
    assert metric.text(0.5)
    assert metric.pooling.text
    if isinstance(metric.pooling, WeightedMean):
        assert metric.pooling.by in SUMMARY_KEYS
    if isinstance(metric.pooling, EpisodesWith):
        assert metric.pooling.metric in SUMMARY_KEYS
        assert metric.name not in SUMMARY_KEYS


def test_every_column_of_a_studys_table_has_a_short_heading():
    assert all(0 < len(metric.heading) <= 10 for metric in shown_in_study())


def test_no_number_is_shown_as_a_dash():
    ttc = METRICS["ttc_p10"]
    assert (ttc.text(3.14159), ttc.text(math.inf), ttc.text(None)) == ("3.14", "–", "–")


def test_an_undeclared_name_is_refused():
    require_declared(SUMMARY_KEYS)
    with pytest.raises(MetricError, match="no metric is declared as 'wall_seconds'"):
        require_declared(["planner", "wall_seconds"])


def test_percentiles_are_of_columns_that_a_run_records(record):
    assert all(len(getattr(record.threats, column)) == len(record.time) for column in catalogue.SAMPLE_COLUMNS)
