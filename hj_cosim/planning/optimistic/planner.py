"""The planners OP and HJOP: optimistic planning with the paper's reward, without and with the HJI term."""

import math
from collections.abc import Sequence

import numpy as np

from hj_cosim.errors import ConfigurationError
from hj_cosim.planning.contract import ACTION_COUNT, Plan, PlanStatistics, PredictedTrajectory
from hj_cosim.planning.optimistic.lane_ends import with_lane_ends, with_road_ahead
from hj_cosim.planning.optimistic.prediction import (
    LANE,
    LATERAL,
    POSITION,
    ROBOT,
    SECOND_LANE,
    SPEED,
    VEHICLE,
    PredictionModel,
    empty_scene,
    noticed_lanes,
)
from hj_cosim.planning.optimistic.reward import reward_model
from hj_cosim.planning.optimistic.speed_limits import fastest_within_limits, limits_in_sight
from hj_cosim.planning.optimistic.tree_search import (
    KIND,
    LANE_CHANGE,
    ROOT,
    SPEED_CHANGE,
    ActionModel,
    PlannedState,
    Tree,
    add_child,
    empty_tree,
    open_node,
    outermost_lanes,
    search,
)
from hj_cosim.reachability.table.size_classes import classes_of
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import NOBODY, Observation, Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings
from hj_cosim.vehicles.idm import mean_driver
from hj_cosim.vehicles.mobil import mobil_parameters

# Expansions times vehicles: a tree of some 4 GB.
LARGEST_TREE = 40_000_000


def prediction_model(
    settings: PlannerSettings, robot: RobotSettings, drivers: DriverSettings, road: Road, vehicles: int
) -> PredictionModel:
    """Return the prediction for so many vehicles, the robot included: all drivers are the mean driver."""
    driver = mean_driver(drivers)
    steps = max(round(settings.action_time / settings.prediction_step), 1)
    step = settings.action_time / steps
    return PredictionModel(
        drivers=np.tile(driver, (vehicles, 1)),
        tells_apart=False,
        mobil=mobil_parameters(drivers.politeness, drivers.gain_threshold, drivers.safe_braking),
        lane_count=road.lane_count,
        first_lane=0,
        stop_lane=road.lane_count,
        lane_width=road.lane_width,
        steps=steps,
        step=step,
        robot_lateral_speed=road.lane_width / settings.lane_change_time,
        heading_max_sine=math.sin(settings.heading_max),
        others_lateral_speed=road.lane_width / settings.others_lane_change_time,
        speed_kept=math.exp(-step / settings.speed_response),
        speed_response=settings.speed_response,
        notice_reach=road.overlap_reach(robot.width),
    )


