"""One episode: the robot drives through the world, planned for at 1 Hz, filtered at 50 Hz, recorded, written."""

import itertools
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import SafetyFilter
from hj_cosim.control.guard import DESIRED_NOT_FINITE, NOT_JUDGED, GuardedFilter
from hj_cosim.control.problem.safety_problem import FAILED
from hj_cosim.control.spc.filter import ESCAPED, HAD_NO_ESCAPE, SafetyPreservingFilter
from hj_cosim.control.tracking import tracking_control
from hj_cosim.cosim.configuration import config_toml, resolve_config, stack_flags
from hj_cosim.cosim.recorder import Recorder
from hj_cosim.errors import DriveEnded, SimulationError
from hj_cosim.files import file_name
from hj_cosim.locations import given_path, runs_folder
from hj_cosim.metrics.catalogue import require_declared
from hj_cosim.metrics.summary import summarize, timing
from hj_cosim.metrics.threats import collides
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import IDLE, Plan, Planner
from hj_cosim.planning.guard import GuardedPlanner
from hj_cosim.plugins import FILTER, PLANNER, given, plugin_name
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.reachability.table.store import load_table, require_robot
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.record import COLLISION, DURATION, RunRecord
from hj_cosim.recording.run_folder import Keep, require_free_folder, write_run
from hj_cosim.scene.observation import FARTHEST, Observation, Target, is_possible
from hj_cosim.settings import EpisodeConfig, Scenario
from hj_cosim.traffic.contract import World
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.bicycle import bicycle_step, steering_for
from hj_cosim.verification.promise_audit import PromiseAudit

Progress = Callable[[int, int], None]  # samples driven, samples in all


@dataclass(frozen=True)
class Episode:
    """An episode that has been driven."""

    config: EpisodeConfig
    record: RunRecord
    summary: Mapping[str, Any]
    drivers: np.ndarray  # (J, 6) the background drivers' IDM parameters, in the order of vehicles.idm
    timing: Mapping[str, float]  # what depends on the machine
    folder: Path | None = None  # the run's folder, where it was written


@dataclass(frozen=True)
class EpisodeProgress:
    """Who is told how far an episode is; each is called with what is done and what there is in all."""

    driving: Progress | None = None  # samples, once a plan
    solving: Progress | None = None  # steps of the value table's solve, if it has to be solved
    drawing: Progress | None = None  # pictures
    announce: Callable[[str], None] | None = None  # in one sentence, what is solved before it is


@dataclass(frozen=True)
class Drive:
    """What came of a drive."""

    record: RunRecord
    diagnostics: Mapping[str, float]  # the filter's, and its guard's, summed over all steps


