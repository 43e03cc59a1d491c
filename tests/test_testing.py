"""The suites for implementers: ours pass them, and each mistake that they look for fails in a sentence."""

import dataclasses
import math

import numpy as np
import pytest

from hj_cosim.control.contract import FilterDecision
from hj_cosim.planning.contract import Plan
from hj_cosim.scene.observation import Control, Target
from hj_cosim.settings import CarStart, FilterSettings, PlannerSettings, RobotSettings
from hj_cosim.testing import ContractError, check_filter, check_planner, check_world
from hj_cosim.traffic.fake import FakeWorld
from hj_cosim.traffic.sources.scenarios import load_scenario
from hj_cosim.traffic.sumo.world import SumoWorld


@pytest.mark.parametrize("kind", ["hjop", "op", "mppi", "idle"])
def test_our_planners_pass(kind):
    options = {"samples": 16, "horizon": 1.0} if kind == "mppi" else {}
    check_planner(kind, PlannerSettings(expansions=20, options=options))


@pytest.mark.parametrize("scheme", ["mi", "sw"])
@pytest.mark.parametrize("kind", ["spc", "rss", "none"])
def test_our_filters_pass(kind, scheme):
    check_filter(kind, FilterSettings(scheme=scheme, keep_escape=True))


def test_our_world_without_sumo_passes():
    cars = [CarStart(lane=0, x=30.0, speed=20.0), CarStart(lane=2, x=-10.0, speed=25.0)]
    check_world(lambda: FakeWorld(cars))
    check_world(lambda: FakeWorld(cars, late=[(0.3, CarStart(lane=3, x=50.0, speed=20.0))]))


def test_our_world_in_sumo_passes():
    check_world(lambda: SumoWorld(load_scenario("light"), RobotSettings(), seed=0))


DRAW = np.random.default_rng(0)


class Changing:
    answers = 0

    def plan(self, observation, previous):
        Changing.answers += 1
        return Plan(0, Target(previous.lane, float(Changing.answers)))


class Writing:
    def plan(self, observation, previous):
        observation.x[:] = 0.0
        return Plan(0, previous)


class BesideTheRoad:
    def plan(self, observation, previous):
        return Plan(0, Target(previous.lane + 4, 20.0))


class OneTooFar:
    def plan(self, observation, previous):
        return Plan(0, Target(4, 20.0))


class NotANumber:
    def plan(self, observation, previous):
        return Plan(0, Target(previous.lane, math.nan))


class Nothing:
    def plan(self, observation, previous):
        return None


class FailsAlone:
    def plan(self, observation, previous):
        return Plan(0, Target(int(observation.lane[0]), 20.0))


@pytest.mark.parametrize(
    ("planner", "said"),
    [
        (Changing, "the same scenes were planned for differently"),
        (Writing, "plan wrote to Observation.x"),
        (BesideTheRoad, r"returned a target in lane \d; the road has the lanes 0 to 3"),
        (OneTooFar, "returned a target in lane 4; the road has the lanes 0 to 3"),
        (NotANumber, "returned a target speed of nan"),
        (Nothing, "returned None, which is no Plan"),
        (FailsAlone, r"test_testing.py:\d+: FailsAlone.plan raised IndexError.*; asked with 0 cars around"),
    ],
)
def test_a_planner_that_breaks_the_contract_is_told_how(planner, said):
    with pytest.raises(ContractError, match=said):
        check_planner(planner)


class Unlimited:
    def filter(self, observation, values, desired):
        return FilterDecision(Control(2.0 * desired.omega, desired.acceleration))


class Numbing:
    def filter(self, observation, values, desired):
        return FilterDecision(Control(math.nan, 0.0))


class Forgetful:
    seen = 0

    def filter(self, observation, values, desired):
        Forgetful.seen += 1
        return FilterDecision(Control(0.0, -1e-3 * Forgetful.seen))


