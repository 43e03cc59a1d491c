"""Reading the episodes of a study back from their run folders, whoever drove them and whenever."""

import json
import math
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hj_cosim.errors import RunFolderError
from hj_cosim.metrics.catalogue import SAMPLE_COLUMNS
from hj_cosim.recording.run_folder import CONFIG, ROBOT, SUMMARY
from hj_cosim.recording.summary_file import read_timing
from hj_cosim.study.statistics import EpisodeResult

WINDOW = 10.0  # s, over which the paper's trade-off figure takes its points


def is_complete(folder: Path) -> bool:
    """Return whether an episode's run folder is in place; it appears whole or not at all."""
    return (folder / SUMMARY).is_file()


def config_of(folder: Path) -> str:
    """Return the text of a run folder's config.toml.

    Raises:
        RunFolderError: if it cannot be read.
    """
    try:
        return (folder / CONFIG).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise RunFolderError(f"{folder} holds no readable run ({error}); remove it and --resume the study") from error


def read_result(folder: Path) -> tuple[EpisodeResult, list[dict[str, float]]]:
    """Return what the study's tables take from a run folder, and its windows (see `windows`).

    Raises:
        RunFolderError: if a file is missing or broken.
    """
    try:
        summary = json.loads((folder / SUMMARY).read_text(encoding="utf-8"))
        columns = ("time", *dict.fromkeys((*SAMPLE_COLUMNS, "speed")))
        table = pq.read_table(folder / ROBOT, columns=list(columns), use_threads=False)
        samples = {name: table[name].to_numpy() for name in columns}
        finite = {name: math.inf if value is None else value for name, value in summary.items()}
        of_threats = {name: samples[name] for name in SAMPLE_COLUMNS}
        result = EpisodeResult(int(finite["seed"]), finite, of_threats, read_timing(folder))
    except (OSError, ValueError, KeyError, pa.ArrowException) as error:
        raise RunFolderError(f"{folder} holds no readable run ({error}); remove it and --resume the study") from error
    return result, windows(samples)


def windows(samples: dict[str, np.ndarray]) -> list[dict[str, Any]]:
    """Return the points of an episode in the paper's trade-off figure, one for each whole ten seconds.

    Args:
        samples: `time` (s), `ttc` (s) and `speed` (m/s) of an episode.

    Returns:
        start (s), ttc_p1 (s, the 1st percentile of TTC, a sample itself) and mean_speed (m/s) of each.
    """
    time, ttc, speed = samples["time"], samples["ttc"], samples["speed"]
    if len(time) < 2:
        return []
    length = round(WINDOW / (time[1] - time[0]))
    starts = range(0, len(time) - length + 1, length)
    return [
        {
            "start": float(time[start]),
            "ttc_p1": float(np.percentile(ttc[start : start + length], 1.0, method="lower")),
            "mean_speed": float(np.mean(speed[start : start + length])),
        }
        for start in starts
    ]