class OptimisticPlanner:
    """HJOP: optimistic planning with the HJI term, of the weight 1 − γ_R.

    The default budget of 300 expansions takes some 5 ms. In `paper`, HJOP without a filter drives as with ten times as
    many, and worse with fewer; in random dense scenes its first action loses 0.13 of at most 10 (0.38 with 40
    expansions, 0.02 with 1000). tests/benchmarks/test_planner.py has the tables.

    Not for several threads at once: it keeps its work space from plan to plan. That is bounded by the budget, see
    tree_search.

    Args:
        settings: the tree search's and the reward's.
        robot: the robot's body and limits.
        drivers: what the other drivers' parameters are drawn from, of which the means are used.
        road: the lanes.
        table: V.
    """

    def __init__(
        self, settings: PlannerSettings, robot: RobotSettings, drivers: DriverSettings, road: Road, table: ValueTable
    ) -> None:
        self._settings = settings
        self._robot = robot
        self._drivers = drivers
        self._road = road
        self._tables = table.stack
        self._weights = reward_model(settings, road)
        self._actions = ActionModel(
            settings.discount,
            settings.speed_step,
            settings.speed_floor,
            settings.speed_high,
            settings.expansions,
            lowest_lane=0,
            highest_lane=road.lane_count - 1,
            polite_braking=settings.polite_braking,
        )
        self._make_room(1)

    def _make_room(self, vehicles: int) -> None:
        if self._settings.expansions * vehicles > LARGEST_TREE:
            raise ConfigurationError(
                f"planner.expansions = {self._settings.expansions}: with {vehicles} vehicles within"
                f" planner.sensing_range the tree is too large; {LARGEST_TREE // vehicles} expansions are the most"
            )
        self._prediction = prediction_model(self._settings, self._robot, self._drivers, self._road, vehicles)
        self._tree = empty_tree(self._settings.expansions, vehicles)
        self._scene = empty_scene(vehicles, self._prediction.steps, self._road.lane_count)
        self._scene.drivers[:] = self._prediction.drivers

    def plan(self, observation: Observation, previous: Target) -> Plan:
        """Return the first action of the best path found, with the search's statistics.

        Args:
            observation: the robot and the cars around it now; those within the sensing range enter the tree.
            previous: the last target, of which the planned lane is kept, and the planned speed as far as it is
                within the speed window around the robot's.

        Raises:
            ConfigurationError: if the budget is too large for so many cars (LARGEST_TREE).
        """
        observation = with_lane_ends(observation, self._road, self._settings.sensing_range)
        cars, bodies = self._enter(observation)
        if not self._road.is_straight:
            self._look_ahead(observation)
        self._plant_root(self._tree, observation, cars, previous)
        action_values = np.empty(ACTION_COUNT)
        nodes, expansions, best = search(
            self._tree,
            self._scene,
            bodies,
            self._prediction,
            self._actions,
            self._weights,
            self._tables,
            action_values,
        )
        path = _path_to(self._tree, best)
        first = self._tree.nodes[path[1]]
        return Plan(
            action=int(first["action"]),
            target=Target(int(first["planned_lane"]), float(first["planned_speed"])),
            statistics=PlanStatistics(
                expansions=expansions,
                nodes=nodes,
                depth=int(self._tree.nodes["depth"][:nodes].max()),
                best_value=float(self._tree.nodes[best]["value"]),
                action_values=action_values,
                trajectory=self._trajectory(self._tree, path, observation, cars),
            ),
        )

    def prepare(self, observation: Observation) -> None:
        """Compile the search, with a plan that nobody follows; it does not change what `plan` answers."""
        along, lateral, _, speed = observation.robot.tolist()
        self.plan(observation, Target(self._road.lane_at(lateral, along), speed))

    def foresee(self, observation: Observation, previous: Target, actions: Sequence[int]) -> PredictedTrajectory:
        """Return what is expected to happen if the robot drives given actions, one for each action time.

        Args:
            observation: the robot and the cars around it now; those within the sensing range are predicted.
            previous: what the robot has planned, which the first action changes.
            actions: such as IDLE.
        """
        observation = with_lane_ends(observation, self._road, self._settings.sensing_range)
        cars, bodies = self._enter(observation)
        if not self._road.is_straight:
            self._look_ahead(observation)
        tree = empty_tree(len(actions), len(cars) + 1)
        self._plant_root(tree, observation, cars, previous)
        for node, action in enumerate(actions):
            lane = int(tree.nodes[node]["planned_lane"]) + LANE_CHANGE[action]
            speed = float(tree.nodes[node]["planned_speed"]) + SPEED_CHANGE[action] * self._settings.speed_step
            robot = open_node(tree, node, self._scene, bodies, self._prediction)
            planned = PlannedState(action, lane, float(speed))
            add_child(tree, node, node + 1, planned, self._scene, robot, self._prediction)
        return self._trajectory(tree, np.arange(len(actions) + 1), observation, cars)

    def _look_ahead(self, observation: Observation) -> None:
        """Take the lanes and the speed limits that there are around the robot into the models."""
        road, settings = self._road, self._settings
        self._prediction, self._actions = with_road_ahead(
            self._prediction, self._actions, road, observation, settings.sensing_range
        )
        along, _, _, speed = observation.robot.tolist()
        self._scene = self._scene._replace(limits=limits_in_sight(road, along, settings.sensing_range))
        fastest = min(settings.speed_high, fastest_within_limits(road, along, speed, settings.action_time))
        self._actions = self._actions._replace(speed_high=fastest, speed_floor=min(settings.speed_floor, fastest))

    def _enter(self, observation: Observation) -> tuple[np.ndarray, np.ndarray]:
        """Return the indices of the cars that enter the tree, and the bodies (J + 1, 3) of all, the robot's first."""
        cars = self._sensed(observation)
        if len(cars) + 1 != len(self._prediction.drivers):
            self._make_room(len(cars) + 1)
        bodies = np.zeros((len(cars) + 1, 3))
        bodies[ROBOT, :KIND] = self._robot.length, self._robot.width
        bodies[1:, 0], bodies[1:, 1] = observation.length[cars], observation.width[cars]
        expected = observation.expected_driver
        if expected is not None:
            self._prediction.drivers[1:] = expected[cars]
        self._prediction = self._prediction._replace(tells_apart=expected is not None)
        bodies[1:, KIND] = classes_of(self._tables.numbers, observation.length[cars], observation.width[cars])
        return cars, bodies

    def _sensed(self, observation: Observation) -> np.ndarray:
        """Return the indices of the cars that enter the tree, nearest the robot's rear first.

        A car that overlaps the robot already is left out: no action can avoid that collision any more.
        """
        ahead = observation.x - observation.robot[0]
        across = observation.y - observation.robot[1]
        overlaps = (np.abs(ahead) < 0.5 * (observation.length + self._robot.length)) & (
            np.abs(across) < 0.5 * (observation.width + self._robot.width)
        )
        cars = np.flatnonzero((np.abs(ahead) <= self._settings.sensing_range) & ~overlaps)
        return cars[np.argsort(observation.x[cars], kind="stable")]

    def _plant_root(self, tree: Tree, observation: Observation, cars: np.ndarray, previous: Target) -> None:
        road, settings = self._road, self._settings
        x, y, heading, speed = observation.robot
        planned_speed = min(max(previous.speed, speed - settings.speed_window), speed + settings.speed_window)
        root = tree.nodes[ROOT]
        root["parent"], root["depth"], root["value"], root["heading"] = ROOT, 0, 0.0, heading
        root["planned_lane"] = min(max(previous.lane, self._actions.lowest_lane), self._actions.highest_lane)
        root["planned_speed"] = min(max(planned_speed, self._actions.speed_floor), self._actions.speed_high)
        noticed = noticed_lanes(float(y), self._prediction)
        lowest, highest = outermost_lanes(noticed or 1 << road.lane_at(y, x), road.lane_count)
        lane, second_lane = occupied_lanes(observation, cars, road)
        state, place = tree.state[ROOT], tree.place[ROOT]
        state[POSITION, ROBOT], state[POSITION, 1:] = 0.0, observation.x[cars] - x
        state[SPEED, ROBOT], state[SPEED, 1:] = speed, observation.speed[cars]
        state[LATERAL, ROBOT], state[LATERAL, 1:] = y, observation.y[cars]
        place[VEHICLE] = np.arange(len(cars) + 1)
        place[LANE, ROBOT], place[LANE, 1:] = lowest, lane
        place[SECOND_LANE, ROBOT], place[SECOND_LANE, 1:] = highest, second_lane

    def _trajectory(
        self, tree: Tree, path: np.ndarray, observation: Observation, cars: np.ndarray
    ) -> PredictedTrajectory:
        nodes = tree.nodes[path]
        # Nodes keep their vehicles nearly sorted by position: undo that.
        order = np.argsort(tree.place[path, VEHICLE], axis=1)
        state = np.take_along_axis(tree.state[path], order[:, np.newaxis], axis=2).astype(np.float64)
        position, speed, lateral = state[:, POSITION] + observation.robot[0], state[:, SPEED], state[:, LATERAL]
        # Obstacles at the ends of lanes are no cars.
        shown = np.append(0, 1 + np.flatnonzero(observation.vehicle[cars] != NOBODY))
        position, speed, lateral, cars = position[:, shown], speed[:, shown], lateral[:, shown], cars[shown[1:] - 1]
        return PredictedTrajectory(
            time=self._settings.action_time * np.arange(len(path)),
            action=nodes["action"][1:],
            robot=np.column_stack((position[:, ROBOT], lateral[:, ROBOT], nodes["heading"], speed[:, ROBOT])),
            planned_lane=nodes["planned_lane"],
            planned_speed=nodes["planned_speed"],
            vehicle=observation.vehicle[cars],
            x=position[:, 1:],
            y=lateral[:, 1:],
            speed=speed[:, 1:],
        )


