"""A study: many episodes driven by an engine, each kept as a run folder, and the tables made from them."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import Any

import pandas as pd

from hj_cosim import __version__
from hj_cosim.locations import runs_folder
from hj_cosim.reachability.table.store import kept_table, load_table, specification_hash
from hj_cosim.recording.run_folder import Keep
from hj_cosim.study.claims import claim_table
from hj_cosim.study.cluster import DaskCluster
from hj_cosim.study.design import StudyDesign, design_study, parse_variation
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.figures import draw_figures
from hj_cosim.study.folder import (
    CLAIMS_TABLE,
    COMPARISON,
    DIFFERENCES,
    EPISODES_TABLE,
    FIGURES,
    TABLE,
    WALL_TIMES,
    WINDOWS,
    Failure,
    StudyFolder,
)
from hj_cosim.study.jobs import Engine, EpisodeFunction, EpisodeJob, table_key
from hj_cosim.study.local_workers import LocalWorkers
from hj_cosim.study.results import is_complete, read_result
from hj_cosim.study.stacks import PAPER_STACKS, Stack
from hj_cosim.study.statistics import RowStatistics
from hj_cosim.study.tables import (
    Row,
    comparison_table,
    difference_table,
    study_table,
    write_csv,
    write_parquet,
)

Progress = Callable[[int, int], None]


@dataclass(frozen=True)
class Study:
    """A study that has been carried out."""

    folder: Path
    table: pd.DataFrame  # table.csv
    differences: pd.DataFrame  # differences.csv
    comparison: pd.DataFrame  # comparison.csv
    claims: pd.DataFrame  # claims.csv
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
    study_folder = StudyFolder(folder or new_study_folder(design), design)
    study_folder.prepare(resume=resume)
    driven = {table_key(cell.config): cell.config for cell in design.cells}
    tables = {key: load_table(config.table, solving, robot=config.robot) for key, config in sorted(driven.items())}
    request = {
        "scenarios": [scenarios] if isinstance(scenarios, str) else list(scenarios),
        "stacks": [stack.name for stack in stacks],
        "episodes": episodes,
        "seed": seed,
        "preset": preset,
        "vary": list(vary),
        "set": list(assignments),
    }
    hashes = {f"table {name}": specification_hash(table.specification, table.game) for name, table in tables.items()}
    return conduct(
        study_folder,
        engine,
        request=request,
        program={"hj-cosim": __version__, "libsumo": version("libsumo"), **hashes},
        function=drive_episode,
        table_files={key: kept_table(config.table, config.robot).path for key, config in driven.items()},
        keep=keep,
        progress=progress,
    )


def new_study_folder(design: StudyDesign) -> Path:
    """Return a folder that does not exist yet, in runs/, named for the scenarios and the first seed."""
    scenarios = "-".join(dict.fromkeys(cell.scenario for cell in design.cells))
    name = f"study-{scenarios}-{design.seeds[0]}"
    folders = (runs_folder() / (name if attempt == 1 else f"{name}-{attempt}") for attempt in count(1))
    return next(folder for folder in folders if not folder.exists())


def conduct(
    folder: StudyFolder,
    engine: Engine,
    *,
    request: Mapping[str, Any],
    program: Mapping[str, str],
    function: EpisodeFunction,
    table_files: Mapping[str, Path],
    keep: Keep = "all",
    progress: Progress | None = None,
) -> Study:
    """Drive what a study's folder lacks, and write its tables.

    Args:
        folder: the study's, prepared.
        engine: where the episodes are driven.
        request: what was asked for, for study.toml.
        program: the version of everything that an episode depends on besides its configuration.
        function: how one is driven.
        table_files: the solved value table of each `table_key` of the configurations.
        keep: what the run folders are to hold.
        progress: called with the episodes done and the episodes in all.

    Raises:
        RunFolderError, WorkerError: as `run_study`.
    """
    folder.require_same_program(program)
    jobs = folder.remaining_jobs(table_files, keep)
    folder.describe(request, program)
    total = len(folder.design.cells) * len(folder.design.seeds)
    present = total - len(jobs)

    def report(done: int) -> None:
        if progress is not None:
            progress(present + done, total)

    report(0)
    failures = _drive(jobs, folder, engine, function, report)
    return write_tables(folder, failures)


def _drive(
    jobs: Sequence[EpisodeJob],
    folder: StudyFolder,
    engine: Engine,
    function: EpisodeFunction,
    report: Callable[[int], None],
) -> tuple[Failure, ...]:
    """Have an engine carry out the jobs, and return those that failed, in the order of the jobs."""
    failures: dict[Path, Failure] = {}
    with closing(engine.run(jobs, function)) as outcomes:
        for done, outcome in enumerate(outcomes, start=1):
            # A worker that was killed after it had put the folder in place has done its work.
            if outcome.error is not None and not is_complete(outcome.job.folder):
                failures[outcome.job.folder] = folder.keep_log(outcome)
            report(done)
    return tuple(failures[job.folder] for job in jobs if job.folder in failures)


def write_tables(folder: StudyFolder, failures: tuple[Failure, ...] = ()) -> Study:
    """Write a study's tables from the episodes that are there, and return them.

    Raises:
        RunFolderError: if an episode's run folder cannot be read.
    """
    rows: list[Row] = []
    episodes: list[dict[str, Any]] = []
    windows: list[dict[str, Any]] = []
    wall_times: list[dict[str, Any]] = []
    for cell in folder.design.cells:
        results = []
        for seed in folder.design.seeds:
            run_folder = folder.run_folder(cell, seed)
            if not is_complete(run_folder):
                continue
            result, own_windows = read_result(run_folder)
            results.append(result)
            factors = {**cell.factors, "seed": seed}
            episodes.append({**factors, **_without(result.summary, tuple(factors))})
            windows += [{**factors, **window} for window in own_windows]
            wall_times.append({**factors, **result.timing})
        rows.append(Row(cell, RowStatistics(results), len(folder.design.seeds) - len(results)))
    table = study_table(rows)
    study = Study(folder.path, table, difference_table(rows), comparison_table(table), claim_table(rows), failures)
    write_csv(study.table, folder.path / TABLE)
    write_csv(study.differences, folder.path / DIFFERENCES)
    write_csv(study.comparison, folder.path / COMPARISON)
    write_csv(study.claims, folder.path / CLAIMS_TABLE)
    write_csv(pd.DataFrame(wall_times), folder.path / WALL_TIMES)
    write_parquet(episodes, folder.path / EPISODES_TABLE)
    write_parquet(windows, folder.path / WINDOWS)
    draw_figures(folder.path, folder.path / FIGURES)
    return study


def _without(summary: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    return {name: value for name, value in summary.items() if name not in names}
