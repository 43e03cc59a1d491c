"""Lanes that begin and end, for the tree search: where the robot may plan, where others may go, what stands at an end.

To a driver, the end of a lane is a standing obstacle: who is in that lane brakes for it, and leaves the lane for want
of gain. So it enters the tree as a car that stands there. Ahead of it nobody is, so it keeps its speed, 0.
"""

from dataclasses import replace

import numpy as np

from hj_cosim.planning.optimistic.prediction import PredictionModel
from hj_cosim.planning.optimistic.tree_search import ActionModel
from hj_cosim.scene.observation import NOBODY, Observation
from hj_cosim.scene.road import Road

# The robot plans for no lane that ends sooner than it gets there in this time (s), nor within the sensing range.
LASTING = 10.0
OBSTACLE_LENGTH = 1.0  # m
_EVERY = 20.0  # m, no lane is as short


def robots_lanes(road: Road, observation: Observation, sensing_range: float) -> tuple[int, int]:
    """Return the first and the last lane that the robot may plan for: those that last, and its own up to them.

    Args:
        road: the lanes.
        observation: where the robot is.
        sensing_range: m, the least way that a lane has to last.
    """
    along, lateral, _, speed = observation.robot.tolist()
    first, last = road.lasting_lanes(np.array([along]), max(sensing_range, LASTING * speed))[0].tolist()
    here = road.lane_at(lateral, along)
    return (min(first, here), max(last, here)) if first <= last else (here, here)


def with_road_ahead(
    prediction: PredictionModel, actions: ActionModel, road: Road, observation: Observation, sensing_range: float
) -> tuple[PredictionModel, ActionModel]:
    """Return the models of a search with the lanes that there are around the robot; see robots_lanes."""
    along = float(observation.robot[0])
    lowest, highest = robots_lanes(road, observation, sensing_range)
    near = [road.lanes_at(at) for at in np.arange(along - sensing_range, along + sensing_range + _EVERY, _EVERY)]
    return (
        prediction._replace(first_lane=min(lanes.start for lanes in near), stop_lane=max(lanes.stop for lanes in near)),
        actions._replace(lowest_lane=lowest, highest_lane=highest),
    )


def with_lane_ends(observation: Observation, road: Road, sensing_range: float) -> Observation:
    """Return an observation with a standing obstacle at the end of every lane beside the robot that ends in sight.

    A lane that leads off the road is no obstacle to those in it.
    """
    along = float(observation.robot[0])
    ends = {lane: road.lane_end(lane, along) for lane in road.lanes_at(along) if not road.leads_off(lane, along)}
    near = {lane: end for lane, end in ends.items() if end - along <= sensing_range}
    if not near:
        return observation
    lane, x = np.array(list(near), np.int64), np.array(list(near.values())) + 0.5 * OBSTACLE_LENGTH
    zero, expected = np.zeros(len(x)), observation.expected_driver
    if expected is not None and len(expected) == 0:
        expected = None

    def longer(name: str, added: np.ndarray) -> np.ndarray:
        return np.concatenate([getattr(observation, name), added])

    return replace(
        observation,
        vehicle=longer("vehicle", np.full(len(x), NOBODY)),
        x=longer("x", x),
        y=longer("y", road.lane_centres(lane, x)),
        heading=longer("heading", zero),
        speed=longer("speed", zero),
        acceleration=longer("acceleration", zero),
        lane=longer("lane", lane),
        target_lane=longer("target_lane", lane),
        length=longer("length", zero + OBSTACLE_LENGTH),
        width=longer("width", zero + road.lane_width - 1.0),  # it is in its own lane alone
        # Nobody drives it.
        expected_driver=None if expected is None else np.vstack([expected, np.tile(expected[:1], (len(x), 1))]),
    )
