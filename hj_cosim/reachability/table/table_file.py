"""Reading a table's .npz that anybody may have made: nothing in it is run, and nothing is taken into memory unseen.

A .npz is a zip of .npy files, and each says in its header what it holds. Every header is read first and must state the
type and shape that is wanted; only so many bytes are then unpacked, and they must be all that there is.
"""

import math
import struct
import tokenize
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np

from hj_cosim.errors import TableError

LARGEST_TEXT = 1_000_000  # characters of `spec` and of `report`
_LONGEST_HEADER = 10_000  # bytes, numpy's own limit
_MOST_MEMBERS = 64  # a table has its values, its axes and two texts

# What zipfile, zlib and numpy raise over a file that is not what it says.
BROKEN = (
    *(OSError, ValueError, KeyError, EOFError),
    RuntimeError,  # of which an unknown compression's error is one
    *(zipfile.BadZipFile, zlib.error, struct.error, tokenize.TokenError, SyntaxError),
)


class TableFile:
    """An open .npz."""

    def __init__(self, path: Path, archive: zipfile.ZipFile) -> None:
        self._path = path
        self._archive = archive
        self.names = [member.filename.removesuffix(".npy") for member in archive.infolist()]
        if len(self.names) > _MOST_MEMBERS or len(set(self.names)) < len(self.names):
            raise ValueError(f"it holds {len(self.names)} arrays, some of which a table does not have")

    def text(self, name: str) -> str:
        """Return a string of at most LARGEST_TEXT characters.

        Raises:
            one of BROKEN: if it is longer, or no string.
        """
        with self._archive.open(f"{name}.npy") as stream:
            shape, dtype = _header(stream)
            if dtype.kind != "U" or shape != ():
                raise ValueError(f"{name} is not a text")
            if dtype.itemsize > 4 * LARGEST_TEXT:
                raise ValueError(f"{name} has {dtype.itemsize // 4} characters; {LARGEST_TEXT} is the most")
            return str(_content(stream, name, shape, dtype))

    def array(self, name: str, shape: tuple[int, ...], dtype: type) -> np.ndarray:
        """Return a finite array of a given shape and type, which the caller has found to be affordable.

        Raises:
            one of BROKEN: if it has another shape or type, or NaN or infinity in it.
        """
        with self._archive.open(f"{name}.npy") as stream:
            stated, its_type = _header(stream)
            if stated != shape or its_type != np.dtype(dtype):
                raise ValueError(
                    f"{name} is said to be {its_type} of shape {stated}; the specification in it makes it"
                    f" {np.dtype(dtype)} of shape {shape}"
                )
            claimed = self._archive.getinfo(f"{name}.npy").file_size
            if claimed != stream.tell() + math.prod(shape) * its_type.itemsize:
                raise ValueError(f"{name} is said to have {claimed} bytes, which shape {shape} does not need")
            content = _content(stream, name, shape, its_type)
        if not all(np.isfinite(part).all() for part in content):
            raise ValueError(f"{name} is not finite everywhere")
        return content


@contextmanager
def open_table_file(path: Path) -> Iterator[TableFile]:
    """Open a table's file.

    Raises:
        TableError: if the file, or what is read of it within the block, is broken.
    """
    try:
        with zipfile.ZipFile(path) as archive:
            yield TableFile(path, archive)
    except BROKEN as error:
        raise TableError(f"{path} is not a whole value table ({error}); delete it and solve it again") from error


def _header(stream: IO[bytes]) -> tuple[tuple[int, ...], np.dtype]:
    version = np.lib.format.read_magic(stream)
    if version == (1, 0):
        shape, fortran, dtype = np.lib.format.read_array_header_1_0(stream, max_header_size=_LONGEST_HEADER)
    elif version == (2, 0):
        shape, fortran, dtype = np.lib.format.read_array_header_2_0(stream, max_header_size=_LONGEST_HEADER)
    else:
        raise ValueError(f"its arrays have format {version}")
    if fortran or dtype.hasobject:
        raise ValueError("its arrays are in Fortran's order, or hold Python objects")
    return shape, dtype


def _content(stream: IO[bytes], name: str, shape: tuple[int, ...], dtype: np.dtype) -> np.ndarray:
    """Return the array that follows a header, unpacked bit by bit; there must be no more and no less."""
    content = np.empty(shape, dtype)
    memory = content.reshape(-1).view(np.uint8)
    read = 0
    while read < len(memory):
        part = stream.read(min(len(memory) - read, 1 << 20))
        if not part:
            raise EOFError(f"{name} ends too early")
        memory[read : read + len(part)] = np.frombuffer(part, np.uint8)
        read += len(part)
    if stream.read(1):
        raise ValueError(f"{name} goes on after its end")
    return content
