"""A study: many episodes driven by an engine, each kept as a run folder, and the tables made from them."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from shutil import rmtree
from typing import Any

import pandas as pd
import tomli_w

from hj_cosim import __version__
from hj_cosim.analysis.run_folder import require_free_folder
from hj_cosim.cosim.configuration import config_toml
from hj_cosim.errors import RunFolderError
from hj_cosim.files import whole_file
from hj_cosim.locations import runs_folder
from hj_cosim.reachability.value_table import find_specification, load_table, table_path
from hj_cosim.study.cluster import DaskCluster
from hj_cosim.study.design import Cell, StudyDesign, design_study, parse_variation
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.jobs import Engine, EpisodeFunction, EpisodeJob, Keep, Outcome
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.results import config_of, is_complete, read_result
from hj_cosim.study.stacks import PAPER_STACKS, Stack
from hj_cosim.study.statistics import RowStatistics
from hj_cosim.study.tables import (
    MACHINE_DEPENDENT,
    Row,
    comparison_table,
    difference_table,
    study_table,
    write_csv,
    write_parquet,
)

STUDY = "study.toml"
TABLE = "table.csv"
DIFFERENCES = "differences.csv"
COMPARISON = "comparison.csv"
EPISODES_TABLE = "episodes.parquet"
WINDOWS = "windows.parquet"
WALL_TIMES = "wall_times.csv"
EPISODES = "episodes"
FAILURES = "failures"
FIGURES = "figures"

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Failure:
    """An episode that could not be driven."""

    stack: str  # its folder below episodes/
    seed: int
    reason: str  # one sentence
    log: Path  # what the worker printed


@dataclass(frozen=True)
class Study:
    """A study that has been carried out."""

    folder: Path
    table: pd.DataFrame  # table.csv
    differences: pd.DataFrame  # differences.csv
    comparison: pd.DataFrame  # comparison.csv
    failures: tuple[Failure, ...]


def run_study(
    scenarios: str | Sequence[str] = "paper",
    *,
    episodes: int = 20,
    seed: int = 0,
    preset: str = "best",
    stacks: Sequence[Stack] = PAPER_STACKS,
    vary: Sequence[str] = (),
    assignments: Sequence[str] = (),
    workers: int | None = None,
    scheduler: str | None = None,
    keep: Keep = "all",
    resume: bool = False,
    folder: Path | None = None,
    progress: Progress | None = None,
    solving: Progress | None = None,
) -> Study:
    """Drive every stack in every scenario on the same seeds, and write the study's folder (SPEC section 2).

    The tables and figures depend on what is asked for alone: not on the number of workers, their kind, or whether
    the study was killed and resumed. Wall times are kept apart, in wall_times.csv.

    Args:
        scenarios: names in sumo_net/ or paths to scenario TOMLs.
        episodes: per row of the table.
        seed: the first of `episodes` consecutive seeds, the same for every row.
        preset: `best` or `paper`.
        stacks: planner, filter and scheme, in the order of the table's rows; the paper's ten by default.
        vary: texts `KEY=VALUE,VALUE`, a row per combination, for example `planner.gamma_r=0.8,0.9,1.0`.
        assignments: texts `KEY=VALUE` for every episode, as `hj-cosim run --set` takes them.
        workers: processes on this machine, as many as there are cores unless told otherwise.
        scheduler: address of a Dask scheduler whose workers are to drive instead, for example tcp://10.0.0.1:8786.
        keep: `all` that a run folder holds, or without the cars' trajectories (`robot`), a twentieth of the size.
        resume: go on with the study in `folder`, which must have been asked for in the same way; more episodes than
            before are fine. What is there is kept, what is missing or failed is driven.
        folder: where; a new one in runs/ by default.
        progress: called with the episodes done, failed ones included, and the episodes in all.
        solving: called with the steps done and the steps in all while a value table is solved.

    Returns:
        The tables, and which episodes failed; these are missing in the tables.

    Raises:
        ConfigurationError: if anything is unknown, of the wrong type or out of range.
        RunFolderError: if `folder` is in use and not to be resumed, or holds another study, or cannot be written.
        WorkerError: if workers cannot be started, or the scheduler cannot be reached.
    """
    design = design_study(
        (scenarios,) if isinstance(scenarios, str) else tuple(scenarios),
        episodes=episodes,
        seed=seed,
        preset=preset,
        stacks=tuple(stacks),
        variations=tuple(parse_variation(text) for text in vary),
        assignments=tuple(assignments),
    )
    engine: Engine = LocalWorkers(workers) if scheduler is None else DaskCluster(scheduler)
    folder = folder or new_study_folder(design)
    prepare_folder(folder, resume=resume)
    tables = {name: solved_table(name, solving) for name in sorted({cell.config.table for cell in design.cells})}
    jobs = remaining_jobs(design, folder, tables=tables, keep=keep)
    write_description(design, folder, preset=preset, vary=vary, assignments=assignments)
    total = len(design.cells) * len(design.seeds)
    present = total - len(jobs)

    def report(done: int) -> None:
        if progress is not None:
            progress(present + done, total)

    report(0)
    failures = carry_out(jobs, folder, engine, drive_episode, report)
    return write_tables(design, folder, failures)


def write_description(
    design: StudyDesign, folder: Path, *, preset: str, vary: Sequence[str], assignments: Sequence[str]
) -> None:
    """Write study.toml: what was asked for, in the words of the command line; it marks the folder as a study's."""
    description = {
        "hj_cosim": __version__,
        "scenarios": list(dict.fromkeys(cell.scenario for cell in design.cells)),
        "stacks": list(dict.fromkeys(cell.stack.name for cell in design.cells)),
        "episodes": len(design.seeds),
        "seed": design.seeds[0],
        "preset": preset,
        "vary": list(vary),
        "set": list(assignments),
    }
    with whole_file(folder / STUDY) as temporary:
        temporary.write_text(tomli_w.dumps(description), encoding="utf-8")


