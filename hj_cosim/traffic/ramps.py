"""The lanes beside a route that lead onto it or off it: cars there are seen before they merge and after they leave."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hj_cosim.scene.road import Road
from hj_cosim.traffic.net_graph import NetGraph
from hj_cosim.traffic.sumo_lanes import Beside, LanePlace, Section, SumoLane

SEEN_ALONG = 300.0  # m before a ramp joins the road, and after it leaves it
SEEN_ASIDE = 25.0  # m from the lane that it leads to
_EVERY = 10.0  # m


class _Piece(NamedTuple):
    """A lane of a ramp, and the s at which it would begin if it lay along the road."""

    lane: SumoLane
    start: float  # m of s
    number: int  # the road's lane that it leads to or comes from


def lanes_of_ramps(net: NetGraph, sections: Sequence[Section], road: Road) -> dict[str, LanePlace]:
    """Return the places of the lanes that lead onto a route's lanes or off them, by their names in SUMO.

    Args:
        net: the network.
        sections: of the route.
        road: the same.
    """
    own = {lane.edge for section in sections for chain in section.lanes.values() for lane in chain}
    found: dict[str, LanePlace] = {}
    for section in sections:
        if section.is_junction:
            continue
        for number, (lane,) in section.lanes.items():
            pieces = [*_leading_on(net, lane, section.start, number, own)]
            pieces += _leading_off(net, lane, section.start + section.length, number, own)
            for piece in pieces:
                place = _place(piece, road)
                if place is not None and piece.lane.name not in found:
                    found[piece.lane.name] = place
    return found


def _leading_on(net: NetGraph, lane: SumoLane, start: float, number: int, own: set[str]) -> Iterator[_Piece]:
    """Yield the lanes from which a lane of the road, beginning at s = start, is reached, the nearest first."""
    waiting = [(lane, start)]
    while waiting:
        onto, begins = waiting.pop()
        for edge, index in net.arriving.get(onto.name, ()):
            if edge in own or not net.lane(edge, index).admits_cars:
                continue
            before = net.sumo_lane(edge, index)
            yield _Piece(before, begins - before.length, number)
            if start - begins + before.length < SEEN_ALONG:
                waiting.append((before, begins - before.length))


def _leading_off(net: NetGraph, lane: SumoLane, stop: float, number: int, own: set[str]) -> Iterator[_Piece]:
    """Yield the lanes that are reached from a lane of the road that ends at s = stop, the nearest first."""
    waiting = [(lane, stop)]
    while waiting:
        origin, begins = waiting.pop()
        for target in net.following.get(origin.edge, ()):
            if target in own:
                continue
            for link in net.links[origin.edge, target]:
                if link.source_lane != origin.index:
                    continue
                edge, _, index = link.via.rpartition("_")
                after = net.sumo_lane(edge, int(index)) if link.via else net.sumo_lane(target, link.target_lane)
                if after.edge in own or not net.lane(after.edge, after.index).admits_cars:
                    continue
                yield _Piece(after, begins, number)
                if begins + after.length - stop < SEEN_ALONG:
                    waiting.append((after, begins + after.length))


def _place(piece: _Piece, road: Road) -> LanePlace | None:
    """Return where a ramp's lane lies; None if none of it is near the road."""
    lane = piece.lane
    if len(lane.shape) < 2:
        return None
    position = np.linspace(0.0, lane.length, max(round(lane.length / _EVERY), 1) + 1)
    lateral = np.empty(len(position))
    for i, at in enumerate(position.tolist()):
        x, y, heading = lane.world(at, 0.0)
        _, lateral[i], _ = road.from_world(x, y, heading, piece.start + at)
    aside = np.abs(lateral - road.lane_centre(piece.number, piece.start))
    near = np.flatnonzero(aside <= SEEN_ASIDE)
    if len(near) < 2:
        return None
    seen = slice(int(near[0]), int(near[-1]) + 1)
    return LanePlace(piece.number, piece.start, 1.0, Beside(position[seen], lateral[seen]))
