"""How far off the planners' prediction is: once a second all cars around are predicted, and looked up 1 to 3 s later.

It is the tree search's prediction, IDM and MOBIL with what can be known of the drivers, whichever planner drives: so
that runs can be compared, and other people's traffic with ours. The robot is predicted to go on to what it has planned.
"""

from typing import Any

import numpy as np

from hj_cosim.planning.contract import IDLE, PredictedTrajectory
from hj_cosim.planning.optimistic.planner import OptimisticPlanner
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.scene.observation import Observation, Target
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings, PlannerSettings, RobotSettings

EVERY = 1.0  # s
AHEAD = (1, 2, 3)  # predictions


class ForesightAudit:
    """Predicts once a second and remembers how wrong the last predictions were.

    Args:
        settings: the prediction's, of the planner.
        robot: its body.
        drivers: what a planner is told of the others' drivers.
        road: the lanes.
        table: V; nothing is looked up in it.
    """

    # Five parameters beside itself, those of a planner.
    def __init__(
        self, settings: PlannerSettings, robot: RobotSettings, drivers: DriverSettings, road: Road, table: ValueTable
    ) -> None:
        once = settings.model_copy(update={"action_time": EVERY, "expansions": len(AHEAD)})
        self._model = OptimisticPlanner(once, robot, drivers, road, table)
        self._road = road
        self._made: list[tuple[float, PredictedTrajectory]] = []  # when (s), and what; those not yet past
        self._wrong: dict[int, list[np.ndarray]] = {ahead: [] for ahead in AHEAD}
        self._lane_known: list[np.ndarray] = []

    def judge(self, observation: Observation, target: Target) -> None:
        """Look the earlier predictions' cars up, and predict anew; called once in EVERY seconds, or left out.

        Args:
            observation: finite.
            target: what the robot has planned.
        """
        now = observation.time
        self._made = [(made, path) for made, path in self._made if round((now - made) / EVERY) <= AHEAD[-1]]
        for made, path in self._made:
            ahead = round((now - made) / EVERY)
            _, here, there = np.intersect1d(path.vehicle, observation.vehicle, return_indices=True)
            off = path.x[ahead, here] - observation.x[there]
            if self._road.lap:
                off -= self._road.lap * np.round(off / self._road.lap)
            self._wrong[ahead].append(np.abs(off))
            if ahead == AHEAD[-1]:
                lane = self._road.nearest_lanes(path.y[ahead, here], path.x[ahead, here])
                self._lane_known.append(lane == observation.lane[there])
        latest = self._model.foresee(observation, target, [IDLE] * len(AHEAD))
        self._made.append((now, latest))

    def summary(self) -> dict[str, Any]:
        """Return what goes into summary.json; NaN where there was nobody to predict."""
        found: dict[str, Any] = {}
        for ahead in AHEAD:
            wrong = np.concatenate([np.empty(0), *self._wrong[ahead]])
            found[f"prediction_error_{ahead}s"] = float(wrong.mean()) if len(wrong) else float("nan")
            found[f"prediction_samples_{ahead}s"] = len(wrong)
        known = np.concatenate([np.empty(0, bool), *self._lane_known])
        found["prediction_lane_3s"] = float(known.mean()) if len(known) else float("nan")
        return found
