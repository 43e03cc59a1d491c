"""A road that bends, and whose lanes begin and end: a chain of edges, as one smooth curve with lanes beside it.

s is the simulator's own length along the chain, in which every lane of an edge is as long as the others, so that cars
advance by ds = v dt in whichever lane. The curve r(s) is a cubic spline of one reference lane's centre line by that s:
a metre of s is |r'(s)| metres of the reference lane, and |r'(s)| − ψ'(s) (d − d_ref) metres at the offset d, where ψ
is the road's heading. A body that moves with v at the angle θ to the road advances by that much the less in s, and
turns away from the road by ψ' ds/dt; see `Road.stretch_at` and `Road.bend_rate`.
"""

import math
from bisect import bisect_right
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from hj_cosim.scene.curve import (
    bend_and_stretch,
    curve_at,
    place_beside_curve,
    place_on_curve,
    places_beside_curve,
    sharpest_of_curve,
)
from hj_cosim.scene.road import Coordinate


@dataclass(frozen=True, eq=False)
class RouteRoad:
    """A chain of edges as one road; see Road.

    Lanes have one number all along: the right-most lane that there is anywhere is 0, and a lane that begins or ends
    changes nobody else's number. Lane n's centre line is at d = n times the lane's width.
    """

    lane_count: int
    lane_width: float  # m
    length: float  # m, of all laps
    knots: np.ndarray = field(repr=False)  # (K, 2) m, of the reference lane's centre line, evenly spaced in s
    reference_lane: int  # whose centre line the curve is
    section_start: np.ndarray = field(repr=False)  # (S,) m, where the lanes change, ascending, the first 0
    first_lane: np.ndarray = field(repr=False)  # (S,) int, the right-most lane from there on
    lanes_there: np.ndarray = field(repr=False)  # (S,) int, how many there are
    leading_off: np.ndarray = field(repr=False)  # (S,) int, bit sets of the lanes that leave the road at its end
    lap: float = 0.0  # m, of one lap of a closed road; 0 of an open one
    # (L,) m and (L,) m/s, where speed limits begin, ascending, the first at 0, and they themselves; none if empty
    limit_start: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)
    limit: np.ndarray = field(default_factory=lambda: np.empty(0), repr=False)

    @cached_property
    def _spacing(self) -> float:
        return (self.lap or self.length) / (len(self.knots) - 1)

    @cached_property
    def _coefficients(self) -> np.ndarray:
        """The spline's (2, 4, knots − 1)."""
        from scipy.interpolate import (
            CubicSpline,
        )  # which takes a quarter of a second that a straight road has not to pay

        along = self._spacing * np.arange(len(self.knots))
        ends = "periodic" if self.lap else "not-a-knot"
        return np.ascontiguousarray(np.moveaxis(CubicSpline(along, self.knots, bc_type=ends).c, 2, 0))

    @property
    def is_straight(self) -> bool:
        """False: this frame is not the world's, turned and moved."""
        return False

    @cached_property
    def sharpest(self) -> float:
        """The largest curvature of any lane's centre line, 1/m, looked for every metre."""
        along = np.arange(0.0, self.lap or self.length, 1.0)
        section = self._sections(along)
        outermost = np.stack([self.first_lane[section], self.first_lane[section] + self.lanes_there[section] - 1])
        offset = outermost * self.lane_width - self._reference
        return float(sharpest_of_curve(along, offset, self._spacing, self.lap, self._coefficients))

    @cached_property
    def _starts(self) -> list[float]:
        return [float(start) for start in self.section_start]

    @cached_property
    def _limit_starts(self) -> list[float]:
        return [float(start) for start in self.limit_start]

    # What is asked for in every step is kept by section, as Python's own numbers.
    @cached_property
    def _lanes(self) -> list[range]:
        """The lanes of each section."""
        pairs = zip(self.first_lane.tolist(), self.lanes_there.tolist(), strict=True)
        return [range(first, first + there) for first, there in pairs]

    @cached_property
    def _lines(self) -> list[np.ndarray]:
        """The lines beside the lanes of each section, m; never written."""
        lines = [(np.arange(lanes.start, lanes.stop + 1) - 0.5) * self.lane_width for lanes in self._lanes]
        for each in lines:
            each.flags.writeable = False
        return lines

    @cached_property
    def _last_sections(self) -> list[list[int]]:
        """Of each section and lane, the last section in a row in which the lane exists; -1 where it does not end."""
        return [[self._end_of(section, lane) for lane in range(self.lane_count)] for section in range(len(self._lanes))]

    def _end_of(self, section: int, lane: int) -> int:
        for later in range(section + 1, len(self._lanes)):
            if lane not in self._lanes[later]:
                return later - 1
        return -1

    def _section(self, along: float) -> int:
        if len(self._starts) == 1:
            return 0
        return max(bisect_right(self._starts, along % self.lap if self.lap else along) - 1, 0)

    def _sections(self, along: np.ndarray) -> np.ndarray:
        within = along % self.lap if self.lap else along
        return np.maximum(np.searchsorted(self.section_start, within, side="right") - 1, 0)

    def lanes_at(self, along: float) -> range:
        """Return the lanes that exist at s."""
        return self._lanes[self._section(along)]

    def lane_end(self, lane: int, along: float) -> float:
        """Return the s (m) at which a lane ends that exists at s; inf where it does not end on this road, or lap."""
        last = self._last_sections[self._section(along)][lane]
        if last < 0:
            return math.inf
        laps = math.floor(along / self.lap) * self.lap if self.lap else 0.0
        return laps + self._starts[last + 1]

    def leads_off(self, lane: int, along: float) -> bool:
        """Return whether a lane that exists at s goes on beside this road where it ends on it; see Road."""
        last = self._last_sections[self._section(along)][lane]
        return last >= 0 and bool(int(self.leading_off[last]) >> lane & 1)

    def lasting_lanes(self, along: np.ndarray, ahead: float) -> np.ndarray:
        """Return the first and the last lane (J, 2) that exist from s (J,) to `ahead` m beyond; see Road."""
        if len(self._starts) == 1:
            lanes = np.empty((len(along), 2), np.int64)
            lanes[:, 0], lanes[:, 1] = self._lanes[0][0], self._lanes[0][-1]
            return lanes
        section = self._sections(along)
        first, stop = self.first_lane[section], self.first_lane[section] + self.lanes_there[section]
        within = along % self.lap if self.lap else along
        for start, lowest, there in zip(self.section_start, self.first_lane, self.lanes_there, strict=True):
            for begins in (start, start + self.lap) if self.lap else (start,):
                is_reached = (begins > within) & (begins <= within + ahead)
                first = np.where(is_reached, np.maximum(first, lowest), first)
                stop = np.where(is_reached, np.minimum(stop, lowest + there), stop)
        return np.column_stack([first, stop - 1])

    def speed_limit(self, along: np.ndarray) -> np.ndarray:
        """Return the speed limits (J,), m/s, at s (J,); inf where there is none."""
        if not len(self.limit):
            return np.full(len(along), math.inf)
        within = along % self.lap if self.lap else along
        return np.asarray(self.limit[np.maximum(np.searchsorted(self.limit_start, within, side="right") - 1, 0)])

    def speed_limits(self, start: float, stop: float) -> np.ndarray:
        """Return the limits between two s (m), (L, 2): where each begins (the first: `start`), m, and itself, m/s."""
        if not self.lap:  # asked for at every plan, and mostly there is one limit as far as anybody looks
            here, there = (max(bisect_right(self._limit_starts, along) - 1, 0) for along in (start, stop))
            if here == there:
                return np.array([[start, self.limit[here] if len(self.limit) else math.inf]])
        first = float(self.speed_limit(np.array([start]))[0])
        laps = np.arange(start // self.lap, stop // self.lap + 1.0) * self.lap if self.lap else np.zeros(1)
        begins = (laps[:, np.newaxis] + self.limit_start).ravel()
        limits = np.column_stack([begins, np.tile(self.limit, len(laps))])[(begins > start) & (begins <= stop)]
        limits = np.vstack([[start, first], limits])
        return limits[np.append(True, np.diff(limits[:, 1]) != 0.0)]

    def lane_centre(self, lane: int, along: float) -> float:
        """Return the lateral offset of a lane's centre line, m."""
        return lane * self.lane_width

    def lane_centres(self, lane: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the lateral offsets (J,), m, of the centre lines of lanes (J,)."""
        return np.asarray(lane * self.lane_width)

    def lane_at(self, lateral: float, along: float) -> int:
        """Return the lane whose centre line is nearest to a lateral offset (m), of those that exist at s."""
        lanes = self.lanes_at(along)
        return min(max(math.floor(lateral / self.lane_width + 0.5), lanes.start), lanes.stop - 1)

    def nearest_lanes(self, lateral: np.ndarray, along: np.ndarray) -> np.ndarray:
        """Return the lanes (J,) int whose centre lines are nearest to lateral offsets (J,); see lane_at."""
        section = self._sections(along)
        first = self.first_lane[section]
        nearest = np.floor(lateral / self.lane_width + 0.5)
        return np.clip(nearest, first, first + self.lanes_there[section] - 1).astype(np.int64)

    def overlap_reach(self, width: float) -> float:
        """Return how far from a lane's centre line (m) the centre of a body is that only touches the lane; see Road."""
        return 0.5 * (self.lane_width + width)

    def lanes_overlapped(self, lateral: float, width: float, along: float) -> range:
        """Return the lanes that a body `width` m wide, with its centre at `lateral`, overlaps; see Road."""
        reach, lanes = self.overlap_reach(width), self.lanes_at(along)
        first = max(math.floor((lateral - reach) / self.lane_width) + 1, lanes.start)
        last = min(math.ceil((lateral + reach) / self.lane_width) - 1, lanes.stop - 1)
        return range(first, last + 1)

    def lane_lines(self, along: float) -> np.ndarray:
        """Return the lateral offsets (lanes there + 1,), m, of the lines beside the lanes at s, from the right."""
        return self._lines[self._section(along)]

    def heading_at(self, along: float) -> float:
        """Return the road's heading in the world, rad, in (−π, π]."""
        _, _, x_1, y_1, _, _ = curve_at(along, self._spacing, self.lap, self._coefficients)
        return math.atan2(y_1, x_1)

    def curvature_at(self, along: float) -> float:
        """Return dheading/ds, 1/m, positive where the road bends to the left."""
        return float(bend_and_stretch(along, 0.0, self._spacing, self.lap, self._coefficients)[0])

    @cached_property
    def _reference(self) -> float:
        return self.reference_lane * self.lane_width

    def stretch_at(self, along: float, lateral: float) -> float:
        """Return how many metres of the world a metre of s is at d; 1 all over a straight road."""
        offset = lateral - self._reference
        return float(bend_and_stretch(along, offset, self._spacing, self.lap, self._coefficients)[1])

    def bend_rate(self, along: float, lateral: float, forward: float) -> float:
        """Return how fast the road turns under who goes along it at `forward` m/s, rad/s: dθ/dt = ω − this."""
        offset = lateral - self._reference
        bend, stretch = bend_and_stretch(along, offset, self._spacing, self.lap, self._coefficients)
        return float(bend * forward / stretch)

    def to_world(
        self, along: Coordinate, lateral: Coordinate, heading: Coordinate
    ) -> tuple[Coordinate, Coordinate, Coordinate]:
        """Return world x, y (m) and heading (rad) of road coordinates: three numbers, or three arrays of one shape."""
        if isinstance(along, float):
            offset = float(lateral) - self._reference
            place = place_beside_curve(along, offset, self._spacing, self.lap, self._coefficients)
            return place[0], place[1], place[2] + heading
        shape = np.shape(along)
        s, d = np.ravel(np.asarray(along, float)), np.ravel(np.asarray(lateral, float))
        places = places_beside_curve(s, d - self._reference, self._spacing, self.lap, self._coefficients)
        x, y, direction = (place.reshape(shape)[()] for place in places)  # of one place, a number
        return x, y, direction + heading

    def from_world(self, x: float, y: float, heading: float, near: float) -> tuple[float, float, float]:
        """Return s, d (m) and the heading relative to the road (rad, in [−π, π]) of a place near an s; see Road."""
        along, offset, direction = place_on_curve(x, y, near, self._spacing, self.lap, self._coefficients)
        return along, offset + self._reference, math.remainder(heading - direction, math.tau)

    def nearest_along(self, x: float, y: float) -> float:
        """Return the s (m) of the spline's knot that is nearest to a place in the world, to begin `from_world` with."""
        return self._spacing * float(np.argmin(np.hypot(*(self.knots - [x, y]).T)))
