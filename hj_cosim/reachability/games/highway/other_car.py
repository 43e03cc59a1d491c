"""What the other car of the highway game is assumed to do at the worst (jitted)."""

from collections.abc import Mapping
from typing import NamedTuple

from numba import njit

from hj_cosim.errors import TableError

_PARAMETERS = ("other_heading_max", "other_acceleration_min", "other_acceleration_max")


class Disturbance(NamedTuple):
    """The other car's controls w_o, as the value table assumes them; a NamedTuple, so that kernels take it."""

    heading_max: float  # θ̄, rad
    acceleration_min: float  # m/s²
    acceleration_max: float  # m/s²

    @classmethod
    def of_game(cls, parameters: Mapping[str, float]) -> "Disturbance":
        """Return the limits among all parameters of a highway game.

        Raises:
            TableError: if they are the parameters of another game.
        """
        missing = [name for name in _PARAMETERS if name not in parameters]
        if missing:
            raise TableError(f"the game has no parameter {missing[0]}, which limits the other car in a highway game")
        return cls(*(parameters[name] for name in _PARAMETERS))


@njit(cache=True)
def allowed(other: Disturbance, p_x: float, p_y: float, v_r: float, v_o: float) -> tuple[float, float, float, float]:
    """Return what the other car may do in a state: least and greatest θ_o, rad, least and greatest a_o, m/s².

    The paper's assumption is the worst one, the same box in every state. Whoever judges the other car's inputs asks
    here, so that an assumption that depends on the state is one for optimal inputs and half-planes alike.
    """
    return -other.heading_max, other.heading_max, other.acceleration_min, other.acceleration_max
