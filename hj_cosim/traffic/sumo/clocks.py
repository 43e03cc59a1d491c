"""The robot's clock and SUMO's, which may make one step of several of the robot's."""

import numpy as np

from hj_cosim.scene.road import Road
from hj_cosim.traffic.sumo.between_steps import foreseen


class TwoClocks:
    """Counts the robot's steps, and says when SUMO's next one is due: when the first of the robot's within it is made.

    Args:
        step: s, the robot's.
        traffic_step: s, SUMO's, a multiple of the robot's.
    """

    def __init__(self, step: float, traffic_step: float) -> None:
        self.step = step
        self.ratio = round(traffic_step / step)  # of the robot's steps in one of SUMO's
        self.traffic_step = self.ratio * step
        self._steps = 0

    @property
    def time(self) -> float:
        """Return the robot's time, s."""
        return self._steps * self.step

    @property
    def elapsed(self) -> float:
        """Return how far the robot is into SUMO's step, s; 0 at its beginning."""
        return self._steps % self.ratio * self.step

    @property
    def is_traffic_due(self) -> bool:
        """Whether the robot's next step is the first within one of SUMO's."""
        return self._steps % self.ratio == 0

    def tick(self) -> None:
        """Count one of the robot's steps."""
        self._steps += 1

    def tick_of_traffic(self) -> None:
        """Count one of SUMO's steps, in which the robot made one, too."""
        self._steps += self.ratio

    def reset(self) -> None:
        """Begin at 0."""
        self._steps = 0

    def robot_at_traffic_step(
        self, state: np.ndarray, before: np.ndarray, acceleration: float, road: Road
    ) -> np.ndarray:
        """Return the robot's state, (4,), at the end of the step that SUMO makes now, if it goes on as it does.

        Args:
            state: (4,) p_x, p_y (m), θ (rad), v (m/s), in the road frame, at the end of the robot's own step.
            before: (4,) likewise, at its beginning.
            acceleration: m/s².
            road: the frame.
        """
        if self.ratio == 1:
            return state
        turn_rate = (float(state[2]) - float(before[2])) / self.step
        return foreseen(state, turn_rate, acceleration, (self.ratio - 1) * self.step, road)
