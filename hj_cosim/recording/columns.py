"""Arrow columns straight from NumPy's memory, and back.

`pyarrow.array` and `to_numpy` would do, but they import pandas on their first call, which costs as much as an episode.
"""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa


def numeric_column(values: np.ndarray) -> pa.Array:
    """Return a one-dimensional array of numbers or booleans as an Arrow array without nulls."""
    if values.dtype == np.bool_:
        return pa.Array.from_buffers(pa.bool_(), len(values), [None, _bitmap(values)])
    memory = pa.py_buffer(np.ascontiguousarray(values))
    return pa.Array.from_buffers(pa.from_numpy_dtype(values.dtype), len(values), [None, memory])


def numbers_of(column: pa.Array | pa.ChunkedArray) -> np.ndarray:
    """Return a column of numbers or booleans without nulls as a one-dimensional array, which may not be written to."""
    whole = column.combine_chunks() if isinstance(column, pa.ChunkedArray) else column
    if not pa.types.is_boolean(whole.type):
        return np.from_dlpack(whole)
    bits = np.frombuffer(whole.buffers()[1], np.uint8)
    return np.unpackbits(bits, count=whole.offset + len(whole), bitorder="little")[whole.offset :].astype(bool)


def text_column(texts: Sequence[str]) -> pa.Array:
    """Return texts as an Arrow array of strings."""
    encoded = [text.encode() for text in texts]
    ends = np.cumsum([0, *map(len, encoded)], dtype=np.int32)
    return pa.StringArray.from_buffers(len(texts), pa.py_buffer(ends), pa.py_buffer(b"".join(encoded)))


def name_column(numbers: np.ndarray, names: Sequence[str]) -> pa.DictionaryArray:
    """Return the names of `numbers`, dictionary-encoded; a negative number is null."""
    known = numbers >= 0
    validity = None if known.all() else _bitmap(known)
    memory = pa.py_buffer(np.where(known, numbers, 0).astype(np.int32))
    indices = pa.Array.from_buffers(pa.int32(), len(numbers), [validity, memory])
    return pa.DictionaryArray.from_arrays(indices, text_column(names))


def name_numbers(column: pa.DictionaryArray, unnamed: int) -> np.ndarray:
    """Return the numbers of the names in a column of `name_column`; `unnamed` where there is none."""
    indices = column.indices
    if not indices.null_count:
        return numbers_of(indices)
    every = pa.Array.from_buffers(indices.type, len(indices), [None, indices.buffers()[1]], offset=indices.offset)
    return np.where(numbers_of(indices.is_valid()), numbers_of(every), unnamed)


def _bitmap(flags: np.ndarray) -> pa.Buffer:
    return pa.py_buffer(np.packbits(flags, bitorder="little"))