def drive(
    world: World,
    planner: Planner,
    safety_filter: SafetyFilter,
    table: ValueTable,
    config: EpisodeConfig,
    audit: PromiseAudit | None = None,
    progress: Progress | None = None,
) -> Drive:
    """Drive one episode in a world that has settled, and return what happened.

    At every step the robot observes, looks V of all cars up, plans if it is time to, tracks the plan, filters the
    control, and moves as the bicycle does; the world moves with it. Any world, planner and filter of the contracts will
    do; what they answer is guarded. Where a car's state is NaN or infinite, nothing is planned and the last plan is
    kept, while the robot brakes in its lane, which is counted. Where the world lets the robot go no farther, the drive
    ends before its time; what was driven is kept, with the reason.

    Args:
        world: at the instant that the robot takes over.
        planner: asked every `simulation.plan_period`.
        safety_filter: asked every step.
        table: V, for the filter and the record alike.
        config: clocks, the robot and the tracking controller.
        audit: told of every step, if there is one; for filters that promise something about V.
        progress: called with the samples driven and the samples in all, once a plan.

    Raises:
        SimulationError: if the world fails, or puts the robot where no robot can be.
        PluginError: if the planner or the filter fails, takes too long, or answers what cannot be.
    """
    simulation, robot = config.simulation, config.robot
    samples = max(round(simulation.duration / simulation.step), 1)
    samples_per_plan = max(round(simulation.plan_period / simulation.step), 1)
    recorder = Recorder(samples, len(world.vehicle_names))
    guarded_planner = GuardedPlanner(planner, world.road)
    guarded_filter = GuardedFilter(safety_filter, robot)
    observation = _observe(world)
    values = car_values(table, observation)
    guarded_planner.prepare(observation)
    guarded_filter.prepare(observation, values)
    along, lateral, _, speed = observation.robot.tolist()
    target = Target(lane=world.road.lane_at(lateral, along), speed=speed)
    plan = Plan(IDLE, target)
    ended = DURATION
    for sample in range(samples):
        if sample % samples_per_plan == 0:
            if is_possible(observation.robot, observation.x, observation.y, observation.heading, observation.speed):
                plan = guarded_planner.plan(observation, target)
                target = plan.target
            if progress is not None:
                progress(sample, samples)
        desired = tracking_control(observation.robot, target, world.road, config.tracking, robot)
        decision = guarded_filter.filter(observation, values, desired)
        omega, acceleration = decision.control.omega, decision.control.acceleration
        steering = steering_for(omega, float(observation.robot[3]), robot.wheelbase)
        recorder.record(observation, values, plan, desired, decision, steering)
        if simulation.on_collision == "stop" and _collided(observation, config):
            ended = COLLISION
            break
        if sample + 1 < samples:
            state = bicycle_step(
                observation.robot, steering, acceleration, robot.wheelbase, robot.speed_max, simulation.step
            )
            try:
                world.step(state, acceleration)
            except DriveEnded as end:
                ended = end.reason
                break
            before, observation = observation, _observe(world)
            values = car_values(table, observation)
            if audit is not None:
                audit.judge(decision, before, observation)
    if progress is not None:
        progress(samples, samples)
    return Drive(recorder.finish(world.road, robot, world.vehicle_names, ended), guarded_filter.counts)


def _observe(world: World) -> Observation:
    observation = world.observe()
    if not np.abs(observation.robot).max() <= FARTHEST:
        raise SimulationError(
            f"the world has the robot at p_x, p_y, θ, v = {observation.robot.tolist()} at {observation.time:.2f} s;"
            " no filter can judge that, so look for what moved it there"
        )
    return observation


def _collided(observation: Observation, config: EpisodeConfig) -> bool:
    return bool(
        collides(
            observation.robot,
            config.robot.length,
            config.robot.width,
            observation.x,
            observation.y,
            observation.heading,
            observation.length,
            observation.width,
        )
    )


def run_in_sumo(config: EpisodeConfig, table: ValueTable, progress: Progress | None = None) -> Episode:
    """Drive one episode in SUMO.

    Args:
        config: what to run.
        table: the solved value table that planner and filter share.
        progress: called with the samples driven and the samples in all, once a plan.

    Raises:
        NetworkError, ScenarioError: if the world cannot be built.
        SimulationError: if SUMO fails on the way.
        TableError: if the table is another robot's.
    """
    require_robot(table, config.robot)
    started = time.perf_counter()
    with SumoWorld(config.scenario, config.robot, config.seed, config.simulation.step) as world:
        world.settle(config.simulation.settle_time)
        planner = make_planner(config.planner, config.robot, config.scenario.drivers, world.road, table)
        safety_filter = make_filter(config.filter, config.robot, world.road, table, config.simulation.step)
        audit = PromiseAudit(table.arrays, promises=isinstance(safety_filter, SafetyPreservingFilter))
        driven = drive(world, planner, safety_filter, table, config, audit, progress)
    wall_seconds = time.perf_counter() - started
    summary = summarize(driven.record, config, audit.summary() | fallback_summary(driven.diagnostics))
    return Episode(config, driven.record, summary, world.drivers, timing(summary, wall_seconds))


