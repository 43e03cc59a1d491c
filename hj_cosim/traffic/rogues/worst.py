"""The worst that a car can do, by the robot's own value function."""

import math

from hj_cosim.settings import RogueLimits
from hj_cosim.traffic.rogues.contract import CarInput, RogueView, ValuesOfCars
from hj_cosim.traffic.rogues.steering import along_with_robot


class Worst:
    """Plays the game's optimal inputs: those that lower V most, whatever duties the game says that others have.

    V of the robot and one other car falls fastest with θ_o along (∂V/∂p_x, ∂V/∂p_y), as far as its heading goes, and
    a_o against ∂V/∂v_o (paper, eq. case study Hamiltonian). Where the table says nothing, it comes nearer.
    """

    def __init__(self, limits: RogueLimits, values: ValuesOfCars) -> None:
        """Take what its car can, and the robot's V."""
        self._limits, self._values = limits, values

    def act(self, view: RogueView) -> CarInput | None:
        """Return what it wants; see Behaviour."""
        values = self._values(view.observation)
        p_x, p_y, _, _, by_speed = values.gradient[view.own].tolist()
        if not math.isfinite(values.value[view.own]) or (p_x == 0.0 and p_y == 0.0):
            return along_with_robot(view, view.robot_lane, math.copysign(view.contact, view.ahead))
        most = self._limits.heading
        acceleration = -self._limits.braking if by_speed > 0.0 else self._limits.acceleration
        return CarInput(max(min(math.atan2(p_y, p_x), most), -most), acceleration)