class Tidying:
    def filter(self, observation, values, desired):
        values.value[:] = np.minimum(values.value, 8.0)
        return FilterDecision(desired)


class Bare:
    def filter(self, observation, values, desired):
        return desired


class Prepared:
    """Answers differently once it has been prepared."""

    def __init__(self):
        self.acceleration = 0.0

    def prepare(self, observation, values):
        self.acceleration = -1.0

    def filter(self, observation, values, desired):
        return FilterDecision(Control(0.0, self.acceleration))


@pytest.mark.parametrize(
    ("safety_filter", "said"),
    [
        (Unlimited, r"ω = -0.6 rad/s, a = -6 m/s² is beyond the limits"),
        (Numbing, "its control is not finite, asked with 0 cars around"),
        (Forgetful, "the same scenes were filtered differently"),
        (Tidying, "filter wrote to CarValues.value"),
        (Bare, r"Bare.filter returned Control\(omega=.*, which is no FilterDecision"),
        (Prepared, "the same scenes were filtered differently"),
    ],
)
def test_a_filter_that_breaks_the_contract_is_told_how(safety_filter, said):
    with pytest.raises(ContractError, match=said):
        check_filter(safety_filter)


class WrongWorld(FakeWorld):
    """A world that shows something else in place of a field of its observations."""

    def __init__(self, **shown):
        super().__init__([CarStart(lane=0, x=30.0, speed=20.0), CarStart(lane=2, x=-10.0, speed=25.0)])
        self._shown = shown

    def observe(self):
        return dataclasses.replace(super().observe(), **self._shown)


class Renaming(FakeWorld):
    """A world in which all cars have one name."""

    def __init__(self):
        super().__init__([CarStart(lane=lane, x=30.0, speed=20.0) for lane in (0, 3)])
        self.vehicle_names = ["car", "car"]


class Anonymous(FakeWorld):
    """A world that forgets the drivers of cars that came late."""

    def __init__(self):
        super().__init__([CarStart(lane=0, x=30.0, speed=20.0)], late=[(0.1, CarStart(lane=3, x=50.0, speed=20.0))])

    @property
    def drivers(self):
        return super().drivers[:1]


class Reusing(FakeWorld):
    """A world that hands its own arrays out, and moves them."""

    def __init__(self):
        super().__init__([CarStart(lane=0, x=30.0, speed=20.0)])

    def observe(self):
        return dataclasses.replace(super().observe(), x=self._x)

    def step(self, robot_state, robot_acceleration):
        kept = self._x
        super().step(robot_state, robot_acceleration)
        kept[:] = self._x
        self._x = kept


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (Renaming, "two cars have one name at 0.00 s"),
        (Anonymous, "drivers has 1 rows at 0.10 s, and 2 cars a name"),
        (lambda: WrongWorld(robot=np.zeros(3)), r"robot has the shape \(3,\)"),
        (lambda: WrongWorld(speed=np.zeros(3)), r"speed has the shape \(3,\)"),
        (lambda: WrongWorld(lane=np.zeros(2)), "lane is of float64"),
        (lambda: WrongWorld(x=np.array([1.0, math.nan])), "is not finite at 0.00 s"),
        (lambda: WrongWorld(vehicle=np.array([1, 1])), "two cars have one number"),
        (lambda: WrongWorld(vehicle=np.array([0, 2])), "has no name"),
        (lambda: WrongWorld(length=np.array([5.0, 0.0])), "has no length"),
        (lambda: WrongWorld(time=1.0), "the clock went from 1.0 to 1.0 s"),
        (lambda: WrongWorld(robot=np.array([0.0, 4.0, 0.0, 24.0])), "the robot was put at"),
        (lambda: WrongWorld(y=DRAW.uniform(0, 8, 2)), "two worlds made alike differ in y"),
        (Reusing, "step wrote to Observation.x"),
    ],
)
def test_a_world_that_breaks_the_contract_is_told_how(make, said):
    with pytest.raises(ContractError, match=said):
        check_world(make)
