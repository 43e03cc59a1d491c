"""A SUMO network as a graph: its edges, what leads from one to another, and the shortest way between two."""

import heapq
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import numpy as np

from hj_cosim.errors import NetworkError
from hj_cosim.traffic.net_file import NetLane, lane_of, read_elements
from hj_cosim.traffic.sumo_lanes import SumoLane


class Link(NamedTuple):
    """A connection of two edges' lanes, as the network has it."""

    source_lane: int
    target_lane: int
    via: str  # the name of the lane inside the junction; empty if the network has none


@dataclass(frozen=True)
class NetGraph:
    """What a network's file says, lanes unread."""

    path: Path
    lanes: dict[str, dict[int, dict[str, str]]]  # by edge and index: a lane's attributes
    inner: frozenset[str]  # edges inside junctions
    links: dict[tuple[str, str], list[Link]]  # by source and target edge
    following: dict[str, list[str]]  # the edges that each leads to
    _read: dict[tuple[str, int], NetLane] = field(default_factory=dict, init=False, repr=False, compare=False)

    def require_edge(self, edge: str) -> None:
        """Check that there is an edge of that name, outside of junctions.

        Raises:
            NetworkError: if there is none.
        """
        if edge not in self.lanes or edge in self.inner:
            shown = ", ".join(sorted(set(self.lanes) - self.inner)[:8]) or "none"
            raise NetworkError(f"{self.path} has no edge {edge!r}; it has {shown}, ...")

    @cached_property
    def arriving(self) -> Mapping[str, Sequence[tuple[str, int]]]:
        """The lanes, as edge and index, from which each lane is entered, by its name; those inside junctions count."""
        found: dict[str, list[tuple[str, int]]] = defaultdict(list)
        for (source, target), links in self.links.items():
            for link in links:
                found[link.via or f"{target}_{link.target_lane}"].append((source, link.source_lane))
        return found

    def sumo_lane(self, edge: str, index: int, before: SumoLane | None = None) -> SumoLane:
        """Return a lane with its centre line.

        Args:
            edge, index: its name.
            before: the lane that leads to it, whose direction it has if it is a point: on the inner side of a bend, a
                junction's lane may be one.

        Raises:
            NetworkError: if it cannot be read.
        """
        lane = self.lane(edge, index)
        shape = without_repeats(lane.shape[:, :2])
        if len(shape) < 2 and before is not None:
            onward = before.shape[-1] - before.shape[-2]
            shape = np.vstack([shape, shape[0] + 0.01 * onward / np.hypot(*onward)])
        return SumoLane(edge, index, lane.length, shape)

    def lane(self, edge: str, index: int) -> NetLane:
        """Return a lane; it is read when it is first asked for.

        Raises:
            NetworkError: if it cannot be read.
        """
        if (edge, index) in self._read:
            return self._read[edge, index]
        try:
            return self._read.setdefault((edge, index), lane_of(self.lanes[edge][index]))
        except (KeyError, ValueError) as error:
            raise NetworkError(
                f"{self.path}: edge {edge!r} has a lane without a readable index, length or shape"
            ) from error


def without_repeats(shape: np.ndarray) -> np.ndarray:
    """Return a polyline (N, 2) of which no two points in a row are the same."""
    return shape[np.append(True, np.hypot(*np.diff(shape, axis=0).T) > 1e-6)]


def read_graph(path: Path) -> NetGraph:
    """Return the network in a file, packed or not.

    Raises:
        NetworkError: if it is missing or malformed.
    """
    lanes: dict[str, dict[int, dict[str, str]]] = {}
    inner, links, following = set(), defaultdict(list), defaultdict(list)
    edge = ""

    def on_element(name: str, attributes: dict[str, str]) -> None:
        nonlocal edge
        if name == "edge":
            edge = attributes["id"]
            lanes[edge] = {}
            if attributes.get("function") == "internal":
                inner.add(edge)
        elif name == "lane":
            lanes[edge][int(attributes["index"])] = dict(attributes)
        elif name == "connection":
            key = (attributes["from"], attributes["to"])
            links[key].append(Link(int(attributes["fromLane"]), int(attributes["toLane"]), attributes.get("via", "")))
            if len(links[key]) == 1:
                following[key[0]].append(key[1])

    read_elements(path, on_element, "an edge")
    return NetGraph(path, lanes, frozenset(inner), dict(links), dict(following))


def shortest_route(net: NetGraph, start: str, stop: str) -> tuple[str, ...]:
    """Return the shortest chain of edges from one to another, by their lengths (Dijkstra).

    Raises:
        NetworkError: if one of them does not exist, or none leads from one to the other.
    """
    for edge in (start, stop):
        net.require_edge(edge)
    waiting, came_from = [(0.0, start, "")], {}
    while waiting:
        far, edge, before = heapq.heappop(waiting)
        if edge in came_from:
            continue
        came_from[edge] = before
        if edge == stop:
            break
        for after in net.following.get(edge, ()):
            if after not in came_from and after not in net.inner:
                heapq.heappush(waiting, (far + float(net.lanes[after][0]["length"]), after, edge))
    if stop not in came_from:
        raise NetworkError(f"{net.path}: no route leads from edge {start!r} to edge {stop!r}; name two that one does")
    route = [stop]
    while came_from[route[-1]]:
        route.append(came_from[route[-1]])
    return tuple(reversed(route))
