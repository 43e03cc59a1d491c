"""Reading the road frame from a SUMO network: any straight edge of two or more equally wide lanes."""

import gzip
import math
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import numpy as np

from hj_cosim.errors import NetworkError
from hj_cosim.scene.road import StraightRoad

# What counts as straight, parallel and equally wide (m), and as parallel (rad): above the centimetres that nets are
# rounded to, below what a planner or a table would notice.
POSITION_TOLERANCE = 0.05
LENGTH_TOLERANCE = 0.1
DEFAULT_LANE_WIDTH = 3.2  # m, SUMO's, for lanes that state none
NARROWEST_LANE = 2.5  # m
CAR_CLASS = "passenger"
LARGEST_NETWORK = 100_000_000  # bytes once unpacked, a large city's
READ_AT_ONCE = 1 << 20  # bytes
DEEPEST_NETWORK = 50  # elements within each other; SUMO writes four


@dataclass(frozen=True)
class _Lane:
    """One lane as the network states it."""

    width: float  # m
    length: float  # m
    shape: np.ndarray  # (points, 3) m
    admits_cars: bool


def read_road(path: Path, edge: str) -> StraightRoad:
    """Return the road that `edge` of the SUMO network at `path` is.

    The file, packed (.net.xml.gz) or not, is read as a stream, and refused before anything in it is expanded if it has
    a DOCTYPE, includes other files (SUMO would read them), or is larger or deeper than LARGEST_NETWORK and
    DEEPEST_NETWORK.

    Raises:
        NetworkError: if the file is missing or malformed, or the edge is not a straight one of two or more
            equally wide, parallel lanes that admit cars.
    """
    lanes, edges = _read_lanes(path, edge)
    if edge not in edges:
        shown = ", ".join(sorted(edges)[:8]) or "none"
        raise NetworkError(f"{path} has no edge {edge!r}; set network.edge to one of its edges ({shown})")
    where = f"{path}: edge {edge!r}"
    if len(lanes) < 2:
        raise NetworkError(f"{where} has {len(lanes)} lane; two or more are needed to overtake")
    return _road_of(lanes, where)


def _read_lanes(path: Path, edge: str) -> tuple[list[_Lane], set[str]]:
    """Return the lanes of `edge`, from the right, and the names of all edges that are not inside a junction."""
    lanes: dict[int, _Lane] = {}
    edges: set[str] = set()
    roots: list[tuple[str, bool]] = []  # the outermost element, and whether it states a version
    inside = False

    depth = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal inside, depth
        depth += 1
        if depth > DEEPEST_NETWORK:
            raise NetworkError(f"{path} has more than {DEEPEST_NETWORK} elements within each other; no network does")
        if name == "include":
            raise NetworkError(f"{path} includes another file; write what it has into the network itself")
        if not roots:
            roots.append((name, "version" in attributes))
        if name == "edge" and attributes.get("function") != "internal":
            edges.add(attributes.get("id", ""))
            inside = attributes.get("id") == edge
        elif name == "edge":
            inside = False
        elif name == "lane" and inside:
            lanes[int(attributes["index"])] = _lane_of(attributes)

    def end(_: str) -> None:
        nonlocal depth
        depth -= 1

    def refuse_doctype(*_: object) -> None:
        raise NetworkError(f"{path} has a DOCTYPE, which SUMO networks do not have; remove it")

    parser = expat.ParserCreate()
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    parser.StartDoctypeDeclHandler = refuse_doctype
    try:
        for piece in _pieces(path):
            parser.Parse(piece)
        parser.Parse(b"", True)
    except (EOFError, zlib.error, gzip.BadGzipFile) as error:
        raise NetworkError(f"{path} is not a SUMO network: it cannot be unpacked ({error})") from error
    except OSError as error:
        raise NetworkError(
            f"cannot read the network {path}: {error.strerror}; set network.file to a .net.xml"
        ) from error
    except expat.ExpatError as error:
        raise NetworkError(f"{path} is not a SUMO network: {error}") from error
    except (KeyError, ValueError) as error:
        raise NetworkError(f"{path}: edge {edge!r} has a lane without a readable index, length or shape") from error
    name, states_version = roots[0]
    if name != "net":
        raise NetworkError(f"{path} is not a SUMO network: its root is <{name}>, not <net>")
    if not states_version:  # SUMO crashes on such a file
        raise NetworkError(f'{path}: its <net> states no version; write <net version="1.20">')
    return [lanes[index] for index in sorted(lanes)], edges


def _pieces(path: Path) -> Iterator[bytes]:
    """Yield the content of a network piece by piece, unpacked, no more than LARGEST_NETWORK in all."""
    size = 0
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        while piece := file.read(READ_AT_ONCE):
            size += len(piece)
            if size > LARGEST_NETWORK:
                raise NetworkError(f"{path} is too large; {LARGEST_NETWORK // 10**6} MB of network is the most")
            yield piece


def _lane_of(attributes: dict[str, str]) -> _Lane:
    points = [[float(part) for part in point.split(",")] for point in attributes["shape"].split()]
    if len(points) < 2 or not all(len(point) in (2, 3) for point in points):
        raise ValueError("shape")
    shape = np.array([point if len(point) == 3 else [*point, 0.0] for point in points])
    length, width = float(attributes["length"]), float(attributes.get("width", DEFAULT_LANE_WIDTH))
    if not (np.isfinite(shape).all() and math.isfinite(length) and math.isfinite(width)):
        raise ValueError("not finite")
    allowed, refused = attributes.get("allow"), attributes.get("disallow", "")
    admits = (
        CAR_CLASS in allowed.split() or allowed == "all" if allowed else not {CAR_CLASS, "all"} & set(refused.split())
    )
    return _Lane(width, length, shape, admits)


def _road_of(lanes: list[_Lane], where: str) -> StraightRoad:
    """Return the road that these lanes are, or say what keeps them from being one."""
    first = lanes[0]
    origin = first.shape[0, :2]
    along = first.shape[-1, :2] - origin
    length = float(np.hypot(*along))
    if length < 1.0:
        raise NetworkError(f"{where} is {length:.2f} m long; name a longer one")
    heading = math.atan2(along[1], along[0])
    leftwards = np.array([-math.sin(heading), math.cos(heading)])
    for number, lane in enumerate(lanes):
        name = f"{where}, lane {number}"
        if not lane.admits_cars:
            raise NetworkError(f"{name} does not admit cars ({CAR_CLASS}); name an edge of car lanes only")
        if abs(lane.width - first.width) > POSITION_TOLERANCE or lane.width < NARROWEST_LANE:
            raise NetworkError(
                f"{name} is {lane.width:.2f} m wide and lane 0 {first.width:.2f} m; lanes must be equally wide,"
                f" and at least {NARROWEST_LANE} m"
            )
        if np.ptp(lane.shape[:, 2]) > POSITION_TOLERANCE:
            raise NetworkError(f"{name} has a slope; only flat roads are supported")
        offset = (lane.shape[:, :2] - origin) @ leftwards - number * first.width
        if np.abs(offset).max() > POSITION_TOLERANCE:
            raise NetworkError(
                f"{name} is not straight and parallel: its centre line is {np.abs(offset).max():.2f} m"
                f" from where lane 0 puts it; name a straight edge"
            )
        if abs(lane.length - length) > LENGTH_TOLERANCE:
            raise NetworkError(
                f"{name} states a length of {lane.length:.2f} m, but its shape is {length:.2f} m long; make them agree"
            )
    return StraightRoad(len(lanes), first.width, length, float(origin[0]), float(origin[1]), heading)
