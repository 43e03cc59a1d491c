"""The reliability of beliefs, against counting by hand; and that a record is enough to believe by."""

from dataclasses import replace

import numpy as np
import pytest
from synthetic_runs import random_record

from hj_cosim.settings import DriverSettings, NormalDistribution
from hj_cosim.verification.belief_calibration import _binned, beliefs_of, reliability


def test_bins_hold_what_was_said_and_what_is_so():
    said = np.array([0.0, 0.1, 0.25, 0.5, 0.9, 1.0])
    are = np.array([False, False, True, False, True, True])
    low, middle, high = _binned(said, are, (0.0, 0.25, 0.75, 1.0))
    assert (low.count, low.said, low.are) == (2, pytest.approx(0.05), 0.0)
    assert (middle.count, middle.said, middle.are) == (2, pytest.approx(0.375), 0.5)
    assert (high.count, high.said, high.are) == (2, pytest.approx(0.95), 1.0)  # a belief of 1 has a place, too


def test_an_empty_bin_says_nothing():
    (bin_,) = _binned(np.empty(0), np.empty(0, bool), (0.0, 1.0))
    assert bin_.count == 0
    assert np.isnan(bin_.said)
    assert np.isnan(bin_.are)


def test_beliefs_are_those_of_looks_ten_times_a_second_at_who_is_there():
    record = random_record(samples=101, cars=6)
    samples, belief = beliefs_of(record)
    assert samples.tolist() == list(range(0, 101, 5))
    assert (np.isfinite(belief) == record.traffic.present[samples]).all()


def test_reliability_counts_near_cars_by_whether_they_are_rogues():
    record = replace(random_record(samples=60, cars=6), rogues={"car0": "worst"})
    samples, belief = beliefs_of(record)
    away = np.abs(record.traffic.x[samples] - record.robot.x[samples][:, None])
    near = record.traffic.present[samples] & (away <= 100.0)
    (whole,) = reliability([record], edges=(0.0, 1.0))
    assert whole.count == near.sum()
    assert whole.are == pytest.approx(near[:, 0].sum() / near.sum())
    assert whole.said == pytest.approx(belief[near].mean())


def test_who_drives_as_the_scenario_says_is_not_suspected_for_it():
    record = random_record(samples=60, cars=6)
    hurried = DriverSettings(desired_speed=NormalDistribution(mean=40.0, deviation=1.0))
    expected, told = (beliefs_of(record, drivers)[1] for drivers in (DriverSettings(), hurried))
    assert not np.array_equal(expected, told, equal_nan=True)
    assert reliability([record], edges=(0.0, 1.0), drivers=hurried)[0].said == pytest.approx(
        told[np.isfinite(told) & _near(record)].mean()
    )


def _near(record):
    samples = np.arange(0, 60, 5)
    return np.abs(record.traffic.x[samples] - record.robot.x[samples][:, None]) <= 100.0
