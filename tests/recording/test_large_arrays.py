"""Arrays that lie in a file when they are large."""

import resource
from pathlib import Path

import numpy as np
import pytest

from hj_cosim.errors import HjCosimError
from hj_cosim.recording import large_arrays
from hj_cosim.recording.large_arrays import zeros


def mapped_files():
    """Return how many deleted files this process has mapped (proc(5))."""
    return sum(line.rstrip().endswith("(deleted)") for line in Path("/proc/self/maps").read_text().splitlines())


@pytest.mark.parametrize("dtype", [float, bool, np.int8])
def test_large_array_is_like_any_other(monkeypatch, dtype):
    monkeypatch.setattr(large_arrays, "LARGEST_IN_MEMORY", 1000)
    before = mapped_files()
    small, large = zeros((10, 10), np.int8), zeros((100, 70), dtype)
    assert mapped_files() == before + 1
    assert type(large) is np.ndarray
    assert (large.shape, large.dtype, large.any()) == ((100, 70), np.dtype(dtype), False)
    large[3, 60:] = 1
    assert large.sum() == 10
    assert small.sum() == 0
    del large
    assert mapped_files() == before


def test_array_that_does_not_fit_on_the_disk_is_refused(monkeypatch):
    monkeypatch.setattr(large_arrays, "LARGEST_IN_MEMORY", 1000)
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with pytest.raises(HjCosimError, match=r"cannot write .*: File too large; choose another place or free it"):
            zeros((100, 200))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
