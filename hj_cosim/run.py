"""One run, from what is asked for to its folder with pictures in it: what `hj-cosim run` does.

The loop that drives knows nothing of pictures; here the two meet.
"""

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from hj_cosim.control.belief.believing_filter import WORST_TABLE
from hj_cosim.control.contract import SafetyFilter
from hj_cosim.cosim.configuration import resolve_config, stack_flags
from hj_cosim.cosim.episode import Episode, Progress, Watch, run_in_sumo, write_episode
from hj_cosim.cosim.repetition import Repetition, is_run_configuration, repetition
from hj_cosim.errors import ConfigurationError
from hj_cosim.locations import given_path
from hj_cosim.planning.contract import Planner
from hj_cosim.plugins import FILTER, PLANNER, given, plugin_name
from hj_cosim.reachability.table.size_classes import classes_met
from hj_cosim.reachability.table.sized import kept_tables, load_tables
from hj_cosim.reachability.table.store import load_table
from hj_cosim.recording.run_folder import new_folder, require_free_folder
from hj_cosim.rehearsal import can_be_rehearsed, rehearsed
from hj_cosim.settings import EpisodeConfig, Scenario, overlay, shown
from hj_cosim.traffic.sources.scenarios import scenario_data, scenario_path


@dataclass(frozen=True)
class EpisodeProgress:
    """Who is told how far an episode is; each is called with what is done and what there is in all."""

    driving: Progress | None = None  # samples, once a plan
    solving: Progress | None = None  # steps of the value table's solve, if it has to be solved
    drawing: Progress | None = None  # pictures
    announce: Callable[[str], None] | None = None  # in one sentence, what is solved before it is
    watch: Watch | None = None  # sees every sample of the drive


def new_run_folder(config: EpisodeConfig) -> Path:
    """Return a folder that does not exist yet, in runs/, named for the scenario, the stack and the seed."""
    stack = (plugin_name(config.planner.kind), plugin_name(config.filter.kind))
    parts = [config.scenario.name, *stack]
    if config.filter.kind != "none":
        parts.append(config.filter.scheme)
    return new_folder("-".join([*parts, str(config.seed)]))


def _given(**values: object) -> dict[str, object]:
    return {name: value for name, value in values.items() if value is not None}


# Sixteen parameters: each is a keyword of the library's face, and all but the first have to be named.
def run_episode(
    scenario: str | Path | Scenario | Mapping[str, Any] = "paper",
    *,
    planner: str | type | Planner | None = None,
    filter: str | type | SafetyFilter | None = None,
    scheme: str | None = None,
    preset: str | None = None,
    seed: int | None = None,
    duration: float | None = None,
    table: str | None = None,
    ego: str | None = None,
    begin: float | None = None,
    traffic: str | None = None,
    record: str | None = None,
    settings: Sequence[str] | Mapping[str, Any] = (),
    out: Path | str | Callable[[EpisodeConfig], Path] | None = None,
    figures: bool = True,
    progress: Progress | EpisodeProgress | None = None,
) -> Episode:
    """Drive one episode in SUMO; this is what `hj-cosim run` does.

    Args:
        scenario: a name in sumo_net/, a path to a scenario TOML or to a SUMO configuration (.sumocfg), a Scenario, or a
            dict like the content of a scenario TOML; a run's config.toml repeats that run.
        planner: hjop, op, mppi, idle, or one of one's own (planning/contract.py): `FILE.py:Class`,
            `package.module:Class`, a class, or an object of one, which is used as it is; hjop unless given.
        filter: spc, rss, none, or one of one's own (control/contract.py), likewise; spc unless given.
        scheme: mi or sw, of the filters spc and rss.
        preset: best (unless given) or paper; a run's config.toml has its own.
        seed: of the traffic; the scenario's unless given.
        duration: recorded time, s.
        table: a name in value_tables/ or a path to a specification; solved first if it has not been.
        ego: of a .sumocfg, the vehicle that the robot takes over; one with a long way ahead unless given.
        begin: of a .sumocfg, when the robot takes over, s; after 300 s of warm-up unless given.
        traffic: of a .sumocfg, who drives the others: `theirs`, their own drivers (unless given), or `idm-mobil`, ours.
        record: which cars are recorded: `near`, within 250 m of the robot, as of a .sumocfg unless given, or `all`.
        settings: any other knobs, `{"planner.gamma_r": 0.8}`, or as texts `planner.gamma_r=0.8`.
        out: the run folder to write, or a function that names one, such as `new_run_folder`; nothing is written unless
            given.
        figures: whether a run folder's pictures are drawn, which takes longer than the drive.
        progress: called with the samples driven and the samples in all, once a plan; an EpisodeProgress is told of
            solving and drawing, too.

    Returns:
        The configuration, the record (arrays, SI units, road frame), the summary and the folder.

    Raises:
        HjCosimError: one sentence on what is wrong and what would be right.
    """
    planner = planner if planner is None or isinstance(planner, str) else given(PLANNER, planner)
    filter = filter if filter is None or isinstance(filter, str) else given(FILTER, filter)
    flags = stack_flags(planner=planner, filter=filter, scheme=scheme, duration=duration, table=table, seed=seed)
    if own := _given(ego=ego, begin=begin, traffic=traffic):
        flags = overlay(flags, {"scenario": {"own": own}})
    if record is not None:
        flags = overlay(flags, {"recording": {"cars": record}})
    config = resolve_config(scenario, preset=preset, flags=flags, assignments=settings)
    if not (progress is None or callable(progress) or isinstance(progress, EpisodeProgress)):
        raise ConfigurationError(f"progress: {shown(repr(progress))} is no function of what is done and what there is")
    tell = progress if isinstance(progress, EpisodeProgress) else EpisodeProgress(progress)
    folder = out(config) if callable(out) else None if out is None else given_path(out, "out")
    # A plug-in may change the current folder.
    place = None if folder is None else folder.absolute()
    if place is not None:
        require_free_folder(place)
    sizes = classes_met(config.scenario.bodies)
    is_first = not all(kept.is_solved for kept in kept_tables(config.table, config.robot, sizes))
    with rehearsed(config) if is_first and can_be_rehearsed(config) else nullcontext():
        value_table = load_tables(config.table, sizes, tell.solving, robot=config.robot, announce=tell.announce)
    if config.filter.priority == "belief":
        load_table(WORST_TABLE, tell.solving, robot=config.robot, announce=tell.announce)
    episode = run_in_sumo(config, value_table, tell.driving, tell.announce, place, tell.watch)
    if place is None:
        return episode
    write_episode(episode, place)
    if figures:
        # Matplotlib takes longer to import than an episode to drive: only who draws pays for it.
        from hj_cosim.analysis.run_figures import draw_run

        draw_run(place, tell.drawing)
    return replace(episode, folder=folder)


def repetition_of(scenario: str | Path | Scenario | Mapping[str, Any], episode: Episode) -> Repetition | None:
    """Return how an episode compares with the run whose config.toml it was driven from.

    Args:
        scenario: what `run_episode` was given.
        episode: what it returned, with a folder.

    Returns:
        None if it was given something else than a run's config.toml.

    Raises:
        RunFolderError: if one of the two lists of versions is broken.
    """
    if isinstance(scenario, Scenario | Mapping) or episode.folder is None:
        return None
    if not is_run_configuration(scenario_data(str(scenario))):
        return None
    return repetition(scenario_path(str(scenario)).parent, episode.folder)
