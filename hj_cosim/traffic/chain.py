"""A chain of edges of a SUMO network: which lanes go on into which, and how long and wide they are.

What it looks like as a curve is route.py's business; who only asks how many lanes there are needs none.
"""

import itertools
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from hj_cosim.errors import NetworkError
from hj_cosim.settings import NetworkSettings
from hj_cosim.traffic.net_graph import Link, NetGraph, read_graph, shortest_route
from hj_cosim.traffic.network import NARROWEST_LANE, read_road
from hj_cosim.traffic.sumo_lanes import Section, SumoLane

SHORTEST_ROUTE = 100.0  # m
WIDTH_TOLERANCE = 0.3  # m, by which lanes may be wider or narrower than most of the road's


def read_lane_count(path: Path, network: NetworkSettings) -> int:
    """Return how many lanes the road has that a scenario's `[network]` means; see route.read_network.

    Raises:
        NetworkError: if the file is missing or malformed, or these edges are no road.
    """
    if is_one_edge(network):
        return read_road(path, network.edge).lane_count
    return read_chain(path, network).lane_count


def is_one_edge(network: NetworkSettings) -> bool:
    """Return whether a scenario's road is one straight edge."""
    return network.route is None and network.from_edge is None


def read_chain(path: Path, network: NetworkSettings) -> "EdgeChain":
    """Return the edges that a scenario's `[network]` names, or those on the shortest way between two.

    Raises:
        NetworkError: if the file is missing or malformed, or these edges are no road.
    """
    net = read_graph(path)
    edges = network.route or shortest_route(net, str(network.from_edge), str(network.to_edge))
    return EdgeChain(net, edges, network.laps)


class EdgeChain:
    """A chain of edges on its way to becoming a road.

    Args:
        net: the network.
        edges: their names, in order.
        laps: how often they are driven; more than once where the last leads to the first.

    Raises:
        NetworkError: if these edges are no road.
    """

    def __init__(self, net: NetGraph, edges: Sequence[str], laps: int) -> None:
        self.net, self.edges, self.laps = net, tuple(edges), laps
        for edge in self.edges:
            net.require_edge(edge)
        if len(set(edges)) < len(edges):
            raise NetworkError(f"{net.path}: network.route names an edge twice; for rounds, set network.laps")
        self._offsets = [0]  # of each edge: a lane's number less its index
        self._pairs = list(itertools.pairwise(self.edges))
        for source, target in self._pairs:
            self._offsets.append(self._offsets[-1] + self._shift(source, target))
        if laps > 1:
            self._pairs.append((self.edges[-1], self.edges[0]))
            if self._offsets[-1] + self._shift(*self._pairs[-1]) != self._offsets[0]:
                raise NetworkError(f"{net.path}: network.laps = {laps}, but the route's lanes lead to other lanes")
        self.sections = self._sections()  # with the junctions, from the beginning to the end; lanes count from 0
        self.width = self._width()  # of most lanes, m
        self.length = self.sections[-1].start + self.sections[-1].length  # m, of one lap
        if self.length < SHORTEST_ROUTE:
            raise NetworkError(
                f"{net.path}: the route is {self.length:.0f} m long; take {SHORTEST_ROUTE:.0f} m or more"
            )

    @property
    def lane_count(self) -> int:
        """How many lanes there are, counted over the entire chain."""
        return 1 + max(max(section.lanes) for section in self.sections)

    def _usable(self, source: str, target: str) -> list[Link]:
        """Return the links between two edges that cars may take, the left-most last."""
        net = self.net
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

    def _sections(self) -> list[Section]:
        """Return the edges and the junctions between them; the right-most lane that there is anywhere is 0."""
        sections: list[Section] = []
        start = 0.0
        for place, (edge, offset) in enumerate(zip(self.edges, self._offsets, strict=True)):
            lanes = {index: self.net.lane(edge, index) for index in self.net.lanes[edge]}
            chains: dict[int, tuple[SumoLane, ...]] = {
                index + offset: (self.net.sumo_lane(edge, index),) for index, lane in lanes.items() if lane.admits_cars
            }
            if not chains:
                raise NetworkError(f"{self.net.path}: edge {edge!r} has no lane for cars")
            chains = _contiguous(chains)
            sections.append(Section(start, chains[max(chains)][0].length, False, chains))
            start += sections[-1].length
            if place < len(self._pairs):
                sections.append(self._junction(place, start))
                start += sections[-1].length
        lowest = min(min(section.lanes) for section in sections)
        return [
            Section(each.start, each.length, each.is_junction, {n - lowest: lane for n, lane in each.lanes.items()})
            for each in sections
        ]

    def _junction(self, place: int, start: float) -> Section:
        source, target = self._pairs[place]
        after = (place + 1) % len(self.edges)
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
        before, via = self.net.sumo_lane(source, link.source_lane), link.via
        lanes = []
        while via:
            edge, _, index = via.rpartition("_")
            before = self.net.sumo_lane(edge, int(index), before)
            lanes.append(before)
            onward = [each for each in self.net.links.get((edge, target), ()) if each.source_lane == int(index)]
            via = onward[0].via if onward else ""
        return tuple(lanes)

    def _width(self) -> float:
        """Return the width of most of the road's lanes, m; lanes that deviate from it too far are refused."""
        lanes = [(edge, self.net.lane(edge, index)) for edge in self.edges for index in self.net.lanes[edge]]
        lanes = [(edge, lane) for edge, lane in lanes if lane.admits_cars]
        width = float(np.median([lane.width for _, lane in lanes]))
        for edge, lane in lanes:
            if abs(lane.width - width) > WIDTH_TOLERANCE or lane.width < NARROWEST_LANE:
                raise NetworkError(
                    f"{self.net.path}: edge {edge!r} has a lane {lane.width:.2f} m wide, most of the route's are"
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
