"""A SUMO network's file as a stream of elements, and what a lane in it says of itself.

The file, packed (.net.xml.gz) or not, is read piece by piece, and refused before anything in it is expanded if it has a
DOCTYPE, includes other files (SUMO would read them), or is larger or deeper than LARGEST_NETWORK and DEEPEST_NETWORK.
"""

import gzip
import math
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from xml.parsers import expat

import numpy as np

from hj_cosim.errors import NetworkError

DEFAULT_LANE_WIDTH = 3.2  # m, SUMO's, for lanes that state none
CAR_CLASS = "passenger"
LARGEST_NETWORK = 100_000_000  # bytes once unpacked, a large city's
READ_AT_ONCE = 1 << 20  # bytes
DEEPEST_NETWORK = 50  # elements within each other; SUMO writes four


@dataclass(frozen=True)
class NetLane:
    """One lane as the network states it."""

    width: float  # m
    length: float  # m
    speed: float  # m/s, its limit; NaN if it states none
    shape: np.ndarray  # (points, 3) m
    admits_cars: bool


def lane_of(attributes: Mapping[str, str]) -> NetLane:
    """Return the lane that a <lane> element describes.

    Raises:
        KeyError, ValueError: if it lacks a length or a shape, or they are not what they should be.
    """
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
    return NetLane(width, length, float(attributes.get("speed", math.nan)), shape, admits)


def read_elements(path: Path, on_element: Callable[[str, dict[str, str]], None], wanted: str) -> None:
    """Call `on_element` with the name and the attributes of every element, in the order of the file.

    Args:
        path: the network.
        on_element: may raise KeyError or ValueError where `wanted` has a lane that cannot be read.
        wanted: whose lanes are read, for that message.

    Raises:
        NetworkError: if the file is missing or malformed.
    """
    roots: list[tuple[str, bool]] = []  # the outermost element, and whether it states a version
    depth = 0

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal depth
        depth += 1
        if depth > DEEPEST_NETWORK:
            raise NetworkError(f"{path} has more than {DEEPEST_NETWORK} elements within each other; no network does")
        if name == "include":
            raise NetworkError(f"{path} includes another file; write what it has into the network itself")
        if not roots:
            roots.append((name, "version" in attributes))
        on_element(name, attributes)

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
        raise NetworkError(f"{path}: {wanted} has a lane without a readable index, length or shape") from error
    name, states_version = roots[0]
    if name != "net":
        raise NetworkError(f"{path} is not a SUMO network: its root is <{name}>, not <net>")
    if not states_version:  # SUMO crashes on such a file
        raise NetworkError(f'{path}: its <net> states no version; write <net version="1.20">')


def _pieces(path: Path) -> Iterator[bytes]:
    """Yield the content of a network piece by piece, unpacked, no more than LARGEST_NETWORK in all."""
    size = 0
    with gzip.open(path) if path.suffix == ".gz" else path.open("rb") as file:
        while piece := file.read(READ_AT_ONCE):
            size += len(piece)
            if size > LARGEST_NETWORK:
                raise NetworkError(f"{path} is too large; {LARGEST_NETWORK // 10**6} MB of network is the most")
            yield piece
