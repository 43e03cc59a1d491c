"""The highway game with another V(0, ·): along the road not RSS's distance, but a time to collision.

    V(0, x) = max(|p_x| − length − [g + T (v_rear − v_front)]_+, the lateral term of `game`)

Where it is positive along the road, the gap would be down to g no earlier than in T at the speeds of now; where the
front car is faster by g/T or more, the bodies do not touch. It is a margin in metres, as the other targets are, so that
ε and rows mean the same. Unlike them it asks for no more than g at equal speeds, however fast both are. Its slopes by
the speeds are T at most: at 3 s less than RSS's from 16 m/s on.
"""

import math
from dataclasses import replace

import numpy as np

from hj_cosim.reachability.games.contract import state_function
from hj_cosim.reachability.games.highway.game import game as highway
from hj_cosim.reachability.games.highway.parameters import PARAMETERS
from hj_cosim.vehicles.rss import lateral_distance

_TIME, _GAP = len(PARAMETERS), len(PARAMETERS) + 1


@state_function
def target(x, c, out):  # type: ignore[no-untyped-def]
    """V(0, x), of the grid's coordinates."""
    for i in range(out.shape[0]):
        p_x = x[0, i] + c[15] * (x[4, i] * x[4, i] - x[3, i] * x[3, i])
        closing = x[4, i] - x[3, i] if p_x > 0.0 else x[3, i] - x[4, i]
        gap_x = abs(p_x) - c[6] - max(c[_GAP] + c[_TIME] * closing, np.float32(0.0))
        # Straight ahead or behind, either way to the side counts as approaching, as in `game`.
        leftwards = x[3, i] * math.sin(x[2, i])
        towards = abs(leftwards) if x[1, i] == 0.0 else -math.copysign(leftwards, leftwards * x[1, i])
        lateral = lateral_distance(towards, 0.0, c[8], c[12], c[13], c[8], c[12], c[13], c[14])
        gap_y = abs(x[1, i]) - c[7] - np.float32(0.5) * c[21] * abs(math.sin(x[2, i])) - lateral
        out[i] = max(gap_x, 4.0 * gap_y**3)


game = replace(
    highway,
    name="highway_ttc",
    # After the highway game's, of which those of RSS's longitudinal distance say what duties are, if there are any.
    parameters={
        **PARAMETERS,
        "time_to_collision": 3.0,  # s, T
        "gap_at_collision": 2.0,  # m, g
    },
    target=target,
)
