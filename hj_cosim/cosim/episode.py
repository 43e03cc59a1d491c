"""One episode: the robot drives through the world, planned for at 1 Hz, filtered at 50 Hz, recorded, written."""

import math
import tempfile
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from hj_cosim.control.belief.believing_filter import WORST_TABLE
from hj_cosim.control.catalogue import make_filter
from hj_cosim.control.contract import SafetyFilter
from hj_cosim.control.guard import DESIRED_NOT_FINITE, NOT_JUDGED, GuardedFilter
from hj_cosim.control.problem.safety_problem import FAILED
from hj_cosim.control.spc.filter import ESCAPED, HAD_NO_ESCAPE, WAS_CAUGHT, WAS_EVADED, SafetyPreservingFilter
from hj_cosim.control.tracking import eased, tracking_control
from hj_cosim.cosim.configuration import config_toml
from hj_cosim.cosim.global_random import global_random_of
from hj_cosim.cosim.motion import in_existing_lane, moved, yaw_rate
from hj_cosim.cosim.recorder import Recorder
from hj_cosim.errors import DriveEnded, SimulationError
from hj_cosim.metrics.catalogue import require_declared
from hj_cosim.metrics.summary import summarize, timing
from hj_cosim.metrics.threats import touching
from hj_cosim.planning.catalogue import make_planner
from hj_cosim.planning.contract import IDLE, Plan, Planner
from hj_cosim.planning.guard import GuardedPlanner
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.reachability.table.size_classes import classes_met
from hj_cosim.reachability.table.sized import with_classes
from hj_cosim.reachability.table.store import kept_table, require_robot, specification_hash
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.frames import RunFrames
from hj_cosim.recording.record import COLLISION, DURATION, RunRecord
from hj_cosim.recording.run_folder import Keep, write_run
from hj_cosim.recording.summary_file import summary_html, summary_sentence
from hj_cosim.recording.trajectories import Scene
from hj_cosim.recording.versions import TABLE, program_versions
from hj_cosim.scene.observation import FARTHEST, Control, Observation, Target
from hj_cosim.scene.possible import is_possible
from hj_cosim.settings import EpisodeConfig
from hj_cosim.traffic.contract import World, WorldWithOthers, WorldWithRogues
from hj_cosim.traffic.sumo.own_world import OwnWorld
from hj_cosim.traffic.sumo.world import SumoWorld
from hj_cosim.vehicles.bicycle import steering_for
from hj_cosim.verification.foresight import EVERY, ForesightAudit
from hj_cosim.verification.promise_audit import PromiseAudit

Progress = Callable[[int, int], None]  # samples driven, samples in all
Record = Callable[..., None]  # a recorder's `record`
Watch = Callable[[EpisodeConfig, World, Record], Record]  # returns what is called in its place, which calls it


@dataclass(frozen=True, repr=False)
class Episode(RunFrames):
    """An episode that has been driven; its arrays as DataFrames in `robot` and `trajectories`."""

    config: EpisodeConfig
    record: RunRecord
    summary: Mapping[str, Any]
    drivers: np.ndarray  # (J, 6) the background drivers' IDM parameters, in the order of vehicles.idm
    timing: Mapping[str, float]  # what depends on the machine
    versions: Mapping[str, str] = field(default_factory=dict)  # of what it was driven with, its value table among it
    folder: Path | None = None  # the run's folder, where it was written
    notes: str | None = None  # TOML: what was chosen, overridden and silenced in a user's own simulation

    def __repr__(self) -> str:
        place = "" if self.folder is None else f", in {self.folder}"
        return f"Episode of {summary_sentence(self.summary)}{place}"

    def _repr_html_(self) -> str:
        return summary_html(self.summary)


@dataclass(frozen=True)
class Drive:
    """What came of a drive."""

    record: RunRecord
    diagnostics: Mapping[str, float]  # the filter's, and its guard's, summed over all steps


