"""What a lane change asks of those behind: MOBIL's safety criterion, of the robot (Kesting, Treiber & Helbing 2007).

V does not mind a follower who can brake, for RSS's distances count on it that he does: hard, if need be. A driver who
finds a faster car six metres ahead brakes with all he has, although nothing is about to happen; nobody likes who causes
that, and half a second later there would have been room.
"""

from hj_cosim.kernels import kernel
from hj_cosim.planning.optimistic.prediction import (
    BRANCH,
    FOLLOWS_IN,
    HARDEST_BRAKING,
    LANE,
    LENGTH,
    POSITION,
    SECOND_LANE,
    SPEED,
    PredictionModel,
    Scene,
)
from hj_cosim.vehicles.idm import driver_of, idm_acceleration


@kernel
def braking_imposed(scene: Scene, robot: int, occupied: int, model: PredictionModel) -> float:
    """Return how hard who is behind the robot in a lane that it enters has to brake by IDM, m/s².

    Whoever it overtakes meanwhile is among them. From the first predicted instant on, not only once the robot is
    predicted to be noticed: the tracked robot crosses the first metre faster.

    Args:
        scene: in which the cars have reacted to the robot's action.
        robot: its column.
        occupied: bit set of the lanes in which the robot is noticed in the action.
        model: the prediction's.

    Returns:
        HARDEST_BRAKING at the most, 0 where nobody is behind or has to.
    """
    entered = occupied & ~scene.robot_lanes[0]
    hardest = 0.0
    if entered == 0:
        return hardest
    place, end = scene.place, scene.robot_motion[POSITION, model.steps]
    for car in range(robot):
        if place[FOLLOWS_IN, car] & entered:
            hardest = max(hardest, _braking_behind(scene, robot, car, model))
    for car in range(robot + 1, place.shape[1]):
        if scene.state[POSITION, car] >= end:  # nor is who is farther ahead overtaken
            break
        if ((1 << place[LANE, car]) | (1 << place[SECOND_LANE, car])) & entered:
            hardest = max(hardest, _braking_behind(scene, robot, car, model))
    return min(hardest, HARDEST_BRAKING)


@kernel
def _braking_behind(scene: Scene, robot: int, car: int, model: PredictionModel) -> float:
    """Return how hard a car has to brake for the robot at the instants at which it is behind it, m/s²."""
    branch = scene.place[BRANCH, car]
    position, speed = scene.motion[branch, POSITION, car], scene.motion[branch, SPEED, car]
    reach = 0.5 * (scene.state[LENGTH, car] + scene.state[LENGTH, robot])
    hardest, driver = 0.0, driver_of(scene.drivers, car)
    for now in range(1, model.steps + 1):
        ahead = scene.robot_motion[POSITION, now] - position[now]
        if ahead > 0.0:
            hardest = max(hardest, -idm_acceleration(speed[now], ahead - reach, scene.robot_motion[SPEED, now], driver))
    return hardest
