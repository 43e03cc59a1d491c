"""A study: many episodes driven by an engine, each kept as a run folder, and the tables made from them."""

from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass
from functools import cached_property
from html import escape
from os import PathLike
from pathlib import Path
from typing import Any

import pandas as pd

from hj_cosim.control.belief.believing_filter import WORST_TABLE
from hj_cosim.errors import ConfigurationError, RunFolderError
from hj_cosim.locations import given_path
from hj_cosim.reachability.table.size_classes import classes_met
from hj_cosim.reachability.table.sized import kept_tables, load_tables
from hj_cosim.reachability.table.store import KeptTable, kept_table, load_table
from hj_cosim.recording.run_folder import new_folder
from hj_cosim.recording.study_files import (
    CLAIMS_TABLE,
    COMPARISON,
    DIFFERENCES,
    EPISODES_TABLE,
    FIGURES,
    STUDY,
    TABLE,
    WALL_TIMES,
    WINDOWS,
)
from hj_cosim.study.claims import claim_table
from hj_cosim.study.design import StudyDesign
from hj_cosim.study.driving import drive_episode
from hj_cosim.study.engines import engine_of
from hj_cosim.study.figures import draw_figures
from hj_cosim.study.folder import Failure, StudyFolder
from hj_cosim.study.jobs import Engine, EpisodeFunction, EpisodeJob
from hj_cosim.study.onlooker import Onlooker
from hj_cosim.study.program import program_of
from hj_cosim.study.request import Texts, given_fields, new_study, resumed_study
from hj_cosim.study.results import is_complete, read_result
from hj_cosim.study.stacks import Stack
from hj_cosim.study.statistics import RowStatistics
from hj_cosim.study.tables import (
    Row,
    comparison_table,
    difference_table,
    notebook_table,
    read_csv,
    study_table,
    write_csv,
    write_parquet,
)

Progress = Callable[[int, int], None]


@dataclass(frozen=True, repr=False)
class Study:
    """A study that has been carried out: its folder and the tables in it (`study.folder` lists every file).

    Speeds are in m/s, accelerations in m/s², times in s, interventions in percent of the samples.
    """

    folder: Path
    table: pd.DataFrame  # table.csv: a row per configuration, every metric with its 95 % interval in _lo and _hi
    differences: pd.DataFrame  # differences.csv: two rows that differ in one factor, on the seeds that both have
    comparison: pd.DataFrame  # comparison.csv: the paper's numbers beside ours; empty in other traffic than the paper's
    claims: pd.DataFrame  # claims.csv: what the paper says, checked; empty in other traffic than the paper's
    failures: tuple[Failure, ...]  # episodes that could not be driven this time, and why

    @cached_property
    def episodes(self) -> pd.DataFrame:
        """A row per episode, episodes.parquet: its row's factors, seed, and the numbers of its summary.json, SI units.

        Raises:
            RunFolderError: if it is gone or broken.
        """
        try:
            return pd.read_parquet(self.folder / EPISODES_TABLE)
        except (OSError, ValueError) as error:
            raise _unreadable(self.folder, error) from error

    def __repr__(self) -> str:
        driven, crashed = (
            int(self.table["episodes"].sum()),
            int(self.table.get("collision_episodes", pd.Series()).sum()),
        )
        said = f"{len(self.table)} rows, {driven} episodes, {crashed} crashed, {self.missing} missing"
        return f"Study in {self.folder}: {said}"

    def _repr_html_(self) -> str:
        return f"<p>{escape(repr(self))}</p>{notebook_table(self.table)}"

    @property
    def missing(self) -> int:
        """The number of episodes that are not in the tables, because they failed; --resume drives them again."""
        return int(self.table["missing"].sum())


