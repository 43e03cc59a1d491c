"""What can be known of drivers that are not ours, by their types."""

from collections.abc import Sequence

import numpy as np

from hj_cosim.settings import DriverSettings, NormalDistribution
from hj_cosim.traffic.sumo.puppet import ROBOT
from hj_cosim.traffic.sumo.session import libsumo
from hj_cosim.vehicles.idm import PARAMETER_NAMES

BUILT_IN = "DEFAULT_"  # how SUMO's own types begin, which are there whether anybody has them or not
USUAL_EXPONENT = 4.0  # IDM's, which SUMO has no getter for
LEAST = 0.1  # of any parameter: IDM divides by some


def estimated_driver(name: str) -> np.ndarray:
    """Return what IDM's parameters (6,) are of a vehicle of SUMO's, as far as its own car-following model has them.

    It desires the speed that its type and its lane allow.
    """
    vehicle = libsumo.vehicle
    desired_speed = min(vehicle.getMaxSpeed(name), vehicle.getAllowedSpeed(name))
    getters = (vehicle.getAccel, vehicle.getDecel, vehicle.getTau, vehicle.getMinGap)
    return np.maximum([desired_speed, *(getter(name) for getter in getters), USUAL_EXPONENT], LEAST)


def typical_driver(names: Sequence[str], otherwise: DriverSettings) -> DriverSettings:
    """Return the mean of what can be known of some vehicles' drivers, for a planner; MOBIL's parameters stay.

    Args:
        names: the vehicles' in SUMO.
        otherwise: what to take where there is no vehicle, and MOBIL's parameters from.
    """
    if not names:
        return otherwise
    mean = np.mean([estimated_driver(name) for name in names], axis=0)
    known = dict(zip(PARAMETER_NAMES, mean.tolist(), strict=True))
    exponent = known.pop("exponent")
    certain = {name: NormalDistribution(mean=value, deviation=0.0) for name, value in known.items()}
    return otherwise.model_copy(update={**certain, "exponent": exponent})


def known_bodies() -> set[tuple[float, float]]:
    """Return length and width (m) of all types that a simulation knows by now, and of the vehicles in it.

    SUMO's own types count where a vehicle has one; the robot's is nobody else's.
    """
    kind, vehicle = libsumo.vehicletype, libsumo.vehicle
    own = {name for name in kind.getIDList() if not name.startswith(BUILT_IN)}
    names = (own | {vehicle.getTypeID(name) for name in vehicle.getIDList()}) - {ROBOT}
    return {(float(kind.getLength(name)), float(kind.getWidth(name))) for name in names}
