"""MPPI: model predictive path integral control over the bicycle's controls, with the paper's reward and V.

After Williams et al. (2017): sequences of controls are drawn around the last plan, each is driven against the predicted
traffic, and the new plan is their mean, weighted by exp(worth / temperature). A highway has several good plans at once,
a lane each, whose mean is none. So some samples are drawn around simple ways into each lane (Trevisan & Alonso-Mora
2024, biased MPPI), and the mean is taken over those that end in the lane in which the best one does.

The loop asks it for a lane and a speed, ten times a second.
"""

import math

import numpy as np
from pydantic import Field

from hj_cosim.planning.contract import FASTER, IDLE, LEFT, RIGHT, SLOWER, Plan
from hj_cosim.planning.mppi.others import Habits, Others, predict_others
from hj_cosim.planning.mppi.rollouts import Costs, Outlook, RobotModel, drive, follow_lanes, judge
from hj_cosim.planning.mppi.shield import NO_SHIELD, Shield
from hj_cosim.planning.optimistic.lane_ends import robots_lanes, with_lane_ends
from hj_cosim.planning.optimistic.reward import reward_model
from hj_cosim.planning.optimistic.speed_limits import fastest_within_limits
from hj_cosim.reachability.games.highway.rows import row_numbers
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings, Settings
from hj_cosim.settings.base import Metres, MetresPerSecondSquared, Number, PerSecond, RadiansPerSecond, Seconds
from hj_cosim.vehicles.idm import mean_driver

SEED = 0  # of the noise: the same drive gives the same plans
HEADING_MAX = 0.3  # rad, within the value table
SPEEDS = (-4.0, 0.0, 4.0)  # m/s, beside the robot's, to which samples lead in each lane
KNOTS = 5  # of the noise, straight lines between them
ANOTHER_SPEED = 0.3  # m/s, from where on a plan is called faster or slower


