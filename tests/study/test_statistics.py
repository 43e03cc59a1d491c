import math

import numpy as np
import pytest

from hj_cosim.errors import MetricError
from hj_cosim.metrics.catalogue import SAMPLE_COLUMNS
from hj_cosim.metrics.summary import summarize
from hj_cosim.settings import EpisodeConfig, PlannerSettings, Scenario
from hj_cosim.study.statistics import EpisodeResult, RowStatistics, replicates

PAPERS = ("ttc_ge_3", "ttc_p10", "ttc_p1", "btn_le_1", "btn_p90", "stn_le_1", "stn_p90", "mean_speed")


@pytest.fixture
def drive(synthetic):
    """Make the result of a seed's synthetic episode, of so many samples, and its record."""

    def drive_it(seed, planner="hjop", samples=1000):
        config = EpisodeConfig(seed=seed, planner=PlannerSettings(kind=planner), scenario=Scenario(name="synthetic"))
        record = synthetic.synthetic_record(config, samples)
        columns = {name: getattr(record.threats, name) for name in SAMPLE_COLUMNS}
        return EpisodeResult(seed, summarize(record, config), columns), record

    return drive_it


def test_one_episode_has_its_own_summary_for_statistics(drive):
    result, _ = drive(3, "op")
    estimates = RowStatistics([result]).estimates()
    for name, estimate in estimates.items():
        expected = min(result.summary["collisions"], 1) if name == "collision_episodes" else result.summary[name]
        assert estimate.value == pytest.approx(expected, rel=1e-12), name
        assert np.isnan([estimate.low, estimate.high]).all(), name  # one episode has no spread


def test_the_papers_metrics_are_over_all_samples_of_episodes_of_any_length(drive):
    results, records = zip(*(drive(seed, "op", samples) for seed, samples in enumerate([1000, 300, 650])), strict=True)
    estimates = RowStatistics(results).estimates()
    pooled = {name: np.concatenate([getattr(r.threats, name) for r in records]) for name in SAMPLE_COLUMNS}
    assert estimates["ttc_ge_3"].value == pytest.approx(np.mean(pooled["ttc"] >= 3.0))
    assert estimates["ttc_p10"].value == np.percentile(pooled["ttc"], 10, method="lower")
    assert estimates["ttc_p1"].value == np.percentile(pooled["ttc"], 1, method="lower")
    assert estimates["btn_le_1"].value == pytest.approx(np.mean(pooled["btn"] <= 1.0))
    assert estimates["btn_p90"].value == np.percentile(pooled["btn"], 90, method="higher")
    assert estimates["stn_p90"].value == np.percentile(pooled["stn"], 90, method="higher")
    speeds = np.concatenate([record.robot.speed for record in records])
    assert estimates["mean_speed"].value == pytest.approx(speeds.mean())
    intervening = np.concatenate([record.robot.intervening for record in records])
    assert estimates["intervention_percent"].value == pytest.approx(100.0 * intervening.mean())
    assert estimates["min_gap"].value == min(record.threats.min_gap.min() for record in records)
    assert estimates["distance"].value == pytest.approx(np.mean([result.summary["distance"] for result in results]))


def test_replicates_are_the_statistics_of_the_repeated_episodes(drive):
    results = [drive(seed, "op", 200 + 50 * seed)[0] for seed in range(4)]
    drawn = replicates(results, np.array([[0, 2, 1, 1]]))
    chosen = [results[1], results[1], results[2], results[3]]
    repeated = replicates(chosen, np.ones((1, 4), int))
    assert drawn.keys() == repeated.keys()
    for name in drawn:
        assert drawn[name][0] == pytest.approx(repeated[name][0], rel=1e-12), name


def test_collisions_are_added_up_and_the_episodes_with_one_counted(drive):
    results = [drive(seed)[0] for seed in range(3)]
    crashes = [
        EpisodeResult(r.seed, {**r.summary, "collisions": n}, r.samples)
        for r, n in zip(results, (0, 3, 1), strict=True)
    ]
    estimates = RowStatistics(crashes).estimates()
    assert estimates["collisions"].value == 4
    assert estimates["collision_episodes"].value == 2
    assert estimates["collision_episodes"].low == 0
    assert estimates["collision_episodes"].high == 3