# So many parameters: each is a keyword of the library's face, and all but the first have to be named.
def run_study(
    scenarios: Texts | None = None,
    *,
    episodes: int | None = None,
    seed: int | None = None,
    preset: str | None = None,
    stacks: Stack | str | Mapping[str, str] | Sequence[Stack | str | Mapping[str, str]] | None = None,
    vary: Texts | Mapping[str, Any] | None = None,
    settings: Texts | Mapping[str, Any] | None = None,
    workers: int | None = None,
    scheduler: str | None = None,
    keep: str | None = None,
    traffic: str | None = None,
    resume: bool = False,
    out: PathLike[str] | str | None = None,
    progress: Progress | None = None,
    solving: Progress | None = None,
    watch: Onlooker | None = None,
) -> Study:
    """Drive every stack in every scenario on the same seeds, and write the study's folder, as `hj-cosim study` does.

    The tables and figures depend on what is asked for alone: not on the number of workers, their kind, or whether
    the study was killed and resumed. Wall times are kept apart, in wall_times.csv. What is asked for is kept in the
    folder's study.toml, so that `run_study(resume=True, out=...)` goes on with any study, and does nothing to a
    finished one.

    The method is the paper's (section Experimental Results) on paired seeds: all rows meet the same traffic. Intervals
    are bootstrap intervals over episodes (Efron & Tibshirani 1993).

    Args:
        scenarios: names in sumo_net/ or paths to scenario TOMLs, one or several; `paper` unless given.
        episodes: per row of the table; 20 unless given.
        seed: the first of `episodes` consecutive seeds, the same for every row; 0 unless given.
        preset: `best` (unless given) or `paper`.
        stacks: planner, filter and scheme, in the order of the table's rows, as texts that `study.stacks.parse_stack`
            reads (`hjop-spc-mi`, `mine.py:KeepRight/spc-mi`), as dicts `{"planner": "op", "filter": "spc", "scheme":
            "sw"}`, or as `Stack`s; the paper's ten unless given.
        vary: `{"planner.gamma_r": [0.8, 0.9, 1.0]}`, a row per combination, or texts `planner.gamma_r=0.8,0.9,1.0`.
        settings: for every episode, as `run_episode` takes them.
        workers: processes on this machine, as many as there are cores unless told otherwise.
        scheduler: address of a Dask scheduler whose workers are to drive instead, for example tcp://10.0.0.1:8786.
        keep: `all` that a run folder holds (unless given), or without the cars' trajectories (`robot`), a twentieth of
            the size.
        traffic: who drives the others in users' own simulations: `theirs`, their own drivers (unless given), or
            `idm-mobil`, ours.
        resume: go on with the study in `out`. What is there is kept, what is missing or failed is driven. What is
            given besides must be what the study has; more episodes are fine.
        out: the study's folder; a new one in runs/ unless given.
        progress: called with the episodes done, failed ones included, and the episodes in all.
        solving: called with the steps done and the steps in all while a value table is solved.
        watch: told which episodes begin and end, if there is one.

    Returns:
        The tables, and which episodes failed; these are missing in the tables.

    Raises:
        ConfigurationError: if anything is unknown, of the wrong type or out of range, or another study is to be resumed
            than is asked for.
        RunFolderError: if `out` is in use and not to be resumed, or cannot be written, or holds episodes of another
            version of the program.
        WorkerError: if workers cannot be started, or the scheduler cannot be reached.
    """
    given = given_fields(
        scenarios=scenarios,
        stacks=stacks,
        episodes=episodes,
        seed=seed,
        preset=preset,
        vary=vary,
        set=settings,
        keep=keep,
        traffic=traffic,
    )
    engine = engine_of(workers, scheduler, watch)
    folder = _study_folder(None if out is None else given_path(out, "out"), given, resume=resume)
    driven = folder.tables
    kept = {
        key: kept_tables(config.table, config.robot, classes_met(config.scenario.bodies))
        for key, config in sorted(driven.items())
    }
    believing = {cell.config.robot for cell in folder.design.cells if cell.config.filter.priority == "belief"}
    against_suspects = [kept_table(WORST_TABLE, robot) for robot in believing]
    folder.begin(program_of(folder.design, kept, against_suspects), resume=resume)
    if folder.is_finished():
        return read_study(folder.path)
    for config in driven.values():
        load_tables(config.table, classes_met(config.scenario.bodies), solving, robot=config.robot)
    for robot in believing:
        load_table(WORST_TABLE, solving, robot=robot)
    return conduct(folder, engine, function=drive_episode, tables=kept, progress=progress, watch=watch)


def _study_folder(out: Path | None, given: Mapping[str, Any], *, resume: bool) -> StudyFolder:
    """Return the folder of the study that is asked for; nothing is written yet."""
    if resume:
        if out is None:
            raise ConfigurationError("to resume a study, give its folder: --resume --out DIR")
        request = resumed_study(out, given)
        try:
            return StudyFolder.of(out, request)
        except ConfigurationError as error:
            raise ConfigurationError(f"{out / STUDY}: {error}") from error
    request = new_study(given)
    folder = StudyFolder.of(out or Path(), request)
    return folder if out is not None else StudyFolder(new_study_folder(folder.design), request, folder.design)


