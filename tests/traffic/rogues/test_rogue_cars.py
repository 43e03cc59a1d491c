"""Rogues' cars in SUMO: when they begin, what they respect, who sees them, and whose they are."""

import sys

import numpy as np
import pytest
from rogue_scenes import SPEED, STEP, TRAFFIC_STEP, coast, scene, touches

from hj_cosim.errors import PluginError
from hj_cosim.plugins import given
from hj_cosim.scene.road import StraightRoad
from hj_cosim.settings import CarStart, RobotSettings, RogueLimits, RogueSettings, Scenario, TrafficSettings
from hj_cosim.traffic.rogues.catalogue import BEHAVIOUR, choose_rogues
from hj_cosim.traffic.rogues.contract import CarInput
from hj_cosim.traffic.rogues.restraint import moved
from hj_cosim.traffic.sources.placement import initial_traffic
from hj_cosim.traffic.sumo.world import SumoWorld


class Wild:
    """Wants more than any car can, to the left."""

    def act(self, view):
        return CarInput(heading=1.0, acceleration=100.0)


class Sideways:
    """Goes to the left at its speed."""

    def act(self, view):
        return CarInput(heading=1.0, acceleration=0.0)


class Straddling:
    """Goes to the line between lanes 1 and 2, and drives 10 m/s."""

    def act(self, view):
        return CarInput(heading=(6.0 - view.y) / view.speed, acceleration=10.0 - view.speed)


class Asleep:
    """Drives as others do."""

    def act(self, view):
        return None


class Broken:
    """Raises, or answers nonsense."""

    def act(self, view):
        raise ValueError("no idea")


class Leaving:
    def act(self, view):
        sys.exit(3)


class Texts:
    def act(self, view):
        return CarInput("0.0", "1")


class Arrays:
    def act(self, view):
        return CarInput(np.array([0.01]), np.array([1.0]))


class Writing:
    def act(self, view):
        view.observation.x[view.own] += 1.0


class Nonsense:
    """Answers what no car can do."""

    def act(self, view):
        return CarInput(float("nan"), 0.0)


def test_whatever_a_rogue_wants_its_car_keeps_its_limits_and_the_road(drive, rogue):
    track = drive([rogue(Wild, 2, 30.0)], 6.0).of(0)
    assert np.abs(track["heading"]).max() <= 0.1 + 1e-12
    assert np.abs(np.diff(track["heading"])).max() <= 0.3 * TRAFFIC_STEP + 1e-12
    assert track["acceleration"][1:].max() == pytest.approx(4.0)
    assert track["y"].max() <= 13.0
    assert track["y"][-1] == pytest.approx(13.0, abs=0.3)
    assert track["speed"].max() <= 40.0


def test_a_rogue_turns_and_moves_as_the_games_other_car():
    limits = RogueLimits(heading=0.1, turn_rate=0.3)
    state, acceleration = moved(np.array([0.0, 0.0, 0.0, 20.0]), CarInput(0.1, 4.0), limits, 0.1)
    assert state[2] == pytest.approx(0.03)
    assert state[3] == pytest.approx(20.4)
    assert acceleration == pytest.approx(4.0)
    assert state[0] == pytest.approx(20.2 * 0.1)
    assert state[1] == pytest.approx(2.02 * np.sin(0.015))
    standing, braking = moved(np.array([0.0, 0.0, 0.0, 0.3]), CarInput(0.0, -6.0), limits, 0.1)
    assert standing[3] == 0.0
    assert braking == pytest.approx(-3.0)


def test_a_rogue_runs_into_nobody_ahead(drive, rogue):
    ahead = CarStart(lane=3, x=60.0, speed=12.0, desired_speed=12.0)
    tracks = drive([rogue(Wild, 2, 30.0), ahead], 8.0)
    assert not touches(tracks.of(0), tracks.of(1))


def test_a_rogue_does_not_steer_into_who_is_beside(drive, rogue):
    beside = CarStart(lane=3, x=31.0, speed=SPEED, desired_speed=SPEED)
    tracks = drive([rogue(Sideways, 2, 30.0), beside], 4.0)
    assert not touches(tracks.of(0), tracks.of(1))
    assert touches(drive([rogue(Sideways, 2, 30.0)], 4.0).of(0), tracks.of(1))  # which it would else


def test_a_rogue_between_two_lanes_is_seen_in_both(drive, rogue):
    def stand(state, time):
        return np.array([*state[:3], 0.0])

    followers = [CarStart(lane=lane, x=50.0, speed=SPEED, desired_speed=24.0) for lane in (1, 2)]
    tracks = drive([rogue(Straddling, 2, 90.0), *followers], 10.0, stand, within=500.0)
    for car in (1, 2):
        track = tracks.of(car)
        assert track["speed"][-1] == pytest.approx(10.0, abs=2.0)
        assert not touches(tracks.of(0), track)


