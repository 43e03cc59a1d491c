"""Whether the robot touches a car during a predicted action."""

from hj_cosim.kernels import kernel
from hj_cosim.planning.optimistic.prediction import (
    BRANCH,
    LANE,
    LATERAL,
    LENGTH,
    POSITION,
    WIDTH,
    PredictionModel,
    Scene,
    approach,
)


@kernel
def robot_crashes(scene: Scene, robot: int, model: PredictionModel) -> bool:
    """Return whether the robot's body touches a car's at any instant of the action.

    Between two steps both move on straight lines, so the instants at which they overlap along and across the road
    are two intervals in closed form, and they touch if these meet.
    """
    state, place, motion, robot_motion = scene.state, scene.place, scene.motion, scene.robot_motion
    start, end = robot_motion[POSITION, 0], robot_motion[POSITION, model.steps]
    moved = model.others_lateral_speed * model.step
    for car in range(state.shape[1]):
        if car == robot:
            continue
        branch = place[BRANCH, car]
        reach = 0.5 * (state[LENGTH, car] + state[LENGTH, robot])
        # Nobody drives backwards: most cars stay ahead of where the robot gets to, or behind where it began.
        if state[POSITION, car] - end >= reach or motion[branch, POSITION, car, model.steps] - start <= -reach:
            continue
        breadth = 0.5 * (state[WIDTH, car] + state[WIDTH, robot])
        centre = place[LANE, car] * model.lane_width
        for now in range(model.steps):
            along = motion[branch, POSITION, car, now] - robot_motion[POSITION, now]
            next_along = motion[branch, POSITION, car, now + 1] - robot_motion[POSITION, now + 1]
            if min(along, next_along) >= reach or max(along, next_along) <= -reach:
                continue
            across = approach(state[LATERAL, car], centre, moved * now) - robot_motion[LATERAL, now]
            next_across = approach(state[LATERAL, car], centre, moved * (now + 1)) - robot_motion[LATERAL, now + 1]
            enter, leave = instants_within(along, next_along, reach)
            enter_across, leave_across = instants_within(across, next_across, breadth)
            if max(enter, enter_across) < min(leave, leave_across):
                return True
    return False


@kernel
def instants_within(offset: float, next_offset: float, reach: float) -> tuple[float, float]:
    """Return the part of [0, 1] in which |offset| < reach while it goes linearly to `next_offset`; (1, 0) if none."""
    change = next_offset - offset
    if change == 0.0:
        return (0.0, 1.0) if abs(offset) < reach else (1.0, 0.0)
    first, last = (-reach - offset) / change, (reach - offset) / change
    return max(min(first, last), 0.0), min(max(first, last), 1.0)
