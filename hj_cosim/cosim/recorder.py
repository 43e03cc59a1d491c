"""Collects an episode, sample by sample: the robot in memory, the cars as `recording.traffic_recorder` has them."""

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np

from hj_cosim.control.contract import FilterDecision
from hj_cosim.metrics.threats import threat_track
from hj_cosim.planning.contract import Plan
from hj_cosim.recording.beliefs import BeliefTrack
from hj_cosim.recording.record import NO_VEHICLE, RobotTrack, RunRecord
from hj_cosim.recording.traffic_recorder import TrafficRecorder
from hj_cosim.recording.trajectories import Scene
from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.settings import RobotSettings


class Recorder:
    """The tracks of one episode while it is being driven."""

    # Six parameters beside itself: what is recorded, how much of it, and where.
    def __init__(
        self,
        scene: Scene,
        names: Callable[[], Sequence[str]],
        limits: RobotSettings,
        samples: int,
        beside: Path,
        within: float = math.inf,
    ) -> None:
        """Begin with nothing.

        Args:
            scene: the road, the robot's body, who means harm.
            names: returns those of the cars that have come by now, by number.
            limits: of the robot, whose ranges say what is another control than desired.
            samples: that may be taken at most.
            beside: the place near which a file is made if there is more than the memory is to hold.
            within: m from the robot, where cars are recorded.
        """
        self._scene, self._limits, self._within = scene, limits, within
        self._cars = TrafficRecorder(scene, names, beside)
        self._samples: list[tuple[float, ...]] = []  # of time and robot, since the last stretch ended
        self._time, self._robot, self._taken = np.zeros(samples), RobotTrack.empty(samples), 0
        self._beliefs = BeliefTrack(samples)

    # Seven parameters: what each part of the loop has to say of a sample, and who else is there.
    def record(
        self,
        observation: Observation,
        values: CarValues,
        plan: Plan,
        desired: Control,
        decision: FilterDecision,
        steering: float,
        everybody: Observation | None = None,
    ) -> None:
        """Take one sample.

        Args:
            observation: what the robot saw.
            values: V of its cars; +inf is recorded where it is not known.
            plan: the plan that it is following.
            desired: the tracking controller's control.
            decision: what the filter made of it.
            steering: δ, rad, that goes to the bicycle.
            everybody: whose motion is recorded; those of the observation unless given.
        """
        target, control = plan.target, decision.control
        self._samples.append(
            (
                observation.time,
                *observation.robot.tolist(),
                steering,
                control.omega,
                control.acceleration,
                desired.omega,
                desired.acceleration,
                plan.action,
                target.speed,
                target.lane,
                values.least if values.is_known else math.inf,
                observation.vehicle[values.nearest] if values.nearest >= 0 else NO_VEHICLE,
                decision.constraints,
                decision.intervening(desired, self._limits),
                decision.slack,
            )
        )
        cars = observation if everybody is None else everybody
        if decision.belief is not None:
            sample = self._taken + len(self._samples) - 1
            self._beliefs.fill((sample, observation.vehicle), decision.belief)
        self._cars.record(cars if self._within == math.inf else cars.within(self._within))
        if self._cars.is_stretch_full:
            self._cars.end_stretch(*self._tracks(), self._beliefs)

    def _tracks(self) -> tuple[np.ndarray, RobotTrack]:
        """Return the times (T,), s, and the robot, of all samples up to now."""
        if self._samples:
            time, *columns = np.array(self._samples, dtype=float).T
            now = slice(self._taken, self._taken + len(time))
            self._time[now] = time
            for field, column in zip(fields(RobotTrack), columns, strict=True):
                getattr(self._robot, field.name)[now] = column
            self._samples, self._taken = [], now.stop
        return self._time[: self._taken], self._robot.first(self._taken)

    def finish(self, ended: str) -> RunRecord:
        """Return what was taken, with the threat metrics of every sample.

        Args:
            ended: why the drive was over.

        Raises:
            HjCosimError: if what does not fit into memory cannot be written.
        """
        time, track = self._tracks()
        scene = self._scene
        traffic = self._cars.finish(time, track, self._beliefs)
        return RunRecord(
            time=time,
            road=scene.road,
            robot_length=scene.robot_length,
            robot_width=scene.robot_width,
            traffic=traffic,
            robot=track,
            threats=threat_track(track, traffic, scene.robot_length, scene.robot_width),
            ended=ended,
            rogues=scene.rogues,
            belief=self._beliefs.taken(len(time), len(traffic.names)),
        )
