"""The figures of a study from its folder, and its tables as they draw them; anybody may have made them."""

from collections.abc import Iterable, Sequence
from pathlib import Path

import pandas as pd
import pyarrow.parquet as pq

from hj_cosim.analysis.figures.attack import BEHAVIOUR, SHARE, attack
from hj_cosim.analysis.figures.attack import ROWS as ATTACK_ROWS
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS
from hj_cosim.analysis.figures.style import Drawing
from hj_cosim.analysis.figures.sweep import PANELS, density_sweep, sweep
from hj_cosim.analysis.figures.target_sets import TABLE as TARGET_TABLE
from hj_cosim.analysis.figures.target_sets import target_sets
from hj_cosim.analysis.figures.trade_off import METRICS_SHOWN, trade_off
from hj_cosim.errors import RunFolderError
from hj_cosim.recording.run_folder import CONFIG, read_config
from hj_cosim.recording.study_files import EPISODES, STUDY, TABLE
from hj_cosim.settings import Scenario, validate
from hj_cosim.traffic.chain import read_lane_count
from hj_cosim.traffic.sources.density import density
from hj_cosim.traffic.sources.scenarios import network_path

LARGEST_STUDY_TABLE = 100_000_000  # bytes
MOST_STUDY_ROWS = 10_000_000
TEXT_COLUMNS = ("scenario", *STACK_COLUMNS)
KNOBS = (BEHAVIOUR, SHARE, TARGET_TABLE)  # columns of studies that varied them


def trade_off_of(folder: Path, **width: int) -> Drawing:
    """Return the trade-off of a study, by its folder."""
    metrics = _with_intervals(METRICS_SHOWN)
    return trade_off(read_study_table(folder / TABLE, (*STACK_COLUMNS, *metrics)), **width)


def sweep_of(folder: Path, **width: int) -> Drawing:
    """Return what a varied setting does in a study, by its folder."""
    metrics = _with_intervals(metric for metric, _ in PANELS)
    return sweep(read_study_table(folder / TABLE, (*STACK_COLUMNS, *metrics)), **width)


def density_sweep_of(folder: Path, **width: int) -> Drawing:
    """Return what density does in a study, by its folder."""
    metrics = _with_intervals(metric for metric, _ in PANELS)
    table = read_study_table(folder / TABLE, ("scenario", *STACK_COLUMNS, "episodes", *metrics))
    densities = scenario_densities(folder)
    unknown = sorted(set(table.scenario) - densities.keys())
    if unknown:
        raise RunFolderError(f"{folder} holds no complete study: it has no episode of scenario {unknown[0]}")
    return density_sweep(table, densities, **width)


def attack_of(folder: Path, **width: int) -> Drawing:
    """Return what drivers who mean harm do in a study, by its folder."""
    metrics = _with_intervals(metric for metric, _ in ATTACK_ROWS)
    return attack(read_study_table(folder / TABLE, (*STACK_COLUMNS, "episodes", *metrics, BEHAVIOUR, SHARE)), **width)


def target_sets_of(folder: Path, **width: int) -> Drawing:
    """Return what the target sets of a study are worth, by its folder."""
    metrics = _with_intervals(METRICS_SHOWN)
    return target_sets(read_study_table(folder / TABLE, ("scenario", *STACK_COLUMNS, *metrics, TARGET_TABLE)), **width)


def _with_intervals(metrics: Iterable[str]) -> list[str]:
    return [f"{metric}{ending}" for metric in metrics for ending in ("", "_lo", "_hi")]


def scenario_densities(study: Path) -> dict[str, float]:
    """Return the density (cars per km and lane) of every scenario in a study, from its episodes' configurations."""
    densities: dict[str, float] = {}
    for path in sorted(study.glob(f"{EPISODES}/**/{CONFIG}")):
        scenario = validate(Scenario, read_config(path.parent)["scenario"], str(path))
        if scenario.name not in densities:
            lanes = read_lane_count(network_path(scenario.network), scenario.network)
            densities[scenario.name] = density(scenario.traffic, lanes)
    return densities


def read_study_table(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """Return one of a study's tables, .csv or .parquet, which anybody may have made.

    Args:
        path: the file.
        columns: what it must have; those not in TEXT_COLUMNS, no rogues' behaviour and no table's name, hold numbers.

    Raises:
        RunFolderError: if it is missing, broken, too large, or has not those columns, of which those of KNOBS are
            looked for last if they are named last.
    """
    broken = f"{path.parent} holds no complete study: {path.name}"
    try:
        if path.stat().st_size > LARGEST_STUDY_TABLE:
            raise RunFolderError(f"{broken} is too large; {LARGEST_STUDY_TABLE / 1e6:g} MB is the most")
        if path.suffix == ".csv":
            table = pd.read_csv(path, keep_default_na=False, na_values=[""]).copy()  # one piece, not one a column
        else:
            with pq.ParquetFile(path) as file:
                if file.metadata.num_rows > MOST_STUDY_ROWS:
                    raise RunFolderError(f"{broken} has {file.metadata.num_rows} rows; {MOST_STUDY_ROWS} is the most")
            table = pd.read_parquet(path)
    except FileNotFoundError as error:
        if (path.parent / STUDY).is_file():
            raise RunFolderError(
                f"the study in {path.parent} is not finished, {path.name} is missing;"
                f" hj-cosim study --resume --out {path.parent} goes on with it"
            ) from error
        raise RunFolderError(f"{broken} is missing") from error
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{broken}: {error}") from error
    for name in columns:
        if name not in table and name in KNOBS:
            raise RunFolderError(f"the study in {path.parent} did not vary {name}, which the figure is about")
        if name not in table:
            raise RunFolderError(f"{broken} has no column {name}")
        if name not in (*TEXT_COLUMNS, BEHAVIOUR, TARGET_TABLE) and not pd.api.types.is_numeric_dtype(table[name]):
            raise RunFolderError(f"{broken}: column {name} must be of numbers")
    return table
