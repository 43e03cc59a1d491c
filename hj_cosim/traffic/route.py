"""Reading a road from a chain of edges of a SUMO network: curves, junctions, lanes that begin and end."""

import itertools
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from hj_cosim.errors import NetworkError
from hj_cosim.scene.road import Road
from hj_cosim.scene.route_road import RouteRoad
from hj_cosim.settings import NetworkSettings
from hj_cosim.traffic.net_graph import Link, NetGraph, read_graph, shortest_route, without_repeats
from hj_cosim.traffic.network import NARROWEST_LANE, read_road
from hj_cosim.traffic.ramps import lanes_of_ramps
from hj_cosim.traffic.sumo_lanes import Section, SumoLane, SumoLanes

# Real networks have a vertex every 50 m and bends of several degrees there. A spline through them swings out by metres;
# resampled and smoothed like this it stays within 0.6 m, and so do its curvature and whoever follows it.
KNOT_SPACING = 10.0  # m
SMOOTHNESS = 20.0  # weight of the squared third differences against the squared deviations
SHORTEST_ROUTE = 100.0  # m
WIDTH_TOLERANCE = 0.3  # m, by which lanes may be wider or narrower than most of the road's


def read_network(path: Path, network: NetworkSettings) -> tuple[Road, SumoLanes | None]:
    """Return the road that a scenario's `[network]` means, and what SUMO calls its lanes, if that is a route.

    Args:
        path: the network's file.
        network: names one straight edge, a chain of edges, or the two ends of one.

    Raises:
        NetworkError: if the file is missing or malformed, or these edges are no road.
    """
    if network.route is None and network.from_edge is None:
        return read_road(path, network.edge), None
    net = read_graph(path)
    edges = network.route or shortest_route(net, str(network.from_edge), str(network.to_edge))
    return _Route(net, edges, network.laps).road()


