"""Collects an episode, sample by sample, into arrays that are allocated once."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from hj_cosim.control.contract import FilterDecision
from hj_cosim.metrics.threats import threat_track
from hj_cosim.planning.contract import Plan
from hj_cosim.recording.beliefs import BeliefTrack
from hj_cosim.recording.record import NO_VEHICLE, RobotTrack, RunRecord, TrafficTrack
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import RobotSettings

ROOM_GROWTH = 2  # times as many columns as before, where a car comes that has none


class Recorder:
    """The tracks of one episode while it is being driven."""

    def __init__(self, samples: int, vehicles: int, limits: RobotSettings) -> None:
        """Make room.

        Args:
            samples: that may be taken at most.
            vehicles: cars that are known at the beginning; more may come.
            limits: of the robot, whose ranges say what is another control than desired.
        """
        self._limits = limits
        self._taken = 0
        self._time = np.zeros(samples)
        self._traffic = TrafficTrack.empty(("",) * vehicles, np.zeros(vehicles), np.zeros(vehicles), samples)
        self._robot = RobotTrack.empty(samples)
        self._belief = BeliefTrack(samples)

    def record(
        self,
        observation: Observation,
        values: CarValues,
        plan: Plan,
        desired: Control,
        decision: FilterDecision,
        steering: float,
    ) -> None:
        """Take one sample.

        Args:
            observation: what the robot saw.
            values: V of its cars; +inf is recorded where it is not known.
            plan: the plan that it is following.
            desired: the tracking controller's control.
            decision: what the filter made of it.
            steering: δ, rad, that goes to the bicycle.
        """
        sample = self._taken
        self._taken += 1
        self._time[sample] = observation.time

        cars, traffic = observation.vehicle, self._traffic
        if len(cars) and cars.max() >= len(traffic.names):
            room = max(int(cars.max()) + 1, ROOM_GROWTH * len(traffic.names))
            self._traffic = traffic = traffic.for_cars(("",) * room)
        traffic.length[cars], traffic.width[cars] = observation.length, observation.width
        traffic.present[sample, cars] = True
        traffic.x[sample, cars] = observation.x
        traffic.y[sample, cars] = observation.y
        traffic.heading[sample, cars] = observation.heading
        traffic.speed[sample, cars] = observation.speed
        traffic.acceleration[sample, cars] = observation.acceleration
        traffic.lane[sample, cars] = observation.lane
        if decision.belief is not None:
            self._belief.fill((sample, cars), decision.belief)

        robot = self._robot
        robot.x[sample], robot.y[sample], robot.heading[sample], robot.speed[sample] = observation.robot
        robot.steering[sample] = steering
        robot.omega[sample] = decision.control.omega
        robot.acceleration[sample] = decision.control.acceleration
        robot.omega_desired[sample] = desired.omega
        robot.acceleration_desired[sample] = desired.acceleration
        robot.action[sample] = plan.action
        robot.plan_speed[sample] = plan.target.speed
        robot.plan_lane[sample] = plan.target.lane
        robot.value[sample] = values.least if values.is_known else math.inf
        robot.value_vehicle[sample] = observation.vehicle[values.nearest] if values.nearest >= 0 else NO_VEHICLE
        robot.constraints[sample] = decision.constraints
        robot.intervening[sample] = decision.intervening(desired, self._limits)
        robot.slack[sample] = decision.slack

    def finish(
        self, road: Road, robot: RobotSettings, names: Sequence[str], ended: str, rogues: Mapping[str, str]
    ) -> RunRecord:
        """Return what was taken, with the threat metrics of every sample.

        Args:
            road: the road.
            robot: its body.
            names: of all cars that were seen, by number.
            ended: why the drive was over.
            rogues: what those among the cars do who mean harm, by name.
        """
        time, track = self._time[: self._taken], self._robot.first(self._taken)
        traffic = self._traffic.first(self._taken)
        if len(names) != len(traffic.names):
            traffic = traffic.for_cars(tuple(names))
        traffic = replace(traffic, names=tuple(names))
        return RunRecord(
            time=time,
            road=road,
            robot_length=robot.length,
            robot_width=robot.width,
            traffic=traffic,
            robot=track,
            threats=threat_track(track, traffic, robot.length, robot.width),
            ended=ended,
            rogues=rogues,
            belief=self._belief.taken(self._taken, len(names)),
        )