def test_an_idle_rogue_follows_as_any_driver_does(drive, rogue):
    ahead = CarStart(lane=3, x=60.0, speed=15.0, desired_speed=15.0)
    as_rogue = drive([rogue(Asleep, 3, 20.0), ahead], 12.0)
    ordinary = drive([CarStart(lane=3, x=20.0, speed=SPEED, desired_speed=24.0), ahead], 12.0)
    assert as_rogue.of(0)["x"][-1] == pytest.approx(ordinary.of(0)["x"][-1], abs=1.0)
    assert as_rogue.of(0)["speed"][-1] == pytest.approx(ordinary.of(0)["speed"][-1], abs=0.3)


def test_a_rogues_path_is_continuous_between_steps_and_where_it_begins(rogue):
    with scene([rogue(Wild, 2, 30.0)], after=0.5) as world:
        world.settle(0.0)
        seen = []
        for _ in range(100):
            seen.append(world.observe())
            world.step(coast(seen[-1].robot, 0.0), 0.0)
    x, y, speed = (np.array([getattr(each, name)[0] for each in seen]) for name in ("x", "y", "speed"))
    assert np.diff(x) == pytest.approx(0.5 * (speed[1:] + speed[:-1]) * STEP, abs=1e-6)
    assert np.abs(np.diff(speed)).max() <= 4.0 * STEP + 1e-6
    assert 0.0 < np.abs(np.diff(y)).max() <= speed.max() * np.sin(0.1) * STEP + 1e-9


@pytest.mark.parametrize("settings", [{"within": 20.0}, {"after": 60.0}], ids=str)
def test_a_rogue_begins_near_the_robot_and_not_too_early(drive, rogue, settings):
    track = drive([rogue(Wild, 2, 30.0)], 2.0, **settings).of(0)
    assert (track["y"] == 8.0).all()


def test_what_is_no_input_is_refused_with_the_behaviours_place(rogue):
    said_of = {
        Broken: "ValueError: no idea",
        Leaving: "SystemExit: 3",
        Writing: "act wrote to Observation.x",
    }
    for behaviour, said in {**said_of, **dict.fromkeys((Nonsense, Texts, Arrays), "a CarInput of finite")}.items():
        with scene([rogue(behaviour, 2, 10.0)]) as world, pytest.raises(PluginError, match=said) as refused:
            world.step(world.observe().robot, 0.0)
        assert "test_rogue_cars.py" in str(refused.value)


def test_a_behaviour_that_asks_for_v_is_refused_where_there_is_none(rogue):
    with pytest.raises(PluginError, match="asks for 'values'"), scene([rogue("worst", 2, 10.0)]):
        pass


def _scenario(share: float, behaviour: str = "cut_in", **traffic: int) -> Scenario:
    return Scenario(
        name="some", traffic=TrafficSettings(**traffic), rogues=RogueSettings(share=share, behaviour=behaviour)
    )


def test_the_seed_says_who_is_a_rogue_and_changes_nothing_else():
    chosen = [choose_rogues(_scenario(0.2), 100, seed) for seed in (1, 1, 2)]
    cars = [{rogue.car for rogue in each} for each in chosen]
    assert len(cars[0]) == 20
    assert cars[0] == cars[1] != cars[2]
    traffic = [initial_traffic(_scenario(share), StraightRoad(4), RobotSettings(), 1) for share in (0.0, 0.2)]
    assert (traffic[0].x == traffic[1].x).all()
    assert (traffic[0].drivers == traffic[1].drivers).all()
    many = {rogue.car for rogue in choose_rogues(_scenario(0.4), 100, 1)}
    assert cars[0] < many  # so that shares can be compared on paired seeds


def test_mixed_draws_a_behaviour_for_each():
    found = [rogue.behaviour for rogue in choose_rogues(_scenario(1.0, "mixed"), 100, 0)]
    assert set(found) == set(BEHAVIOUR.ours)
    assert min(found.count(each) for each in set(found)) > 5


def test_the_world_names_its_rogues_and_what_they_do(rogue):
    cars = [CarStart(lane=3, x=0.0, speed=SPEED), rogue("drift", 2, 10.0), rogue(Asleep, 0, 10.0)]
    with scene(cars) as world:
        assert world.rogues == {"car_1": "drift", "car_2": "Asleep"}


def test_a_rogue_at_the_end_of_the_road_is_gone(tmp_path):
    scenario = _scenario(0.0, count=0).model_copy(
        update={"cars": (CarStart(lane=2, x=9900.0, speed=30.0, rogue=given(BEHAVIOUR, Asleep)),)}
    )
    scenario = scenario.model_copy(update={"rogues": RogueSettings(within=20000.0)})
    with SumoWorld(scenario, RobotSettings(), 0, 0.1) as world:
        for _ in range(20):
            world.step(world.observe().robot, 0.0)
        assert len(world.observe().x) == 0
