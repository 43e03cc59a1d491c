"""The highway in SUMO as a Gymnasium environment."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, Literal

import gymnasium
import numpy as np

from hj_cosim.control.contract import SafetyFilter
from hj_cosim.control.guard import GuardedFilter
from hj_cosim.control.tracking import eased, tracking_control
from hj_cosim.cosim.configuration import resolve_config, stack_flags
from hj_cosim.cosim.episode import open_world
from hj_cosim.cosim.motion import in_existing_lane, moved, yaw_rate
from hj_cosim.errors import ConfigurationError, DriveEnded
from hj_cosim.metrics.threats import touching
from hj_cosim.planning.contract import ACTION_COUNT, FASTER, LEFT, RIGHT, SLOWER
from hj_cosim.planning.optimistic.reward import reward_model, total_reward
from hj_cosim.reachability.table.cars import car_values
from hj_cosim.reachability.table.size_classes import classes_met
from hj_cosim.reachability.table.sized import load_tables
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Control, Observation, Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import EpisodeConfig, Scenario
from hj_cosim.traffic.contract import World
from hj_cosim.training.scene_array import COLUMNS, HIGHEST, LOWEST, scene_array
from hj_cosim.vehicles.bicycle import steering_for

CONTROL_PERIOD = 0.1  # s, for which a continuous action is held
Reward = Callable[[Observation, Control, bool], float]  # of what came of an action, the last control, and a collision
MakeFilter = Callable[[EpisodeConfig, Road, ValueTable], SafetyFilter]


class HighwayEnv(gymnasium.Env[np.ndarray, Any]):
    """Drive the robot through SUMO's traffic; one at a time in a process, several in `AsyncVectorEnv`.

    Observations: (cars + 1, 7) float32, the robot and the nearest cars in the road frame, SI; see `scene_array`.
    Actions: `continuous`, turn rate and acceleration, each in [−1, 1] of the robot's limits, held for 0.1 s; or
    `planner`, its five (idle, faster, slower, left, right), each tracked until the next plan (1 s).
    Reward: in [0, 1] an action, the paper's driving reward of speed and lane, 0 for a collision; or one's own.
    An episode terminates with a collision, and is truncated after `simulation.duration` or at the end of the road.
    """

    metadata: ClassVar[dict[str, Any]] = {"render_modes": []}

    # Eight parameters that gymnasium.make hands on by name.
    def __init__(
        self,
        scenario: str | Path | Scenario | Mapping[str, Any] = "paper",
        *,
        actions: Literal["continuous", "planner"] = "continuous",
        cars: int = 8,
        reward: Reward | None = None,
        preset: str | None = None,
        duration: float | None = None,
        settings: Sequence[str] | Mapping[str, Any] = (),
    ) -> None:
        """Say what is to be driven; SUMO starts with the first `reset`.

        Args:
            scenario, preset, duration, settings: as `run_episode` takes them.
            actions: `continuous` or `planner`.
            cars: how many are observed.
            reward: of the observation after an action, the last control and whether there is a collision.

        Raises:
            ConfigurationError: if anything is unknown, of the wrong type or out of range.
        """
        if actions not in ("continuous", "planner"):
            raise ConfigurationError(f"actions = {actions!r} is not known; choose continuous or planner")
        if not isinstance(cars, int) or cars < 1:
            raise ConfigurationError(f"cars = {cars!r} is no number of cars to observe; give 1 or more")
        self.config = resolve_config(
            scenario, preset=preset, flags=stack_flags(duration=duration), assignments=settings
        )
        self._actions, self._cars, self._reward = actions, cars, reward
        shape = (cars + 1, len(COLUMNS))
        self.observation_space = gymnasium.spaces.Box(
            np.broadcast_to(LOWEST, shape).copy(), np.broadcast_to(HIGHEST, shape).copy(), dtype=np.float32
        )
        self.action_space = (
            gymnasium.spaces.Box(-1.0, 1.0, (2,), np.float32)
            if actions == "continuous"
            else gymnasium.spaces.Discrete(ACTION_COUNT)
        )
        self._world: World | None = None
        self._filter: GuardedFilter | None = None
        self._make_filter: MakeFilter | None = None
        scenario = self.config.scenario
        has_rogues = scenario.rogues.share > 0.0 or any(car.rogue is not None for car in scenario.cars)
        self._table = self.load_tables() if has_rogues else None

    def load_tables(self) -> ValueTable:
        """Return the value table of the settings, with those of the larger size classes that the traffic has."""
        config = self.config
        return load_tables(config.table, classes_met(config.scenario.bodies), robot=config.robot)

    def filter_with(self, make_filter: MakeFilter, table: ValueTable) -> None:
        """Have a safety filter between every action and the robot from the next `reset` on; see SafetyFilterWrapper."""
        self._make_filter, self._table = make_filter, table

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[np.ndarray, dict[str, Any]]:
        """Begin another episode, after the traffic has settled; the seed is the traffic's, drawn unless given.

        Raises:
            SimulationError: if another SUMO is open in this process, or it fails.
        """
        super().reset(seed=seed)
        self.close()
        traffic_seed = int(self.np_random.integers(2**31)) if seed is None else seed
        config = self.config.model_copy(update={"seed": traffic_seed})
        self._world = open_world(config, self._table)
        self._world.settle(config.simulation.settle_time)
        self._now = self._world.observe()
        self._road = self._world.road
        self._weights = reward_model(config.planner.model_copy(update={"gamma_r": 1.0}), self._road)
        along, lateral, _, speed = self._now.robot.tolist()
        self._target = Target(self._road.lane_at(lateral, along), speed)
        self._desired = Control(0.0, 0.0)
        self._sample = 0
        if self._make_filter is not None and self._table is not None:
            self._filter = GuardedFilter(self._make_filter(config, self._road, self._table), config.robot)
            self._filter.prepare(self._now, car_values(self._table, self._now))
        return self._observed(), {"seed": traffic_seed}

    def step(self, action: Any) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
        """Act; see the class. `info` has collision, ended, and of a filter the share of steps that it changed.

        Raises:
            ConfigurationError: if there was no `reset`, or the action is none of the space.
            SimulationError: if SUMO fails.
        """
        if self._world is None:
            raise ConfigurationError("reset() begins an episode; call it before step()")
        if not self.action_space.contains(action):
            raise ConfigurationError(f"action {action!r} is none of {self.action_space}")
        simulation = self.config.simulation
        if self._actions == "planner":
            self._target = self._next_target(int(action))
        period = simulation.plan_period if self._actions == "planner" else CONTROL_PERIOD
        samples, changed, collided, ended = max(round(period / simulation.step), 1), 0, False, ""
        control, driven = Control(0.0, 0.0), 0
        for _ in range(samples):
            desired = self._desired_control(action)
            control = self._filtered(desired)
            changed += control != desired
            driven += 1
            ended = self._move(control)
            collided = self._collides()
            if ended or collided:
                break
        is_over = self._sample >= round(simulation.duration / simulation.step)
        info = {"collision": collided, "ended": ended or ("duration" if is_over else ""), "changed": changed / driven}
        reward = self._reward or self._papers_reward
        return self._observed(), float(reward(self._now, control, collided)), collided, bool(ended) or is_over, info

    def close(self) -> None:
        """End SUMO; a second time does nothing."""
        if self._world is not None:
            self._world.close()
            self._world = None

    def _observed(self) -> np.ndarray:
        return scene_array(self._now, self.config.robot.length, self.config.robot.width, self._cars)

    def _papers_reward(self, now: Observation, control: Control, collided: bool) -> float:
        x, y, _, speed = now.robot.tolist()
        reward = total_reward(speed, self._road.lane_at(y, x), collided, np.inf, self._weights)
        return 0.0 if collided else min(max(reward, 0.0), 1.0)

    def _next_target(self, action: int) -> Target:
        """Return what one of the planner's actions makes of the target, as its own tree does."""
        planner, speed = self.config.planner, float(self._now.robot[3])
        planned = min(max(self._target.speed, speed - planner.speed_window), speed + planner.speed_window)
        planned += {FASTER: planner.speed_step, SLOWER: -planner.speed_step}.get(action, 0.0)
        lane = self._target.lane + {LEFT: 1, RIGHT: -1}.get(action, 0)
        return Target(
            min(max(lane, 0), self._road.lane_count - 1), min(max(planned, planner.speed_floor), planner.speed_high)
        )

    def _desired_control(self, action: Any) -> Control:
        robot, tracking = self.config.robot, self.config.tracking
        if self._actions == "continuous":
            turn, push = (float(share) for share in action)
            limit = robot.acceleration_max if push > 0.0 else -robot.acceleration_min
            return Control(turn * robot.omega_max, push * limit)
        road, state = self._road, self._now.robot
        target = self._target if road.is_straight else in_existing_lane(self._target, state, road)
        wanted = tracking_control(self._now.robot, target, self._road, tracking, robot)
        self._desired = eased(wanted, self._desired, tracking.jerk_max, self.config.simulation.step)
        return self._desired

    def _filtered(self, desired: Control) -> Control:
        if self._filter is None or self._table is None:
            return desired
        return self._filter.filter(self._now, car_values(self._table, self._now), desired).control

    def _move(self, control: Control) -> str:
        """Make a step of the simulation; return why the drive cannot go on, or nothing."""
        assert self._world is not None
        robot, step = self.config.robot, self.config.simulation.step
        turning = yaw_rate(self._now.robot, control.omega, self._road)
        steering = steering_for(turning, float(self._now.robot[3]), robot.wheelbase)
        state = moved(self._now.robot, steering, control.acceleration, self._road, robot, step)
        try:
            self._world.step(state, control.acceleration)
        except DriveEnded as end:
            return end.reason
        self._sample += 1
        self._now = self._world.observe()
        return ""

    def _collides(self) -> bool:
        now, robot = self._now, self.config.robot
        overlap = touching(now.robot, robot.length, robot.width, now.x, now.y, now.heading, now.length, now.width)
        return bool(overlap.any())
