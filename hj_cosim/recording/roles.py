"""The column `role` of trajectories.parquet, which is there where some cars' drivers mean harm."""

from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa

from hj_cosim.recording.columns import name_column
from hj_cosim.recording.record import ROBOT_NAME
from hj_cosim.recording.run_bounds import plain_numbers

ROLE = "role"
ORDINARY = "driver"  # of a car whose driver means no harm


def role_column(vehicle: np.ndarray, names: Sequence[str], rogues: Mapping[str, str]) -> pa.DictionaryArray:
    """Return what each row's vehicle is: `robot`, `driver`, or what a rogue does.

    Args:
        vehicle: (rows,) int, which of `names`.
        names: of all vehicles, the robot's first.
        rogues: what those who mean harm do, by name.
    """
    roles = [ROBOT_NAME, *(rogues.get(name, ORDINARY) for name in names[1:])]
    kinds = list(dict.fromkeys([ROBOT_NAME, ORDINARY, *sorted(rogues.values())]))
    return name_column(np.array([kinds.index(role) for role in roles])[vehicle], kinds)


def rogues_of(rows: pa.Table, vehicle: np.ndarray, names: Sequence[str]) -> dict[str, str]:
    """Return what those do who mean harm, by name; nobody does where there is no such column.

    Args:
        rows: some of trajectories.parquet.
        vehicle: (rows,) int, which of `names` each is about.
        names: of all vehicles, the robot's first.

    Raises:
        ValueError: if the column is no column of texts.
    """
    if ROLE not in rows.column_names:
        return {}
    role = rows[ROLE].combine_chunks()
    if not pa.types.is_dictionary(role.type):
        raise ValueError(f"column {ROLE} is not dictionary-encoded")
    kinds, number = role.dictionary.to_pylist(), plain_numbers(role.indices, ROLE)
    cars, first = np.unique(vehicle, return_index=True)
    found = {names[car]: kinds[number[row]] for car, row in zip(cars.tolist(), first.tolist(), strict=True)}
    return {name: kind for name, kind in found.items() if kind not in (ROBOT_NAME, ORDINARY)}
