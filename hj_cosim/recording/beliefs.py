"""The column `belief` of trajectories.parquet, which is there where the filter judged who means harm."""

import numpy as np
import pyarrow as pa

from hj_cosim.recording.large_arrays import zeros
from hj_cosim.recording.run_bounds import plain_column

BELIEF = "belief"


class BeliefTrack:
    """The probability of each car that its driver means harm, sample by sample; NaN where nobody judged.

    Args:
        samples: that may be taken at most.
    """

    def __init__(self, samples: int) -> None:
        self._belief = zeros((samples, 0))

    def fill(self, place: tuple[int | np.ndarray, np.ndarray], belief: np.ndarray) -> None:
        """Take what was believed of some cars.

        Args:
            place: the sample or samples, and the cars' numbers, (K,) int.
            belief: (K,).

        Raises:
            HjCosimError: if it fits neither into memory nor onto the disk (see large_arrays).
        """
        cars = place[1]
        needed = int(cars.max(initial=-1)) + 1
        if needed > self._belief.shape[1]:
            before = self._belief
            self._belief = zeros((len(before), max(needed, 2 * before.shape[1])))
            self._belief[:] = np.nan
            self._belief[:, : before.shape[1]] = before
        self._belief[place] = belief

    def of(self, sample: np.ndarray, vehicle: np.ndarray) -> np.ndarray | None:
        """Return what was believed of cars at samples, (n,), NaN where nobody judged; None where nobody ever did."""
        known = self._belief.shape[1]
        if known == 0:
            return None
        found = self._belief[sample, np.minimum(vehicle, known - 1)]
        return np.where(vehicle < known, found, np.nan)

    def taken(self, samples: int, vehicles: int) -> np.ndarray | None:
        """Return the first samples, (samples, vehicles); None where nobody ever judged."""
        if self._belief.shape[1] == 0:
            return None
        belief = np.full((samples, vehicles), np.nan)
        known = min(vehicles, self._belief.shape[1])
        belief[:, :known] = self._belief[:samples, :known]
        return belief


def beliefs_of(rows: pa.Table) -> np.ndarray | None:
    """Return the belief of each row, NaN where nobody judged; None where there is no such column.

    Args:
        rows: some of trajectories.parquet.

    Raises:
        ValueError: if one is no probability.
    """
    if BELIEF not in rows.column_names:
        return None
    belief = plain_column(rows, BELIEF).astype(np.float64)
    if ((belief < 0.0) | (belief > 1.0) | np.isinf(belief)).any():
        raise ValueError(f"column {BELIEF} has what is no probability")
    return belief