def solved_table(name: str, progress: Progress | None = None) -> Path:
    """Return the file of a solved value table; solve it first if there is none or its specification changed."""
    load_table(name, progress)
    return table_path(find_specification(name))


def new_study_folder(design: StudyDesign) -> Path:
    """Return a folder that does not exist yet, in runs/, named for the scenarios and the first seed."""
    scenarios = "-".join(dict.fromkeys(cell.scenario for cell in design.cells))
    name = f"study-{scenarios}-{design.seeds[0]}"
    folders = (runs_folder() / (name if attempt == 1 else f"{name}-{attempt}") for attempt in count(1))
    return next(folder for folder in folders if not folder.exists())


def remaining_jobs(design: StudyDesign, folder: Path, *, tables: Mapping[str, Path], keep: Keep) -> list[EpisodeJob]:
    """Return the episodes that are not in a study's folder yet.

    Args:
        design: the study.
        folder: the study's.
        tables: the solved value table of each name in the configurations.
        keep: what the run folders are to hold.

    Raises:
        RunFolderError: if an episode that is there was driven with another configuration.
    """
    jobs = []
    for cell, seed in design.episodes():
        config = cell.config.model_copy(update={"seed": seed})
        run_folder = episode_folder(design, folder, cell, seed)
        if not is_complete(run_folder):
            jobs.append(EpisodeJob(config, tables[config.table], run_folder, keep))
        elif config_of(run_folder) != config_toml(config):
            raise RunFolderError(
                f"{run_folder} was driven with another configuration than is asked for now; resume with the options"
                f" in {folder / STUDY}, or choose another --out"
            )
    return jobs


def episode_folder(design: StudyDesign, folder: Path, cell: Cell, seed: int) -> Path:
    """Return the run folder of an episode."""
    return folder / EPISODES / design.folder_name(cell) / str(seed)