def fallback_summary(diagnostics: Mapping[str, float]) -> dict[str, float]:
    """Return what goes into summary.json of a drive's diagnostics: how often something failed, answered safely."""
    return {
        "not_judged_samples": diagnostics.get(NOT_JUDGED, 0),
        "desired_not_finite_samples": diagnostics.get(DESIRED_NOT_FINITE, 0),
        "solver_failures": sum(count for what, count in diagnostics.items() if what.endswith(FAILED)),
        "escape_samples": diagnostics.get(ESCAPED, 0),
        "no_escape_samples": diagnostics.get(HAD_NO_ESCAPE, 0),
    }


def new_run_folder(config: EpisodeConfig) -> Path:
    """Return a folder that does not exist yet, in runs/, named for the scenario, the stack and the seed."""
    stack = (plugin_name(config.planner.kind), plugin_name(config.filter.kind))
    parts = [file_name(part) for part in (config.scenario.name, *stack)]
    if config.filter.kind != "none":
        parts.append(config.filter.scheme)
    name = "-".join([*parts, str(config.seed)])
    folders = (runs_folder() / (name if attempt == 1 else f"{name}-{attempt}") for attempt in itertools.count(1))
    return next(folder for folder in folders if not folder.exists())


def write_episode(episode: Episode, folder: Path, keep: Keep = "all") -> None:
    """Write an episode's run folder, all of it or nothing.

    Args:
        episode: what was driven.
        folder: must not exist yet, or be empty.
        keep: as `recording.run_folder.write_run` takes it.

    Raises:
        MetricError: if the summary has a metric that is not declared.
        RunFolderError: if `folder` already holds something, or cannot be written.
    """
    require_declared(episode.summary)
    config_text = config_toml(episode.config)
    write_run(folder, episode.record, config_text, episode.summary, episode.drivers, keep, episode.timing)


def run_episode(
    scenario: str | Path | Scenario = "paper",
    *,
    planner: str | type | Planner | None = None,
    filter: str | type | SafetyFilter | None = None,
    scheme: str | None = None,
    preset: str = "best",
    seed: int | None = None,
    duration: float | None = None,
    table: str | None = None,
    settings: Sequence[str] = (),
    out: Path | str | Callable[[EpisodeConfig], Path] | None = None,
    figures: bool = True,
    progress: Progress | EpisodeProgress | None = None,
) -> Episode:
    """Drive one episode in SUMO; this is what `hj-cosim run` does.

    Args:
        scenario: a name in sumo_net/, a path to a scenario TOML, or a Scenario.
        planner: hjop, op, idle, or one of one's own (planning/contract.py): `FILE.py:Class`, `package.module:Class`, a
            class, or an object of one, which is used as it is; hjop unless given.
        filter: spc, rss, none, or one of one's own (control/contract.py), likewise; spc unless given.
        scheme: mi or sw, of the filters spc and rss.
        preset: best or paper.
        seed: of the traffic; the scenario's unless given.
        duration: recorded time, s.
        table: a name in value_tables/ or a path to a specification; solved first if it has not been.
        settings: any other knobs, as texts KEY=VALUE, for example `planner.gamma_r=0.8`.
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
    config = resolve_config(scenario, preset=preset, flags=flags, assignments=settings)
    tell = progress if isinstance(progress, EpisodeProgress) else EpisodeProgress(progress)
    folder = out(config) if callable(out) else None if out is None else given_path(out, "out")
    if folder is not None:
        require_free_folder(folder)
    value_table = load_table(config.table, tell.solving, robot=config.robot, announce=tell.announce)
    episode = run_in_sumo(config, value_table, tell.driving)
    if folder is None:
        return episode
    write_episode(episode, folder)
    if figures:
        # Matplotlib costs more to import than an episode to drive: only who draws pays for it.
        from hj_cosim.analysis.run_figures import draw_run

        draw_run(folder, tell.drawing)
    return replace(episode, folder=folder)