class _Route:
    """A chain of edges on its way to becoming a road.

    Args:
        net: the network.
        edges: their names, in order.
        laps: how often they are driven; more than once where the last leads to the first.
    """

    def __init__(self, net: NetGraph, edges: Sequence[str], laps: int) -> None:
        self._net, self._edges, self._laps = net, tuple(edges), laps
        for edge in self._edges:
            net.require_edge(edge)
        if len(set(edges)) < len(edges):
            raise NetworkError(f"{net.path}: network.route names an edge twice; for rounds, set network.laps")
        self._offsets = [0]  # of each edge: a lane's number less its index
        self._pairs = list(itertools.pairwise(self._edges))
        for source, target in self._pairs:
            self._offsets.append(self._offsets[-1] + self._shift(source, target))
        if laps > 1:
            self._pairs.append((self._edges[-1], self._edges[0]))
            if self._offsets[-1] + self._shift(*self._pairs[-1]) != self._offsets[0]:
                raise NetworkError(f"{net.path}: network.laps = {laps}, but the route's lanes lead to other lanes")

    def _usable(self, source: str, target: str) -> list[Link]:
        """Return the links between two edges that cars may take, the left-most last."""
        net = self._net
        links = sorted(net.links.get((source, target), ()))
        if not links:
            shown = ", ".join(net.following.get(source, ())) or "nowhere"
            raise NetworkError(f"{net.path}: edge {source!r} does not lead to {target!r} but to {shown}")
        links = [
            link
            for link in links
            if net.lane(source, link.source_lane).admits_cars and net.lane(target, link.target_lane).admits_cars
        ]
        if not links:
            raise NetworkError(f"{net.path}: no lane for cars leads from edge {source!r} to {target!r}")
        if not all(link.via for link in links):
            raise NetworkError(
                f"{net.path} has no lanes inside the junction from edge {source!r} to {target!r}; make it without"
                " --no-internal-links"
            )
        return links

    def _shift(self, source: str, target: str) -> int:
        last = self._usable(source, target)[-1]
        return last.source_lane - last.target_lane

    def road(self) -> tuple[Road, SumoLanes]:
        """Return the road and its lanes in SUMO."""
        sections = self._sections()
        lowest = min(min(section.lanes) for section in sections)
        sections = [
            Section(each.start, each.length, each.is_junction, {n - lowest: lane for n, lane in each.lanes.items()})
            for each in sections
        ]
        width = self._width()
        length = sections[-1].start + sections[-1].length
        if length < SHORTEST_ROUTE:
            raise NetworkError(
                f"{self._net.path}: the route is {length:.0f} m long; take {SHORTEST_ROUTE:.0f} m or more"
            )
        reference = _reference_lane(sections)
        along, points = _polyline(sections, reference, width)
        knots = smooth_knots(along, points, length, closed=self._laps > 1)
        first = np.array([min(section.lanes) for section in sections])
        count = np.array([len(section.lanes) for section in sections])
        changes = np.flatnonzero(np.append(True, (np.diff(first) != 0) | (np.diff(count) != 0)))
        last_of_each = np.append(changes[1:] - 1, len(sections) - 1)
        road = RouteRoad(
            lane_count=int((first + count).max()),
            lane_width=width,
            length=length * self._laps,
            knots=knots,
            reference_lane=reference,
            section_start=np.array([section.start for section in sections])[changes],
            first_lane=first[changes],
            lanes_there=count[changes],
            leading_off=np.array([self._leading_off(sections[last]) for last in last_of_each]),
            lap=length if self._laps > 1 else 0.0,
            **self._limits(sections),
        )
        return road, SumoLanes(self._edges, sections, self._laps, lanes_of_ramps(self._net, sections, road))

    def _limits(self, sections: Sequence[Section]) -> dict[str, np.ndarray]:
        """Return where speed limits begin and what they are: those of the fastest lane of each section."""
        limits = np.array([self._limit(section) for section in sections])
        if not np.isfinite(limits).all():
            return {}
        changes = np.append(True, np.diff(limits) != 0.0)
        return {"limit_start": np.array([section.start for section in sections])[changes], "limit": limits[changes]}

    def _limit(self, section: Section) -> float:
        return max(
            min(self._net.lane(lane.edge, lane.index).speed for lane in chain) for chain in section.lanes.values()
        )

    def _leading_off(self, section: Section) -> int:
        """Return the bit set of a section's lanes that lead to edges which are not the route's."""
        lanes = 0
        for number, chain in section.lanes.items():
            onward = self._net.following.get(chain[-1].edge, ())
            links = [
                link for edge in onward if edge not in self._edges for link in self._net.links[chain[-1].edge, edge]
            ]
            lanes |= any(link.source_lane == chain[-1].index for link in links) << number
        return lanes

    def _sections(self) -> list[Section]:
        """Return the edges and the junctions between them; their lanes' numbers may still be negative."""
        sections: list[Section] = []
        start = 0.0
        for place, (edge, offset) in enumerate(zip(self._edges, self._offsets, strict=True)):
            lanes = {index: self._net.lane(edge, index) for index in self._net.lanes[edge]}
            chains: dict[int, tuple[SumoLane, ...]] = {
                index + offset: (self._net.sumo_lane(edge, index),) for index, lane in lanes.items() if lane.admits_cars
            }
            if not chains:
                raise NetworkError(f"{self._net.path}: edge {edge!r} has no lane for cars")
            chains = _contiguous(chains)
            sections.append(Section(start, chains[max(chains)][0].length, False, chains))
            start += sections[-1].length
            if place < len(self._pairs):
                sections.append(self._junction(place, start))
                start += sections[-1].length
        return sections

    def _junction(self, place: int, start: float) -> Section:
        source, target = self._pairs[place]
        after = (place + 1) % len(self._edges)
        chains: dict[int, tuple[SumoLane, ...]] = {}
        for link in self._usable(source, target):
            number = link.source_lane + self._offsets[place]
            # A link into a lane beside leads nobody on in its lane: to the road, that lane ends here.
            if number == link.target_lane + self._offsets[after]:
                chains[number] = self._inside(link, source, target)
        chains = _contiguous(chains)
        return Section(start, sum(lane.length for lane in chains[max(chains)]), True, chains)

    def _inside(self, link: Link, source: str, target: str) -> tuple[SumoLane, ...]:
        """Return the lanes inside a junction that a link is, one behind the other."""
        before, via = self._net.sumo_lane(source, link.source_lane), link.via
        lanes = []
        while via:
            edge, _, index = via.rpartition("_")
            before = self._net.sumo_lane(edge, int(index), before)
            lanes.append(before)
            onward = [each for each in self._net.links.get((edge, target), ()) if each.source_lane == int(index)]
            via = onward[0].via if onward else ""
        return tuple(lanes)

    def _width(self) -> float:
        """Return the width of most of the road's lanes, m; lanes that deviate from it too far are refused."""
        lanes = [(edge, self._net.lane(edge, index)) for edge in self._edges for index in self._net.lanes[edge]]
        lanes = [(edge, lane) for edge, lane in lanes if lane.admits_cars]
        width = float(np.median([lane.width for _, lane in lanes]))
        for edge, lane in lanes:
            if abs(lane.width - width) > WIDTH_TOLERANCE or lane.width < NARROWEST_LANE:
                raise NetworkError(
                    f"{self._net.path}: edge {edge!r} has a lane {lane.width:.2f} m wide, most of the route's are"
                    f" {width:.2f} m; they may differ by {WIDTH_TOLERANCE} m, and are to be at least {NARROWEST_LANE} m"
                )
        return width


