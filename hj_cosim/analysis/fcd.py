"""SUMO's floating car data: where every vehicle is in the world, and on which of SUMO's lanes."""

import math
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any
from xml.sax.saxutils import escape

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from hj_cosim.recording.record import ROBOT_NAME
from hj_cosim.scene.road import Road
from hj_cosim.settings import NetworkSettings, validate
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.sources.scenarios import network_path
from hj_cosim.traffic.sumo_lanes import SumoLanes

# What an FCD file's vehicle types are in, beside it: SUMO replays none that it does not know.
TYPES = ".types.add.xml"
OTHERS_TYPE = "DEFAULT_VEHTYPE"  # which SUMO knows without being told
TYPES_TEXT = (
    '<?xml version="1.0" encoding="UTF-8"?>\n\n<additional>\n'
    f'    <vType id="{ROBOT_NAME}" vClass="passenger" length="{{}}" width="{{}}" color="orange"/>\n'
    "</additional>\n"
)
_QUOTE = {chr(34): "&quot;"}


def row_groups(trajectories: pq.ParquetFile) -> Iterator[pa.Table]:
    """Yield a run's rows, a row group at a time; each holds whole time steps."""
    for group in range(trajectories.num_row_groups):
        yield trajectories.read_row_group(group)


def lane_names(road: Road, scenario: Mapping[str, Any]) -> str | SumoLanes | None:
    """Return what SUMO calls a run's lanes: the edge that they are on, or where each is along a route.

    Args:
        road: the run's.
        scenario: of its configuration.

    Returns:
        None for a user's own simulation, whose route is found while it runs.

    Raises:
        NetworkError: if the network of a route is no longer there, or another one.
        KeyError: if the configuration does not name a network.
    """
    network = scenario["network"]
    if road.is_straight:
        return str(network["edge"])
    if scenario.get("own", {}).get("file"):
        return None
    settings = validate(NetworkSettings, network, "scenario.network")
    return read_network(Path(network_path(settings)), settings)[1]


def write_fcd(trajectories: pq.ParquetFile, file: IO[bytes], road: Road, lanes: str | SumoLanes | None) -> None:
    """Write a run as SUMO's FCD XML.

    Args:
        trajectories: the run's.
        file: to write to.
        road: the run's.
        lanes: as `lane_names` returns them; without them the file says of no vehicle on which lane it is.
    """
    file.write(b'<?xml version="1.0" encoding="UTF-8"?>\n\n<fcd-export>\n')
    for rows in row_groups(trajectories):
        lines = _lines(rows, road, lanes).to_pylist()
        time = rows["time"].to_numpy()
        starts = np.concatenate([[0], np.flatnonzero(np.diff(time)) + 1])
        for start, stop in zip(starts, [*starts[1:], len(time)], strict=True):
            body = "\n".join(lines[start:stop])
            file.write(f'    <timestep time="{time[start]:.3f}">\n{body}\n    </timestep>\n'.encode())
    file.write(b"</fcd-export>\n")


def types_of(trajectories: pq.ParquetFile) -> str:
    """Return the additional file that defines the robot's type; the robot comes first at any time."""
    first = next(row_groups(trajectories)).slice(0, 1)
    length, width = (first[name][0].as_py() for name in ("length", "width"))
    return TYPES_TEXT.format(repr(length), repr(width))


def _lines(rows: pa.Table, road: Road, lanes: str | SumoLanes | None) -> pa.Array:
    """Return FCD's line for each row; numbers are written so that they read back as the same doubles."""
    x, y, heading, length = (rows[name].to_numpy() for name in ("x", "y", "heading", "length"))
    front = x + 0.5 * length * np.cos(heading)
    front_lateral = y + 0.5 * length * np.sin(heading)
    world_x, world_y, world_heading = road.to_world(front, front_lateral, heading)
    # + 0.0 turns the -0.0 that rounding leaves into 0.0
    angle = (90.0 - world_heading * (180.0 / math.pi)) % 360.0 + 0.0
    vehicle = rows["vehicle"].combine_chunks()
    names = vehicle.dictionary.to_pylist()
    identity = [f'        <vehicle id="{escape(name, _QUOTE)}" x="' for name in names]
    types = [f'" type="{ROBOT_NAME if name == ROBOT_NAME else OTHERS_TYPE}" speed="' for name in names]
    columns: list[Any] = [
        pa.array(identity).take(vehicle.indices),
        _text(world_x),
        '" y="',
        _text(world_y),
        '" angle="',
        _text(angle),
        pa.array(types).take(vehicle.indices),
        rows["speed"].combine_chunks().cast(pa.string()),
        *_places(rows, front, road, lanes),
        '" slope="0" acceleration="',
        rows["acceleration"].combine_chunks().cast(pa.string()),
        '"/>',
        "",
    ]
    return pc.binary_join_element_wise(*columns)


def _places(rows: pa.Table, front: np.ndarray, road: Road, lanes: str | SumoLanes | None) -> list[Any]:
    """Return the columns of a line that say where on which lane a front bumper is, at `front` m of s.

    Nothing is said of cars on ramps, which have the number of the lane beside them, a lane's width or more away.
    """
    if lanes is None:
        return []
    numbers = rows["lane"].combine_chunks()
    if isinstance(lanes, str):
        return ['" pos="', _text(front), f'" lane="{escape(lanes, _QUOTE)}_', numbers.cast(pa.string())]
    number = numbers.to_numpy()
    aside = np.abs(rows["y"].to_numpy() - road.lane_centres(number, rows["x"].to_numpy())) >= road.lane_width
    rows_of = zip(number.tolist(), front.tolist(), aside.tolist(), strict=True)
    places = (None if off_road else lanes.place(lane, along) for lane, along, off_road in rows_of)
    said = ["" if each is None else f'" pos="{each[1]!r}" lane="{escape(each[0].name, _QUOTE)}' for each in places]
    return [pa.array(said, pa.string())]


def _text(values: np.ndarray) -> pa.Array:
    return pa.array(values).cast(pa.string())
