"""Every figure by its name, drawn from a run's or a study's folder or from a value table alone."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import pandas as pd
import pyarrow.parquet as pq

from hj_cosim.analysis.figures import control_sets as control_sets_figure
from hj_cosim.analysis.figures.attack import BEHAVIOUR, SHARE, attack
from hj_cosim.analysis.figures.attack import ROWS as ATTACK_ROWS
from hj_cosim.analysis.figures.drive_map import drive_map
from hj_cosim.analysis.figures.highway import highway
from hj_cosim.analysis.figures.planner_comparison import planner_comparison
from hj_cosim.analysis.figures.schematic import boxed_in, schematic
from hj_cosim.analysis.figures.snapshots import snapshots
from hj_cosim.analysis.figures.stacks import STACK_COLUMNS
from hj_cosim.analysis.figures.style import Drawing, require_width
from hj_cosim.analysis.figures.sweep import PANELS, density_sweep, sweep
from hj_cosim.analysis.figures.timeline import timeline
from hj_cosim.analysis.figures.trade_off import METRICS_SHOWN, trade_off
from hj_cosim.analysis.figures.value_along_drive import value_along_drive
from hj_cosim.analysis.figures.value_slice import value_slice
from hj_cosim.errors import OutputError, RunFolderError, TableError
from hj_cosim.reachability.table.size_classes import classes_met
from hj_cosim.reachability.table.sized import load_tables
from hj_cosim.reachability.table.store import find_specification, load_table
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import CONFIG, Run, read_config, read_run
from hj_cosim.recording.study_files import EPISODES, TABLE
from hj_cosim.settings import RobotSettings, Scenario, read_toml, validate
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.sources.placement import density
from hj_cosim.traffic.sources.scenarios import network_path

Source = Literal["run", "study", "table"]
DEFAULT_TABLE = "highway"
LARGEST_STUDY_TABLE = 100_000_000  # bytes
MOST_STUDY_ROWS = 10_000_000
TEXT_COLUMNS = ("scenario", *STACK_COLUMNS)


@dataclass(frozen=True)
class FigureKind:
    """A figure that can be asked for by name."""

    source: Source  # what it is drawn from
    description: str
    draw: Callable[..., Drawing]  # of (run), (run, table), (folder of a study), or (table)
    needs_table: bool = False  # a run's figure that looks values up


def _with_intervals(metrics: Iterable[str]) -> list[str]:
    return [f"{metric}{ending}" for metric in metrics for ending in ("", "_lo", "_hi")]


def _trade_off_of(folder: Path, **width: int) -> Drawing:
    return trade_off(read_study_table(folder / TABLE, (*STACK_COLUMNS, *_with_intervals(METRICS_SHOWN))), **width)


def _sweep_of(folder: Path, **width: int) -> Drawing:
    metrics = _with_intervals(metric for metric, _ in PANELS)
    return sweep(read_study_table(folder / TABLE, (*STACK_COLUMNS, *metrics)), **width)


def _density_sweep_of(folder: Path, **width: int) -> Drawing:
    metrics = _with_intervals(metric for metric, _ in PANELS)
    table = read_study_table(folder / TABLE, ("scenario", *STACK_COLUMNS, "episodes", *metrics))
    densities = scenario_densities(folder)
    unknown = sorted(set(table.scenario) - densities.keys())
    if unknown:
        raise RunFolderError(f"{folder} holds no complete study: it has no episode of scenario {unknown[0]}")
    return density_sweep(table, densities, **width)


def _attack_of(folder: Path, **width: int) -> Drawing:
    metrics = _with_intervals(metric for metric, _ in ATTACK_ROWS)
    return attack(read_study_table(folder / TABLE, (BEHAVIOUR, SHARE, *STACK_COLUMNS, "episodes", *metrics)), **width)


FIGURES: Mapping[str, FigureKind] = {
    "schematic": FigureKind("table", "the robot among cars, on the value function", schematic),
    "boxed-in": FigureKind("table", "the robot boxed in by four cars", boxed_in),
    "value-slice": FigureKind("table", "the paper's slice of the value function", value_slice),
    "planner-comparison": FigureKind("table", "what OP and HJOP plan, and where it leads", planner_comparison),
    "highway": FigureKind("run", "a moment from above, cars in the colours of their values", highway, True),
    "snapshots": FigureKind("run", "the drive from above at evenly spaced times", snapshots),
    "drive-map": FigureKind("run", "the network from above, and the drive in the colours of its speed", drive_map),
    "timeline": FigureKind("run", "speed, value, TTC, lane and interventions over time", timeline),
    "value-along-drive": FigureKind("run", "the values and places of the cars over time", value_along_drive, True),
    "control-sets": FigureKind(
        "run", "safe controls of SPC and RSS, MI and SW", control_sets_figure.control_sets, True
    ),
    "trade-off": FigureKind("study", "1st percentile of 2D TTC over mean speed, with intervals", _trade_off_of),
    "attack": FigureKind("study", "collisions and speed over the share of drivers who mean harm", _attack_of),
    "sweep": FigureKind("study", "speed, safety and interventions over a varied setting", _sweep_of),
    "density-sweep": FigureKind("study", "speed, safety and interventions over the density", _density_sweep_of),
}


def draw_figure(
    name: str,
    *,
    run: Path | None = None,
    study: Path | None = None,
    table: ValueTable | None = None,
    width: int | None = None,
) -> Drawing:
    """Draw a figure by its name.

    Args:
        name: one of FIGURES.
        run: a run's folder, for figures of a run.
        study: a study's folder, for figures of a study.
        table: V; unless given, the run's table, or `highway`, which is solved first if it has not been.
        width: mm, 85 (one column of a journal) or 178 (two); the figure's own unless given.

    Returns:
        The picture and its data; `style.save_drawing` writes both.

    Raises:
        OutputError: if there is no such figure or width, or the folder that it needs is not given.
        RunFolderError: if the folder does not hold what the figure needs.
        TableError: if the table cannot be had.
    """
    if name not in FIGURES:
        raise OutputError(f"no figure is called {name!r}; choose one of {', '.join(FIGURES)}")
    if width is not None:
        require_width(width)
    kind, sized = FIGURES[name], {} if width is None else {"width": width}
    if kind.source == "table":
        return kind.draw(table or load_table(DEFAULT_TABLE), **sized)
    if kind.source == "study":
        if study is None:
            raise OutputError(f"figure {name} is drawn from a study; give its folder with --study")
        return kind.draw(study, **sized)
    if run is None:
        raise OutputError(f"figure {name} is drawn from a run; give its folder with --run")
    read = read_run(run)
    return kind.draw(read, table or table_of(read), **sized) if kind.needs_table else kind.draw(read, **sized)


def table_of(run: Run) -> ValueTable:
    """Return the value table that a run was driven with, solved first if it is not there.

    Raises:
        TableError, ConfigurationError: if it cannot be had, or its game is a Python file: a run's folder may come from
            anybody, and what it names is not run.
    """
    name = str(run.config["table"])
    path = find_specification(name)
    robot = validate(RobotSettings, run.config["robot"], f"{run.folder / CONFIG}: robot")
    traffic = run.record.traffic
    sizes = classes_met(set(zip(traffic.length.tolist(), traffic.width.tolist(), strict=True)))
    if path.suffix == ".npz":  # read, it runs nothing
        return load_tables(name, sizes, robot=robot)
    dynamics = str(read_toml(path).get("dynamics", ""))
    if dynamics.endswith(".py"):
        raise TableError(
            f"{run.folder} was driven with {name}, whose game is the Python file {dynamics}, which is not run because a"
            " run's folder says so; load_table it in Python and give it to write_report or draw_figure"
        )
    return load_tables(name, sizes, robot=robot)


def scenario_densities(study: Path) -> dict[str, float]:
    """Return the density (cars per km and lane) of every scenario in a study, from its episodes' configurations."""
    densities: dict[str, float] = {}
    for path in sorted(study.glob(f"{EPISODES}/**/{CONFIG}")):
        scenario = validate(Scenario, read_config(path.parent)["scenario"], str(path))
        if scenario.name not in densities:
            road, _ = read_network(network_path(scenario.network), scenario.network)
            densities[scenario.name] = density(scenario.traffic, road.lane_count)
    return densities


def read_study_table(path: Path, columns: Sequence[str]) -> pd.DataFrame:
    """Return one of a study's tables, .csv or .parquet, which anybody may have made.

    Args:
        path: the file.
        columns: what it must have; those not in TEXT_COLUMNS, and no rogues' behaviour, hold numbers.

    Raises:
        RunFolderError: if it is missing, broken, too large, or has not those columns.
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
    except (OSError, ValueError) as error:
        raise RunFolderError(f"{broken}: {error}") from error
    for name in columns:
        if name not in table:
            raise RunFolderError(f"{broken} has no column {name}")
        if name not in (*TEXT_COLUMNS, BEHAVIOUR) and not pd.api.types.is_numeric_dtype(table[name]):
            raise RunFolderError(f"{broken}: column {name} must be of numbers")
    return table
