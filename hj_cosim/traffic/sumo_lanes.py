"""SUMO's names for places on a road, (edge, lane, lane position), and the road frame's, there and back.

SUMO lives on a straightened road: all lanes of an edge are equally long to it, and where it draws a car is looked up
from its lane position in the lane's polyline. So places go there and back by names, never by SUMO's x and y.
"""

import math
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import NamedTuple

import numpy as np


@dataclass(frozen=True, eq=False)
class SumoLane:
    """One lane of one edge."""

    edge: str
    index: int  # on its edge, from the right
    length: float  # m, as SUMO has it
    shape: np.ndarray = field(repr=False)  # (points, 2) m, its centre line, no two points the same

    @property
    def name(self) -> str:
        """What SUMO calls it."""
        return f"{self.edge}_{self.index}"

    @cached_property
    def _way(self) -> list[float]:
        return np.append(0.0, np.cumsum(np.hypot(*np.diff(self.shape, axis=0).T))).tolist()

    def world(self, position: float, offset: float) -> tuple[float, float, float]:
        """Return x, y (m) and heading (rad) of the place at a lane position, m, `offset` m to the left of the centre.

        That is where SUMO draws a vehicle there; beyond the lane's ends it is straight on.
        """
        way = position * self._way[-1] / self.length
        piece = min(max(bisect_right(self._way, way) - 1, 0), len(self._way) - 2)
        (x_0, y_0), (x_1, y_1) = self.shape[piece].tolist(), self.shape[piece + 1].tolist()
        extent = self._way[piece + 1] - self._way[piece]
        cos, sin = (x_1 - x_0) / extent, (y_1 - y_0) / extent
        inside = way - self._way[piece]
        return x_0 + inside * cos - offset * sin, y_0 + inside * sin + offset * cos, math.atan2(sin, cos)


class LanePlace(NamedTuple):
    """Where one lane of SUMO's lies on the road: s = start + scale times the lane position."""

    number: int  # the road's, of this lane; of a ramp's beside the road, of the one that it leads to or comes from
    start: float  # m of s
    scale: float  # 1, but on a junction's lanes, which may be longer or shorter than each other
    beside: "Beside | None" = None  # how far off a ramp's lane is


@dataclass(frozen=True, eq=False)
class Beside:
    """Where a ramp's lane lies beside the road, as far as it is near enough to be seen from there."""

    position: np.ndarray  # (N,) m, ascending lane positions
    lateral: np.ndarray  # (N,) m, d there

    @property
    def seen(self) -> tuple[float, float]:
        """Between which lane positions (m) cars are seen."""
        return float(self.position[0]), float(self.position[-1])

    def lateral_at(self, position: float) -> float:
        """Return d (m) of the lane's centre at a lane position (m)."""
        return float(np.interp(position, self.position, self.lateral))


@dataclass(frozen=True)
class Section:
    """A stretch of the road with the same lanes all along: an edge, or what is between two of them."""

    start: float  # m of s
    length: float  # m of s
    is_junction: bool
    lanes: Mapping[int, tuple[SumoLane, ...]]  # by number: its lanes in SUMO, one behind the other


@dataclass(frozen=True)
class SumoLanes:
    """All lanes of a road as SUMO knows them."""

    edges: tuple[str, ...]  # the route, one lap of it
    sections: Sequence[Section] = field(repr=False)
    laps: int = 1
    ramps: Mapping[str, LanePlace] = field(default_factory=dict, repr=False)  # lanes beside the road, by name

    @property
    def route(self) -> str:
        """The edges of all laps, as SUMO's route files have them."""
        return " ".join(self.edges * self.laps)

    @cached_property
    def lap(self) -> float:
        """How long one lap is, m of s."""
        return self.sections[-1].start + self.sections[-1].length

    @cached_property
    def differ(self) -> bool:
        """Whether lanes begin, end or lead off anywhere."""
        return bool(self.ramps) or len({frozenset(section.lanes) for section in self.sections}) > 1

    @cached_property
    def _starts(self) -> list[float]:
        return [section.start for section in self.sections]

    @cached_property
    def by_name(self) -> Mapping[str, LanePlace]:
        """Where each lane of SUMO's lies, by its name; those of ramps too."""
        found = dict(self.ramps)
        for section in self.sections:
            for number, chain in section.lanes.items():
                scale = section.length / sum(lane.length for lane in chain)
                start = section.start
                for lane in chain:
                    found[lane.name] = LanePlace(number, start, scale)
                    start += scale * lane.length
        return found

    @cached_property
    def _index(self) -> Mapping[tuple[str, int], int]:
        return {
            (lane.edge, number): lane.index
            for section in self.sections
            for number, chain in section.lanes.items()
            for lane in chain
        }

    def index_on(self, edge: str, number: int) -> int | None:
        """Return the index that the road's lane `number` has on an edge of SUMO's; None if it is not there."""
        return self._index.get((edge, number))

    def place(self, number: int, along: float) -> tuple[SumoLane, float] | None:
        """Return the lane of SUMO's and the position in it (m) of a lane's place at s (m); None where there is none."""
        section = self._section(along)
        chain = section.lanes.get(number)
        if chain is None:
            return None
        position = (self._within(along) - section.start) / section.length * sum(lane.length for lane in chain)
        for lane in chain[:-1]:
            if position <= lane.length:
                return lane, position
            position -= lane.length
        return chain[-1], min(max(position, 0.0), chain[-1].length)

    def departure(self, number: int, along: float) -> tuple[int, int, float]:
        """Return the place in the route, the lane's index and the position (m) at which SUMO may insert a vehicle.

        That is on an edge: who would stand in a junction stands before it.
        """
        within, section = self._within(along), self._section(along)
        which = self.sections.index(section)
        if section.is_junction:
            which -= 1
            section = self.sections[which]
            within = section.start + section.length
        lane = section.lanes[number][0]
        before = sum(not each.is_junction for each in self.sections[:which])
        return before, lane.index, min(max(within - section.start, 0.0), lane.length)

    def _within(self, along: float) -> float:
        return along % self.lap if self.laps > 1 else along

    def _section(self, along: float) -> Section:
        return self.sections[max(bisect_right(self._starts, self._within(along)) - 1, 0)]
