"""Arrow columns straight from NumPy's memory.

`pyarrow.array` would do, but it imports pandas on its first call, which costs more than a whole episode.
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


def _bitmap(flags: np.ndarray) -> pa.Buffer:
    return pa.py_buffer(np.packbits(flags, bitorder="little"))
