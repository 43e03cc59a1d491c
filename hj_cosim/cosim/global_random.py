"""What a user's own planner, filter or rogue draws from the global generators of Python and NumPy."""

import random
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def global_random_of(seed: int) -> Iterator[None]:
    """Seed both global generators for the block, so that an episode is the same whatever was driven before it.

    Ours never draw from them. Whoever calls finds them as they were.

    Args:
        seed: of the episode.
    """
    pythons, numpys = random.getstate(), np.random.get_state()  # noqa: NPY002 - what strangers draw from
    random.seed(seed)
    np.random.seed(seed % 2**32)  # noqa: NPY002
    try:
        yield
    finally:
        random.setstate(pythons)
        np.random.set_state(numpys)  # noqa: NPY002
