"""Arrays that may be larger than the memory."""

import math
import mmap
import os
import tempfile
from pathlib import Path

import numpy as np
import numpy.typing as npt

from hj_cosim.files import naming_the_place

# bytes; the seven arrays of a drive of 100 cars are larger from eleven minutes on.
LARGEST_IN_MEMORY = 1 << 25


def zeros(shape: tuple[int, ...], dtype: npt.DTypeLike = float) -> np.ndarray:
    """Return an array of zeros, which lies in a file without a name where it is larger than LARGEST_IN_MEMORY.

    The system keeps of such an array in memory what there is room for, so that the disk and not the memory limits how
    long a drive may be. The file is gone with the array, or with the process, however that ends.

    Raises:
        HjCosimError: if the file does not fit into the system's folder for temporary files.
    """
    kind = np.dtype(dtype)
    size = math.prod(shape) * kind.itemsize
    if size <= LARGEST_IN_MEMORY:
        return np.zeros(shape, kind)
    with naming_the_place(Path(tempfile.gettempdir())), tempfile.TemporaryFile() as file:
        file.truncate(size)
        if hasattr(os, "posix_fallocate"):  # a disk that fills up later would end the process without a word
            os.posix_fallocate(file.fileno(), 0, size)
        memory = mmap.mmap(file.fileno(), size)
    return np.frombuffer(memory, kind).reshape(shape)
