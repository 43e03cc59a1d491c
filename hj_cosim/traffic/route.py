"""Making a road of a chain of edges of a SUMO network: one smooth curve, with lanes that begin and end beside it."""

from collections import defaultdict
from collections.abc import Sequence
from functools import lru_cache
from pathlib import Path

import numpy as np

from hj_cosim.scene.road import Road
from hj_cosim.scene.route_road import RouteRoad
from hj_cosim.settings import NetworkSettings
from hj_cosim.traffic.chain import EdgeChain, is_one_edge, read_chain
from hj_cosim.traffic.net_graph import without_repeats
from hj_cosim.traffic.network import read_road
from hj_cosim.traffic.ramps import lanes_of_ramps
from hj_cosim.traffic.sumo_lanes import Section, SumoLanes


def read_network(path: Path, network: NetworkSettings) -> tuple[Road, SumoLanes | None]:
    """Return the road that a scenario's `[network]` means, and what SUMO calls its lanes, if that is a route.

    Args:
        path: the network's file.
        network: names one straight edge, a chain of edges, or the two ends of one.

    Raises:
        NetworkError: if the file is missing or malformed, or these edges are no road.
    """
    if is_one_edge(network):
        return read_road(path, network.edge), None
    if not path.is_file():
        return _read_route(path, network)  # which says what is wrong
    file = path.stat()
    return _read_once(path, network.model_dump_json(), file.st_mtime_ns, file.st_size)


# A study's worker drives many episodes on a road, and reading it takes as long as a second and a half of a drive.
@lru_cache(maxsize=8)
def _read_once(path: Path, network: str, changed: int, size: int) -> tuple[Road, SumoLanes | None]:
    """Return what `read_network` does; a file that has changed is read anew."""
    return _read_route(path, NetworkSettings.model_validate_json(network))


def _read_route(path: Path, network: NetworkSettings) -> tuple[Road, SumoLanes | None]:
    chain = read_chain(path, network)
    road = _road(chain)
    return road, SumoLanes(chain.edges, chain.sections, chain.laps, lanes_of_ramps(chain.net, chain.sections, road))


def _road(chain: EdgeChain) -> RouteRoad:
    """Return a chain of edges as a road."""
    from hj_cosim.traffic.smoothing import smooth_knots  # with SciPy's sparse matrices, which only routes wait for

    sections, length = chain.sections, chain.length
    reference = _reference_lane(sections)
    along, points = _polyline(sections, reference, chain.width)
    knots = smooth_knots(along, points, length, closed=chain.laps > 1)
    first = np.array([min(section.lanes) for section in sections])
    count = np.array([len(section.lanes) for section in sections])
    changes = np.flatnonzero(np.append(True, (np.diff(first) != 0) | (np.diff(count) != 0)))
    last_of_each = np.append(changes[1:] - 1, len(sections) - 1)
    return RouteRoad(
        lane_count=chain.lane_count,
        lane_width=chain.width,
        length=length * chain.laps,
        knots=knots,
        reference_lane=reference,
        section_start=np.array([section.start for section in sections])[changes],
        first_lane=first[changes],
        lanes_there=count[changes],
        leading_off=np.array([_leading_off(chain, sections[last]) for last in last_of_each]),
        lap=length if chain.laps > 1 else 0.0,
        **_limits(chain),
    )


def _limits(chain: EdgeChain) -> dict[str, np.ndarray]:
    """Return where speed limits begin and what they are: those of the fastest lane of each section."""
    sections = chain.sections
    limits = np.array([_limit(chain, section) for section in sections])
    if not np.isfinite(limits).all():
        return {}
    changes = np.append(True, np.diff(limits) != 0.0)
    return {"limit_start": np.array([section.start for section in sections])[changes], "limit": limits[changes]}


def _limit(chain: EdgeChain, section: Section) -> float:
    return max(min(chain.net.lane(lane.edge, lane.index).speed for lane in lanes) for lanes in section.lanes.values())


def _leading_off(chain: EdgeChain, section: Section) -> int:
    """Return the bit set of a section's lanes that lead to edges which are not the route's."""
    net = chain.net
    found = 0
    for number, lanes in section.lanes.items():
        last = lanes[-1]
        onward = [edge for edge in net.following.get(last.edge, ()) if edge not in chain.edges]
        links = [link for edge in onward for link in net.links[last.edge, edge]]
        found |= any(link.source_lane == last.index for link in links) << number
    return found


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
