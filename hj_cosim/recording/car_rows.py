"""The cars of a stretch of samples as rows: as many as were there, however many others come and go."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hj_cosim.recording.record import Piece, TrafficTrack
from hj_cosim.scene.observation import Observation

MOTION = ("x", "y", "heading", "speed", "acceleration")


class CarRows(NamedTuple):
    """R rows, a car at a sample each, in the order of the samples and then of the cars' numbers."""

    sample: np.ndarray  # (R,) int, counted from the stretch's first
    vehicle: np.ndarray  # (R,) int, the cars' numbers
    x: np.ndarray  # (R,) m
    y: np.ndarray  # (R,) m
    heading: np.ndarray  # (R,) rad
    speed: np.ndarray  # (R,) m/s
    acceleration: np.ndarray  # (R,) m/s²
    lane: np.ndarray  # (R,) int
    length: np.ndarray  # (R,) m
    width: np.ndarray  # (R,) m


def rows_of(observations: Sequence[Observation]) -> CarRows:
    """Return the cars of consecutive observations as rows."""
    counts = [len(each.x) for each in observations]
    sample = np.repeat(np.arange(len(observations), dtype=np.int32), counts)

    def joined(name: str) -> np.ndarray:
        return np.concatenate([np.empty(0), *(getattr(each, name) for each in observations)])

    rows = CarRows(
        sample=sample,
        vehicle=joined("vehicle").astype(np.int32),
        lane=joined("lane").astype(np.int8),
        **{name: joined(name) for name in (*MOTION, "length", "width")},
    )
    if ((np.diff(rows.vehicle) <= 0) & (np.diff(sample) == 0)).any():  # a world may list them in any order
        order = np.lexsort((rows.vehicle, sample))
        rows = CarRows(*(column[order] for column in rows))
    return rows


def rows_of_track(traffic: TrafficTrack, samples: slice) -> CarRows:
    """Return some samples of a track as rows."""
    present = traffic.present[samples]
    sample, vehicle = np.nonzero(present)
    return CarRows(
        sample=sample,
        vehicle=vehicle,
        lane=traffic.lane[samples][present].astype(np.int8),
        length=traffic.length[vehicle],
        width=traffic.width[vehicle],
        **{name: getattr(traffic, name)[samples][present] for name in MOTION},
    )


def fill(track: TrafficTrack, rows: CarRows, first: int, column: np.ndarray | None = None) -> None:
    """Put rows into a track.

    Args:
        track: sizes and samples of cars are written.
        rows: of samples from the track's `first` on.
        first: sample.
        column: (R,) int, which of the track's cars each row is about; that of its number unless given.
    """
    column = rows.vehicle if column is None else column
    place = (rows.sample + first, column)
    track.present[place] = True
    for name in (*MOTION, "lane"):
        getattr(track, name)[place] = getattr(rows, name)
    track.length[column], track.width[column] = rows.length, rows.width


def track_of(observations: Sequence[Observation], names: tuple[str, ...]) -> TrafficTrack:
    """Return the track of consecutive observations, of cars by number.

    Raises:
        HjCosimError: if it fits neither into memory nor onto the disk (see large_arrays).
    """
    none = np.zeros(len(names))
    track, everybody = TrafficTrack.empty(names, none, none.copy(), len(observations)), np.arange(len(names))
    known: np.ndarray | None = None  # numbers that are everybody's; the same array is often seen again
    for each in observations:
        if known is not None and each.vehicle is known:
            continue
        if not np.array_equal(each.vehicle, everybody):
            fill(track, rows_of(observations), 0)
            return track
        known = each.vehicle
    if observations:  # all are there all the time, in order
        track.present[:] = True
        for name in (*MOTION, "lane"):
            columns = [getattr(each, name) for each in observations]
            np.concatenate(columns, out=getattr(track, name).reshape(-1), casting="unsafe")
        track.length[:], track.width[:] = observations[-1].length, observations[-1].width
    return track


def piece_of(rows: CarRows, first: int, count: int, names: Sequence[str]) -> Piece:
    """Return `count` samples from `first` on as a piece, with a column for each car that is in them.

    Raises:
        HjCosimError: if it fits neither into memory nor onto the disk (see large_arrays).
    """
    cars, column = np.unique(rows.vehicle, return_inverse=True)
    none = np.zeros(len(cars))
    track = TrafficTrack.empty(tuple(names[car] for car in cars.tolist()), none, none.copy(), count)
    fill(track, rows, 0, column)
    return Piece(slice(first, first + count), cars, track)