def new_study_folder(design: StudyDesign) -> Path:
    """Return a folder that does not exist yet, in runs/, named for the scenarios and the first seed."""
    scenarios = "-".join(dict.fromkeys(cell.scenario for cell in design.cells))
    return new_folder(f"study-{scenarios}-{design.seeds[0]}")


def conduct(
    folder: StudyFolder,
    engine: Engine,
    *,
    function: EpisodeFunction,
    tables: Mapping[str, Sequence[KeptTable]],
    progress: Progress | None = None,
    watch: Onlooker | None = None,
) -> Study:
    """Drive what a study's folder lacks, and write its tables.

    Args:
        folder: the study's, begun.
        engine: where the episodes are driven.
        function: how one is driven.
        tables: the solved value tables of each `table_key` of the configurations, that of cars first.
        progress: called with the episodes done and the episodes in all.
        watch: told which episodes there are and which end, if there is one.

    Raises:
        RunFolderError, WorkerError: as `run_study`.
    """
    jobs = folder.remaining_jobs(tables)
    total = len(folder.design.cells) * len(folder.design.seeds)
    present = total - len(jobs)

    def report(done: int) -> None:
        if progress is not None:
            progress(present + done, total)

    report(0)
    if watch is not None:
        watch.begun(folder, jobs)
    failures = _drive(jobs, folder, engine, function, report, watch)
    return write_tables(folder, failures)


def _drive(
    jobs: Sequence[EpisodeJob],
    folder: StudyFolder,
    engine: Engine,
    function: EpisodeFunction,
    report: Callable[[int], None],
    watch: Onlooker | None,
) -> tuple[Failure, ...]:
    """Have an engine carry out the jobs, and return those that failed, in the order of the jobs."""
    failures: dict[Path, Failure] = {}
    with closing(engine.run(jobs, function)) as outcomes:
        for done, outcome in enumerate(outcomes, start=1):
            # A worker that was killed after it had put the folder in place has done its work.
            is_driven = outcome.error is None or is_complete(outcome.job.folder)
            if not is_driven:
                failures[outcome.job.folder] = folder.keep_log(outcome)
            if watch is not None:
                watch.ended(outcome, is_driven)
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
    study = Study(folder.path, table, difference_table(rows), comparison_table(rows), claim_table(rows), failures)
    write_csv(study.differences, folder.path / DIFFERENCES)
    write_csv(study.comparison, folder.path / COMPARISON)
    write_csv(study.claims, folder.path / CLAIMS_TABLE)
    write_csv(pd.DataFrame(wall_times), folder.path / WALL_TIMES)
    write_parquet(episodes, folder.path / EPISODES_TABLE)
    write_parquet(windows, folder.path / WINDOWS)
    draw_figures(folder.path, study.table, folder.path / FIGURES)
    write_csv(study.table, folder.path / TABLE)  # the last: a study that has it has all others
    return study


def read_study(folder: PathLike[str] | str) -> Study:
    """Return a study as its folder has it.

    Args:
        folder: what `run_study` or `hj-cosim study` wrote.

    Raises:
        ConfigurationError: if `folder` is no path.
        RunFolderError: if it holds no study, or one that is not finished.
    """
    path = given_path(folder, "the study's folder")
    names = (TABLE, DIFFERENCES, COMPARISON, CLAIMS_TABLE)
    for name in names:
        if not (path / name).is_file():
            raise RunFolderError(f"{path} holds no finished study: {name} is missing; run or --resume the study first")
    try:
        table, differences, comparison, claims = (read_csv(path / name) for name in names)
    except (OSError, ValueError) as error:
        raise _unreadable(path, error) from error
    return Study(path, table, differences, comparison, claims, failures=())


def _unreadable(folder: Path, error: Exception) -> RunFolderError:
    return RunFolderError(f"{folder} holds no readable study: {error}; --resume makes its tables anew")


def _without(summary: Mapping[str, Any], names: Sequence[str]) -> dict[str, Any]:
    return {name: value for name, value in summary.items() if name not in names}