# Ten parameters: the four that meet here, what is asked of them, who looks on, and where it is written.
def drive(
    world: World,
    planner: Planner,
    safety_filter: SafetyFilter,
    table: ValueTable,
    config: EpisodeConfig,
    audit: PromiseAudit | None = None,
    progress: Progress | None = None,
    foresight: ForesightAudit | None = None,
    beside: Path | None = None,
    watch: Watch | None = None,
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
        foresight: predicts the other cars once a second, if there is one.
        beside: where the run will be written, so that what does not fit into memory is written near it already; in the
            system's folder for temporary files unless given.
        watch: sees every sample, if there is one.

    Raises:
        HjCosimError: if what does not fit into memory cannot be written.
        SimulationError: if the world fails, or puts the robot where no robot can be.
        PluginError: if the planner or the filter fails, takes too long, or answers what cannot be.
    """
    simulation, robot = config.simulation, config.robot
    samples = max(round(simulation.duration / simulation.step), 1)
    samples_per_plan = max(round(simulation.plan_period / simulation.step), 1)
    rogues = world.rogues if isinstance(world, WorldWithRogues) else {}
    scene = Scene(world.road, robot.length, robot.width, rogues)
    records_all = config.recording.cars == "all"
    # A user's own simulation shows those alone who are near by its own measure.
    within = math.inf if records_all or config.scenario.own.is_given else config.recording.within
    recorder = Recorder(
        scene, lambda: world.vehicle_names, robot, samples, beside or Path(tempfile.gettempdir()) / "drive", within
    )
    farther = world if records_all and isinstance(world, WorldWithOthers) else None
    record = recorder.record if watch is None else watch(config, world, recorder.record)
    guarded_planner = GuardedPlanner(planner, world.road)
    guarded_filter = GuardedFilter(safety_filter, robot)
    observation = _observe(world)
    values = car_values(table, observation)
    guarded_planner.prepare(observation)
    guarded_filter.prepare(observation, values)
    along, lateral, _, speed = observation.robot.tolist()
    target = Target(lane=world.road.lane_at(lateral, along), speed=speed)
    plan, desired = Plan(IDLE, target), Control(0.0, 0.0)
    ended = DURATION
    samples_per_foresight = max(round(EVERY / simulation.step), 1)
    for sample in range(samples):
        if sample % samples_per_plan == 0:
            if _is_judged(observation):
                plan = guarded_planner.plan(observation, target)
                target = plan.target
            if progress is not None:
                progress(sample, samples)
        if foresight is not None and sample % samples_per_foresight == 0 and _is_judged(observation):
            foresight.judge(observation, target)
        followed = target if world.road.is_straight else in_existing_lane(target, observation.robot, world.road)
        wanted = tracking_control(observation.robot, followed, world.road, config.tracking, robot)
        desired = eased(wanted, desired, config.tracking.jerk_max, simulation.step)
        decision = guarded_filter.filter(observation, values, desired)
        omega, acceleration = decision.control.omega, decision.control.acceleration
        turning = yaw_rate(observation.robot, omega, world.road)
        steering = steering_for(turning, float(observation.robot[3]), robot.wheelbase)
        everybody = None if farther is None else farther.everybody()
        record(observation, values, plan, desired, decision, steering, everybody)
        if simulation.on_collision == "stop" and _collided(observation, config):
            ended = COLLISION
            break
        if sample + 1 < samples:
            state = moved(observation.robot, steering, acceleration, world.road, robot, simulation.step)
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
    return Drive(recorder.finish(ended), guarded_filter.counts)


def _is_judged(observation: Observation) -> bool:
    """Return whether an observation's states are numbers, so that there is something to plan or predict."""
    seen = observation
    return is_possible(seen.robot, seen.x, seen.y, seen.heading, seen.speed, seen.acceleration)


def _observe(world: World) -> Observation:
    observation = world.observe()
    x, y, heading, speed = observation.robot.tolist()
    if not (abs(x) <= FARTHEST and abs(y) <= FARTHEST and abs(heading) <= FARTHEST and abs(speed) <= FARTHEST):
        raise SimulationError(
            f"the world has the robot at p_x, p_y, θ, v = {observation.robot.tolist()} at {observation.time:.2f} s;"
            " no filter can judge that, so look for what moved it there"
        )
    return observation


def _collided(observation: Observation, config: EpisodeConfig) -> bool:
    robot, now = config.robot, observation
    overlap = touching(now.robot, robot.length, robot.width, now.x, now.y, now.heading, now.length, now.width)
    return bool(overlap.any())


def open_world(config: EpisodeConfig, table: ValueTable | None = None) -> SumoWorld | OwnWorld:
    """Return the world of a configuration: a scenario's, or a user's own simulation.

    Args:
        config: what to run.
        table: the robot's, which rogues may use against it; needed where there are any.

    Raises:
        ConfigurationError, NetworkError, ScenarioError: if it cannot be built.
        SimulationError: if SUMO does not start.
    """
    scenario, robot, seed, simulation = config.scenario, config.robot, config.seed, config.simulation
    if scenario.own.is_given:
        fastest = config.planner.speed_high
        looks_farther = config.recording.cars == "all"
        return OwnWorld(scenario, robot, seed, simulation.step, simulation.traffic_step, fastest, looks_farther)
    values = None if table is None else partial(car_values, table)
    return SumoWorld(scenario, robot, seed, simulation.step, traffic_step=simulation.traffic_step, values=values)


def run_in_sumo(
    config: EpisodeConfig,
    table: ValueTable,
    progress: Progress | None = None,
    announce: Callable[[str], None] | None = None,
    beside: Path | None = None,
    watch: Watch | None = None,
) -> Episode:
    """Drive one episode in SUMO.

    Args:
        config: what to run.
        table: the solved value table that planner and filter share, with those of the larger size classes that a
            scenario has; those that a user's own simulation turns out to have are solved, if they are not.
        progress: called with the samples driven and the samples in all, once a plan.
        announce: told what was chosen, overridden and silenced in a user's own simulation, before the drive.
        beside: as `drive` takes it.
        watch: sees every sample, if there is one.

    Raises:
        NetworkError, ScenarioError: if the world cannot be built.
        SimulationError: if SUMO fails on the way.
        TableError: if the table is another robot's.
    """
    require_robot(table, config.robot)
    started = time.perf_counter()
    with open_world(config, table) as world, global_random_of(config.seed):
        if isinstance(world, OwnWorld):
            if announce is not None:
                announce(world.told)
            table = with_classes(table, config.table, classes_met(world.bodies), robot=config.robot, announce=announce)
        world.settle(config.simulation.settle_time)
        drivers = world.predicted if isinstance(world, OwnWorld) else config.scenario.drivers
        planner = make_planner(config.planner, config.robot, drivers, world.road, table)
        safety_filter = make_filter(config.filter, config.robot, world.road, table, config.simulation.step, drivers)
        promises = type(safety_filter) is SafetyPreservingFilter
        audit = PromiseAudit(table.stack, epsilon=config.filter.epsilon, promises=promises)
        foresight = ForesightAudit(config.planner, config.robot, drivers, world.road, table)
        driven = drive(world, planner, safety_filter, table, config, audit, progress, foresight, beside, watch)
    wall_seconds = time.perf_counter() - started
    summary = summarize(
        driven.record, config, audit.summary() | fallback_summary(driven.diagnostics) | foresight.summary()
    )
    versions = {**program_versions(), TABLE: specification_hash(table.specification, table.game)}
    for each in table.larger:
        versions[f"{TABLE}, {each.size.name}"] = specification_hash(each.specification, each.game)
    if config.filter.priority == "belief":
        versions[f"{TABLE}, {WORST_TABLE}"] = kept_table(WORST_TABLE, config.robot).identity
    notes = world.told if isinstance(world, OwnWorld) else None
    taken = timing(summary, wall_seconds)
    return Episode(config, driven.record, summary, world.drivers, taken, versions, notes=notes)


def fallback_summary(diagnostics: Mapping[str, float]) -> dict[str, float]:
    """Return what goes into summary.json of a drive's diagnostics: how often something failed, answered safely."""
    return {
        "not_judged_samples": diagnostics.get(NOT_JUDGED, 0),
        "desired_not_finite_samples": diagnostics.get(DESIRED_NOT_FINITE, 0),
        "solver_failures": sum(count for what, count in diagnostics.items() if what.endswith(FAILED)),
        "escape_samples": diagnostics.get(ESCAPED, 0),
        "no_escape_samples": diagnostics.get(HAD_NO_ESCAPE, 0),
        "evasion_samples": diagnostics.get(WAS_EVADED, 0),
        "caught_samples": diagnostics.get(WAS_CAUGHT, 0),
    }


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
    write_run(
        folder,
        episode.record,
        config_text,
        episode.summary,
        episode.drivers,
        keep,
        episode.timing,
        episode.versions,
        episode.notes,
    )