def test_an_infinite_value_of_an_episode_that_is_not_drawn_does_no_harm(drive):
    results = [drive(seed)[0] for seed in range(2)]
    alone = EpisodeResult(1, {**results[1].summary, "distance": math.inf}, results[1].samples)
    drawn = replicates([results[0], alone], np.array([[2, 0], [1, 1]]))
    assert drawn["distance"][0] == results[0].summary["distance"]
    assert drawn["distance"][1] == math.inf


def test_every_interval_holds_the_value(drive):
    for estimate in RowStatistics([drive(seed, "op")[0] for seed in range(12)]).estimates().values():
        assert estimate.low <= estimate.value <= estimate.high


def test_a_paired_interval_is_far_narrower_than_the_unpaired_one(drive):
    """The leader's speed varies from seed to seed by more than the planners differ, but is the same for both."""
    hjop = RowStatistics([drive(seed, "hjop")[0] for seed in range(20)])
    op = RowStatistics([drive(seed, "op")[0] for seed in range(20)])
    seeds, differences = op.differences(hjop)
    assert seeds == 20
    speed = differences["mean_speed"]
    assert speed.value == pytest.approx(3.0, abs=0.05)
    assert speed.low > 2.9
    paired = differences["ttc_p10"].high - differences["ttc_p10"].low
    own = op.estimates()["ttc_p10"].high - op.estimates()["ttc_p10"].low
    other = hjop.estimates()["ttc_p10"].high - hjop.estimates()["ttc_p10"].low
    assert paired < math.hypot(own, other)


def test_differences_are_over_the_common_seeds_only(drive):
    first = RowStatistics([drive(seed, "op")[0] for seed in (0, 1, 2, 5)])
    second = RowStatistics([drive(seed)[0] for seed in (1, 2, 3, 5)])
    seeds, differences = first.differences(second)
    assert seeds == 3
    common = (1, 2, 5)
    expected = np.mean([drive(s, "op")[0].summary["distance"] - drive(s)[0].summary["distance"] for s in common])
    assert differences["distance"].value == pytest.approx(expected)


def test_a_row_does_not_differ_from_itself_even_where_it_is_infinite(drive):
    results = [drive(seed)[0] for seed in range(4)]
    never_near = [
        EpisodeResult(r.seed, r.summary, {**r.samples, "ttc": np.full(len(r.samples["ttc"]), np.inf)}) for r in results
    ]
    _, differences = RowStatistics(never_near).differences(RowStatistics(never_near))
    assert all((d.value, d.low, d.high) == (0.0, 0.0, 0.0) for d in differences.values())


def test_rows_without_episodes_have_no_statistics(drive):
    empty = RowStatistics([])
    assert empty.estimates() == {}
    assert empty.differences(RowStatistics([drive(0)[0]])) == (0, {})


def with_metrics(result, **values):
    return EpisodeResult(result.seed, {**result.summary, **values}, result.samples)


def test_a_kept_promise_counts_as_often_as_it_was_given(drive):
    results = [drive(seed)[0] for seed in range(2)]
    pooled = RowStatistics(
        [
            with_metrics(results[0], promise_kept_percent=100.0, promise_samples=0),
            with_metrics(results[1], promise_kept_percent=50.0, promise_samples=100),
        ]
    )
    assert pooled.estimates()["promise_kept_percent"].value == 50.0
    nothing = RowStatistics([with_metrics(result, promise_kept_percent=100.0, promise_samples=0) for result in results])
    assert nothing.estimates()["promise_kept_percent"].value == 100.0


def test_a_metric_that_nobody_declared_cannot_be_pooled(drive):
    with pytest.raises(MetricError, match="no metric is declared as 'comfort'"):
        RowStatistics([with_metrics(drive(0)[0], comfort=1.0)]).estimates()