def prepare_folder(folder: Path, *, resume: bool) -> None:
    """Make sure that a study can go to a folder: a new one, or an interrupted study's, cleared of what was cut short.

    Raises:
        RunFolderError: if the folder holds something else, or a study that is not to be resumed.
    """
    holds_study = (folder / STUDY).is_file()
    if holds_study and not resume:
        raise RunFolderError(f"{folder} already holds a study; add --resume to go on with it, or choose another --out")
    if not holds_study:
        require_free_folder(folder)
    for unfinished in (folder / EPISODES).glob("**/.*"):
        rmtree(unfinished, ignore_errors=True)
    rmtree(folder / FAILURES, ignore_errors=True)


def carry_out(
    jobs: Sequence[EpisodeJob],
    folder: Path,
    engine: Engine,
    function: EpisodeFunction,
    progress: Callable[[int], None] | None = None,
) -> tuple[Failure, ...]:
    """Have an engine drive the jobs, and keep the logs of those that fail in the study's `failures/`.

    Args:
        jobs: what to drive.
        folder: the study's.
        engine: where.
        function: how.
        progress: called with how many of the jobs are done.

    Returns:
        The episodes that failed, in the order of the jobs.
    """
    failures: dict[Path, Failure] = {}
    with closing(engine.run(jobs, function)) as outcomes:
        for done, outcome in enumerate(outcomes, start=1):
            # A worker that was killed after it put the folder in place has done its work.
            if outcome.error is not None and not is_complete(outcome.job.folder):
                failures[outcome.job.folder] = _keep_log(outcome, folder)
            if progress is not None:
                progress(done)
    return tuple(failures[job.folder] for job in jobs if job.folder in failures)


def _keep_log(outcome: Outcome, folder: Path) -> Failure:
    place = outcome.job.folder.relative_to(folder / EPISODES)
    failure = Failure(
        place.parent.as_posix(),
        outcome.job.config.seed,
        str(outcome.error),
        (folder / FAILURES / place).with_suffix(".log"),
    )
    with whole_file(failure.log) as temporary:
        temporary.write_text(f"{failure.reason}\n\n{outcome.log}", encoding="utf-8")
    return failure


def write_tables(design: StudyDesign, folder: Path, failures: tuple[Failure, ...] = ()) -> Study:
    """Write a study's tables from the episodes that are there, and return them.

    Raises:
        RunFolderError: if an episode's run folder cannot be read, or the tables cannot be written.
    """
    rows, episodes, windows, wall_times = [], [], [], []
    for cell in design.cells:
        results = []
        for seed in design.seeds:
            run_folder = episode_folder(design, folder, cell, seed)
            if not is_complete(run_folder):
                continue
            result, own_windows = read_result(run_folder)
            results.append(result)
            factors = {**cell.factors, "seed": seed}
            episodes.append({**factors, **_without(result.summary, (*factors, *MACHINE_DEPENDENT))})
            windows += [{**factors, **window} for window in own_windows]
            wall_times.append({**factors, **{name: result.summary[name] for name in MACHINE_DEPENDENT}})
        rows.append(Row(cell, RowStatistics(results), len(design.seeds) - len(results)))
    table, differences = study_table(rows), difference_table(rows)
    study = Study(folder, table, differences, comparison_table(table), failures)
    write_csv(study.table, folder / TABLE)
    write_csv(study.differences, folder / DIFFERENCES)
    write_csv(study.comparison, folder / COMPARISON)
    write_csv(pd.DataFrame(wall_times), folder / WALL_TIMES)
    write_parquet(episodes, folder / EPISODES_TABLE)
    write_parquet(windows, folder / WINDOWS)
    (folder / FIGURES).mkdir(exist_ok=True)
    return study


def _without(summary: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    return {name: value for name, value in summary.items() if name not in names}