class MppiPlanner:
    """Samples sequences of controls, and tracks the next lane and the speed to which the best of them lead."""

    plan_period = 0.1  # s, unless the settings say another

    class Options(Settings):
        """How it samples and what it minds beside the reward."""

        samples: int = Field(192, ge=16, le=10_000, description="sequences of controls a plan")
        horizon: Seconds = Field(4.0, gt=0, le=20, description="of a plan")
        step: Seconds = Field(0.2, gt=0, le=1, description="of a control")
        temperature: Number = Field(0.01, gt=0, description="of the weights, in sums of rewards")
        omega_deviation: RadiansPerSecond = Field(0.03, gt=0, description="of the noise")
        acceleration_deviation: MetresPerSecondSquared = Field(1.0, gt=0, description="of the noise")
        turning_cost: Number = Field(0.002, ge=0, description="a second, of (v ω)², m²/s⁴")
        acceleration_cost: Number = Field(0.001, ge=0, description="a second, of a², m²/s⁴")
        shielded: bool = Field(
            False, description="samples are held to accelerations that keep V of the nearest cars, a filter inside"
        )
        epsilon: Metres = Field(0.5, ge=0, description="shielded: ε, to which V may fall")
        approach: PerSecond = Field(
            4.0, gt=0, le=5, description="shielded: γ, the share of V − ε that it may fall in a second"
        )
        jerk_cost: Number = Field(0.002, ge=0, description="a second, of the change of a between two controls, squared")

    # Six parameters beside itself: what planners may ask for.
    def __init__(
        self,
        settings: PlannerSettings,
        options: Options,
        robot: RobotSettings,
        drivers: DriverSettings,
        road: Road,
        table: ValueTable,
    ) -> None:
        """Take what planners are handed; see PlannerInputs."""
        self._settings, self._options, self._road, self._tables = settings, options, road, table.stack
        self._instants = max(round(options.horizon / options.step), 1)
        # Whoever is told to change lanes is across the line in half the time, a step more for the path has only these.
        self._until_across = round(0.5 * settings.lane_change_time / options.step) + 1
        self._robot = RobotModel(
            robot.length, robot.width, robot.omega_max, robot.acceleration_min, robot.acceleration_max,
            robot.lateral_acceleration_max, robot.speed_max, HEADING_MAX, road.lane_width, road.lane_count,
        )  # fmt: skip
        self._driver = mean_driver(drivers)
        self._habits = Habits(
            self._driver[np.newaxis],
            road.lane_width / settings.others_lane_change_time,
            road.overlap_reach(robot.width),
        )
        self._reward = reward_model(settings, road)
        self._costs = Costs(options.turning_cost, options.acceleration_cost, options.jerk_cost)
        self._shield = NO_SHIELD
        if options.shielded:
            larger = [(each.size, each.parameters) for each in table.larger]
            self._shield = Shield(row_numbers(table.parameters, larger), options.epsilon, options.approach)
        self._random = np.random.default_rng(SEED)
        at = np.linspace(0.0, KNOTS - 1.0, self._instants)
        self._from_knots = np.maximum(1.0 - np.abs(at[:, None] - np.arange(KNOTS)), 0.0)  # (T, KNOTS)
        self._plan = np.zeros((self._instants, 2))
        self._planned_at = -math.inf

    def prepare(self, observation: Observation) -> None:
        """Compile, with a plan that nobody follows; it does not change what `plan` answers."""
        along, lateral, _, speed = observation.robot.tolist()
        self.plan(observation, Target(self._road.lane_at(lateral, along), speed))
        self._plan[:] = 0.0
        self._planned_at = -math.inf
        self._random = np.random.default_rng(SEED)

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the next lane that the plan enters and the speed to which it leads; see Planner."""
        self._shift(observation.time)
        lanes = robots_lanes(self._road, observation, self._settings.sensing_range)
        observation = with_lane_ends(observation, self._road, self._settings.sensing_range)
        state = np.array(observation.robot, dtype=float)
        path = np.empty((self._instants + 1, 4))
        drive(state, self._plan.copy(), path, self._robot, self._options.step)
        outlook = Outlook(
            self._predicted(observation, path),
            self._reward,
            self._costs,
            self._robot,
            self._options.step,
            self._settings.discount**self._options.step,
        )
        controls = self._drawn(state, lanes)
        worths, ends = np.empty(len(controls)), np.empty(len(controls), np.int64)
        judge(state, controls, outlook, self._tables, self._shield, worths, ends)
        self._plan = self._mean(controls, worths, ends)
        drive(state, self._plan, path, self._robot, self._options.step)
        return self._answer(observation, path, lanes)

    def _shift(self, now: float) -> None:
        """Let the last plan begin where it has got to by now."""
        passed = now - self._planned_at
        self._planned_at = now
        if not 0.0 <= passed < self._options.horizon:
            self._plan[:] = 0.0
            return
        instants = np.arange(self._instants) * self._options.step
        at = np.minimum(instants + passed, instants[-1])
        self._plan = np.column_stack([np.interp(at, instants, column) for column in self._plan.T])

    def _predicted(self, observation: Observation, path: np.ndarray) -> Others:
        sensed = np.flatnonzero(np.abs(observation.x - path[0, 0]) <= self._settings.sensing_range)
        shape = (self._instants + 1, len(sensed))
        others = Others(
            np.empty(shape), np.empty(shape), np.empty(shape), observation.length[sensed], observation.width[sensed]
        )
        others.x[0], others.y[0], others.speed[0] = (
            column[sensed] for column in (observation.x, observation.y, observation.speed)
        )
        target_y = self._road.lane_centres(observation.target_lane[sensed], observation.x[sensed])
        expected = observation.expected_driver
        drivers = np.tile(self._driver, (len(sensed), 1)) if expected is None else expected[sensed]
        habits = self._habits._replace(drivers=drivers)
        predict_others(others, target_y, path, self._robot.length, habits, self._options.step)
        return others

    def _allowed(self, state: np.ndarray) -> float:
        """Return how fast the robot may plan to be by the speed limits ahead, m/s."""
        return fastest_within_limits(self._road, float(state[0]), float(state[3]), self._settings.action_time)

    def _drawn(self, state: np.ndarray, lanes_between: tuple[int, int]) -> np.ndarray:
        """Return the samples, (K, T, 2): the last plan and the simple ways, and noise around all of them."""
        options, road = self._options, self._road
        here = road.lane_at(float(state[1]), float(state[0]))
        first, last = lanes_between
        reachable = [lane for lane in (here - 1, here, here + 1) if first <= lane <= last]
        lanes = np.repeat(np.array(reachable, dtype=float), len(SPEEDS))
        fastest = min(self._settings.speed_high, self._allowed(state))
        least, most = min(self._settings.speed_floor, fastest), fastest
        speeds = np.clip(float(state[3]) + np.tile(SPEEDS, len(reachable)), least, most)
        middles = np.empty((len(lanes) + 1, self._instants, 2))
        middles[0] = self._plan
        follow_lanes(state, lanes, speeds, self._robot, options.step, middles[1:])
        rest = options.samples - len(middles)
        knots = self._random.standard_normal((rest, KNOTS, 2))
        noise = np.einsum("tk,nkc->ntc", self._from_knots, knots)
        noise *= np.array([options.omega_deviation, options.acceleration_deviation])
        # Every other sample is around the last plan, the rest around one simple way after the other.
        numbers = np.arange(rest)
        around = np.where(numbers % 2 == 0, 0, 1 + numbers // 2 % (len(middles) - 1))
        return np.concatenate([middles, middles[around] + noise])

    def _mean(self, controls: np.ndarray, worths: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Return the mean of those that end where the best one does, (T, 2), weighted by exp(worth / temperature)."""
        best = int(np.argmax(worths))
        weights = np.where(ends == ends[best], np.exp((worths - worths[best]) / self._options.temperature), 0.0)
        return np.asarray(np.tensordot(weights / weights.sum(), controls, axes=1))

    def _answer(self, observation: Observation, path: np.ndarray, lanes_between: tuple[int, int]) -> Plan:
        """Return the first other lane that the path enters soon, and its speed after the time in which one is tracked.

        Not the lane in which it ends: a path may pass somebody on one side and come back, or go on to the other. Nor
        one that it enters later than a robot does that is told to now: it may pass somebody in that lane before.
        """
        road, (x, y, _, speed) = self._road, observation.robot.tolist()
        here = road.lane_at(y, x)
        soon = path[: self._until_across + 1]
        lanes = road.nearest_lanes(soon[:, 1], soon[:, 0])
        others = lanes[lanes != here]
        lane = min(max(int(others[0]), here - 1), here + 1) if len(others) else here
        lane = min(max(lane, lanes_between[0]), lanes_between[1])
        times = np.arange(len(path)) * self._options.step
        planned = min(float(np.interp(self._settings.speed_response, times, path[:, 3])), self._allowed(path[0]))
        action = IDLE
        if lane != here:
            action = LEFT if lane > here else RIGHT
        elif abs(planned - speed) > ANOTHER_SPEED:
            action = FASTER if planned > speed else SLOWER
        return Plan(action, Target(lane, planned))
