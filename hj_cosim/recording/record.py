"""What a run leaves behind, as arrays: the cars, the robot and the threat metrics at every sample.

Everything is SI and in the road frame; positions are body centres. T samples, J cars besides the robot.
"""

import dataclasses
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields
from typing import Any, NamedTuple

import numpy as np

from hj_cosim.recording.large_arrays import zeros
from hj_cosim.scene.observation import Observation
from hj_cosim.scene.road import Road

ROBOT_NAME = "robot"
# Why a drive ended; a world may give other reasons (errors.DriveEnded).
DURATION = "duration"
COLLISION = "collision"
NO_VEHICLE = -1  # in value_vehicle, where no car has a value


@dataclass(frozen=True)
class TrafficTrack:
    """The J cars besides the robot; where one is not present its entries mean nothing."""

    names: tuple[str, ...]  # (J,) by vehicle number
    length: np.ndarray  # (J,) m
    width: np.ndarray  # (J,) m
    present: np.ndarray  # (T, J) bool
    x: np.ndarray  # (T, J) m
    y: np.ndarray  # (T, J) m
    heading: np.ndarray  # (T, J) rad
    speed: np.ndarray  # (T, J) m/s
    acceleration: np.ndarray  # (T, J) m/s²
    lane: np.ndarray  # (T, J) int

    @classmethod
    def empty(cls, names: tuple[str, ...], length: np.ndarray, width: np.ndarray, samples: int) -> "TrafficTrack":
        """Return a track of `samples` samples in which nobody is present yet, for a recorder to fill.

        Raises:
            HjCosimError: if it fits neither into memory nor onto the disk (see large_arrays).
        """
        shape = (samples, len(names))
        floats = {name: zeros(shape) for name in ("x", "y", "heading", "speed", "acceleration")}
        return cls(names, length, width, present=zeros(shape, bool), lane=zeros(shape, np.int8), **floats)

    def first(self, samples: int) -> "TrafficTrack":
        """Return the first `samples` samples, for an episode that ended early."""
        tracks = {field.name: getattr(self, field.name)[:samples] for field in fields(self)[3:]}
        return TrafficTrack(self.names, self.length, self.width, **tracks)

    def pieces(self) -> Iterator["Piece"]:
        """Yield all samples, in order, in pieces that fit into memory: this track is one."""
        yield Piece(slice(0, len(self.present)), np.arange(len(self.names)), self)

    def at(self, sample: int) -> "Piece":
        """Return who is present at a sample."""
        here = np.flatnonzero(self.present[sample])
        return Piece(slice(sample, sample + 1), here, self._part(slice(sample, sample + 1), here))

    def of(self, car: int) -> "TrafficTrack":
        """Return the track of one car alone, (T, 1)."""
        return self._part(slice(None), np.array([car]))

    def _part(self, samples: slice, cars: np.ndarray) -> "TrafficTrack":
        tracks = {field.name: getattr(self, field.name)[samples, cars] for field in fields(self)[3:]}
        names = tuple(self.names[car] for car in cars.tolist())
        return TrafficTrack(names, self.length[cars], self.width[cars], **tracks)


class Piece(NamedTuple):
    """Some consecutive samples of a run's traffic."""

    samples: slice
    cars: np.ndarray  # (K,) int, the numbers of those that `traffic` has columns for, ascending
    traffic: TrafficTrack


@dataclass(frozen=True)
class RobotTrack:
    """The robot, what its planner, tracking controller and filter said, and why."""

    x: np.ndarray  # (T,) m
    y: np.ndarray  # (T,) m
    heading: np.ndarray  # (T,) rad
    speed: np.ndarray  # (T,) m/s
    steering: np.ndarray  # (T,) δ, rad
    omega: np.ndarray  # (T,) ω after the filter, rad/s
    acceleration: np.ndarray  # (T,) a after the filter, m/s²
    omega_desired: np.ndarray  # (T,) rad/s
    acceleration_desired: np.ndarray  # (T,) m/s²
    action: np.ndarray  # (T,) int, the planner's latest action
    plan_speed: np.ndarray  # (T,) v_p, m/s
    plan_lane: np.ndarray  # (T,) int, l_p
    value: np.ndarray  # (T,) min over cars of V, m; +inf where no car is in the table's grid
    value_vehicle: np.ndarray  # (T,) int, the number of the car with that value, or NO_VEHICLE
    constraints: np.ndarray  # (T,) int, |K|
    intervening: np.ndarray  # (T,) bool
    slack: np.ndarray  # (T,) of the filter's problem

    @classmethod
    def empty(cls, samples: int) -> "RobotTrack":
        """Return a track of `samples` samples, all zero, for a recorder to fill."""
        types: dict[str, Any] = {
            "action": np.int8,
            "plan_lane": np.int8,
            "value_vehicle": np.int32,
            "constraints": np.int32,
            "intervening": np.bool_,
        }
        return cls(**{field.name: np.zeros(samples, types.get(field.name, np.float64)) for field in fields(cls)})

    def first(self, samples: int) -> "RobotTrack":
        """Return the first `samples` samples, for an episode that ended early."""
        return self.between(0, samples)

    def between(self, start: int, stop: int) -> "RobotTrack":
        """Return samples start to stop."""
        return RobotTrack(**{field.name: getattr(self, field.name)[start:stop] for field in fields(self)})


@dataclass(frozen=True)
class ThreatTrack:
    """The threats at every sample; `metrics.threats.threat_track` makes them."""

    ttc: np.ndarray  # (T,) s, +inf where no car ahead is being approached
    btn: np.ndarray  # (T,) brake threat number
    stn: np.ndarray  # (T,) steer threat number
    min_gap: np.ndarray  # (T,) m between the robot's body and the nearest car's, 0 where they overlap
    collision: np.ndarray  # (T,) bool, the bodies overlap
    ttc_2d: np.ndarray  # (T,) s until the bodies overlap at constant velocity, +inf if never


@dataclass(frozen=True)
class RunRecord:
    """A whole run."""

    time: np.ndarray  # (T,) s since the robot took over
    road: Road
    robot_length: float  # m
    robot_width: float  # m
    traffic: TrafficTrack
    robot: RobotTrack
    threats: ThreatTrack
    ended: str = DURATION  # why the drive was over
    # What those cars do whose drivers mean harm, by name.
    rogues: Mapping[str, str] = dataclasses.field(default_factory=dict)
    # (T, J) how likely the filter held it that each driver means harm, NaN where it did not judge; if it ever did.
    belief: np.ndarray | None = None

    @property
    def is_rogue(self) -> np.ndarray:
        """Return (J,) bool: which cars' drivers mean harm."""
        return np.array([name in self.rogues for name in self.traffic.names], dtype=bool)

    def observation(self, sample: int) -> Observation:
        """Return what the robot saw at a sample; where a lane change leads was not recorded, so it is the lane."""
        robot = self.robot
        _, here, traffic = self.traffic.at(sample)
        return Observation(
            time=float(self.time[sample]),
            robot=np.array([robot.x[sample], robot.y[sample], robot.heading[sample], robot.speed[sample]]),
            robot_acceleration=float(robot.acceleration[max(sample - 1, 0)]),
            vehicle=here,
            x=traffic.x[0],
            y=traffic.y[0],
            heading=traffic.heading[0],
            speed=traffic.speed[0],
            acceleration=traffic.acceleration[0],
            lane=traffic.lane[0],
            target_lane=traffic.lane[0],
            length=traffic.length,
            width=traffic.width,
        )
