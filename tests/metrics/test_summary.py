import json
from dataclasses import replace

import numpy as np
import pytest

from hj_cosim.errors import MetricError
from hj_cosim.metrics.summary import count_lane_changes, summarize, timing
from hj_cosim.recording.summary_file import summary_text
from hj_cosim.scene.road import StraightRoad

KEYS = [
    "planner",
    "filter",
    "scheme",
    "seed",
    "scenario",
    "duration",
    "ended",
    "samples",
    "ttc_ge_3",
    "ttc_p10",
    "ttc_p1",
    "btn_le_1",
    "btn_p90",
    "stn_le_1",
    "stn_p90",
    "mean_speed",
    "mean_abs_acceleration",
    "intervention_percent",
    "collisions",
    "min_gap",
    "distance",
    "lane_changes",
]


def test_the_summary_has_the_keys_of_the_specification_in_order(record, config):
    assert list(summarize(record, config))[: len(KEYS)] == KEYS


def test_the_summary_says_what_the_record_holds(record, config):
    summary = summarize(record, config)

    assert (summary["planner"], summary["filter"], summary["scheme"], summary["seed"]) == ("hjop", "spc", "mi", 7)
    assert summary["duration"] == 4.0
    assert summary["samples"] == 200
    assert summary["ttc_ge_3"] == np.count_nonzero(record.threats.ttc >= 3.0) / 200
    assert summary["ttc_p10"] == sorted(record.threats.ttc)[19]
    assert summary["btn_p90"] == sorted(record.threats.btn)[180]
    assert summary["mean_speed"] == pytest.approx(record.robot.speed.mean())
    assert summary["distance"] == pytest.approx(24.0 * 199 * 0.02, rel=1e-3)
    assert summary["intervention_percent"] == pytest.approx(100 * np.mean(record.robot.value < 2.0))


def test_infinite_values_are_written_as_null(record, config):
    free = replace(record, threats=replace(record.threats, ttc=np.full(200, np.inf)))
    summary = summarize(free, config)
    assert summary["ttc_p10"] == np.inf
    assert json.loads(summary_text(summary))["ttc_p10"] is None


def test_wavering_at_a_line_is_no_lane_change_but_arriving_is():
    wavering = 2.0 + 0.5 * np.sin(np.linspace(0, 50, 500))
    crossing = np.linspace(0.0, 8.0, 200)
    there_and_back = np.concatenate([np.linspace(0.0, 2.5, 50), np.linspace(2.5, 0.0, 50)])
    assert count_lane_changes(np.zeros(len(wavering)), wavering, StraightRoad(4)) == 0
    assert count_lane_changes(np.zeros(len(crossing)), crossing, StraightRoad(4)) == 2
    assert count_lane_changes(np.zeros(len(there_and_back)), there_and_back, StraightRoad(4)) == 0


def test_what_depends_on_the_machine_is_no_part_of_the_summary(record, config):
    summary = summarize(record, config)
    assert timing(summary, 0.5) == {"wall_seconds": 0.5, "real_time_factor": 8.0}
    assert not timing(summary, 0.5).keys() & summary.keys()


def test_a_metric_without_a_declaration_is_refused(record, config):
    with pytest.raises(MetricError, match="no metric is declared as 'comfort'"):
        summarize(record, config, {"comfort": 1.0})