def occupied_lanes(observation: Observation, cars: np.ndarray, road: Road) -> tuple[np.ndarray, np.ndarray]:
    """Return the lanes that cars drive to and the second lanes that they occupy meanwhile (or the first again).

    A car that changes lanes may already be counted to its new lane: then its lateral position tells whether its body
    has left the lane that it comes from.
    """
    lane, target = observation.lane[cars], observation.target_lane[cars]
    offset = observation.y[cars] - road.lane_centres(target, observation.x[cars])
    is_within = np.abs(offset) <= 0.5 * (road.lane_width - observation.width[cars])
    neighbour = target + np.where(is_within, 0, np.sign(offset)).astype(np.int64)
    return target, np.clip(np.where(lane != target, lane, neighbour), 0, road.lane_count - 1)


def _path_to(tree: Tree, node: int) -> np.ndarray:
    path = [node]
    while path[-1] != ROOT:
        path.append(int(tree.nodes[path[-1]]["parent"]))
    return np.array(path[::-1])


class OptimisticPlannerWithoutValue(OptimisticPlanner):
    """OP: the same search with the driving reward alone, γ_R = 1, for which V is not looked up."""

    def __init__(
        self, settings: PlannerSettings, robot: RobotSettings, drivers: DriverSettings, road: Road, table: ValueTable
    ) -> None:
        super().__init__(settings.model_copy(update={"gamma_r": 1.0}), robot, drivers, road, table)