def _contiguous(chains: dict[int, tuple[SumoLane, ...]]) -> dict[int, tuple[SumoLane, ...]]:
    """Return the lanes that lie beside the left-most one without a gap."""
    number = max(chains)
    kept = {}
    while number in chains:
        kept[number] = chains[number]
        number -= 1
    return kept


def _reference_lane(sections: Sequence[Section]) -> int:
    """Return the left-most of the lanes that exist along the most of the road."""
    share: dict[int, float] = defaultdict(float)
    for section in sections:
        for number in section.lanes:
            share[number] += section.length
    longest = max(share.values())
    return max(number for number, length in share.items() if length >= longest - 1e-6)


def _polyline(sections: Sequence[Section], reference: int, width: float) -> tuple[np.ndarray, np.ndarray]:
    """Return s (N,) and the vertices (N, 2), m, of the reference lane's centre line.

    Where that lane does not exist, it is where the nearest one says that it would be.
    """
    along, points = [], []
    for section in sections:
        nearest = min(section.lanes, key=lambda number: abs(number - reference))
        shape = without_repeats(np.vstack([lane.shape for lane in section.lanes[nearest]]))
        if len(shape) < 2:
            continue  # a junction of no extent
        tangent = np.gradient(shape, axis=0)
        left = np.column_stack([-tangent[:, 1], tangent[:, 0]]) / np.hypot(*tangent.T)[:, np.newaxis]
        # All lanes of an edge are as long to SUMO as the middle of the road is, whatever their own way round a bend.
        middle = shape + (0.5 * (min(section.lanes) + max(section.lanes)) - nearest) * width * left
        way = np.append(0.0, np.cumsum(np.hypot(*np.diff(middle, axis=0).T)))
        along.append(section.start + way / way[-1] * section.length)
        points.append(shape + (reference - nearest) * width * left)
    return np.concatenate(along), np.vstack(points)


def smooth_knots(along: np.ndarray, points: np.ndarray, length: float, *, closed: bool) -> np.ndarray:
    """Return knots (K, 2), m, evenly spaced in s, of a curve without kinks beside a polyline.

    They are the least squares of their deviations from the polyline and, weighted, of their third differences (Eilers
    & Marx 1996, Flexible smoothing with B-splines and penalties).

    Args:
        along: (N,) m, the s of the vertices, ascending from 0 to `length`.
        points: (N, 2) m, the vertices.
        length: m.
        closed: whether the last vertex meets the first; then the last knot is the first again.
    """
    count = max(round(length / KNOT_SPACING), 8)
    at = np.linspace(0.0, length, count + 1)
    target = np.column_stack([np.interp(at, along, points[:, axis]) for axis in (0, 1)])
    if closed:
        target = target[:-1]
        difference = _rotation(count) - sparse.identity(count)
        third = difference @ difference @ difference
    else:
        third = sparse.diags([-1.0, 3.0, -3.0, 1.0], [0, 1, 2, 3], shape=(count - 2, count + 1))
    matrix = (sparse.identity(len(target)) + SMOOTHNESS * (third.T @ third)).tocsc()
    knots = np.column_stack([spsolve(matrix, target[:, axis]) for axis in (0, 1)])
    return np.vstack([knots, knots[:1]]) if closed else knots


def _rotation(count: int) -> sparse.csr_matrix:
    """Return the matrix that takes every knot of a closed curve to the next one."""
    return sparse.csr_matrix((np.ones(count), (np.arange(count), (np.arange(count) + 1) % count)))
