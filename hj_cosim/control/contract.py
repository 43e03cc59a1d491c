"""What a safety filter is: one class with one method.

A filter of one's own needs nothing else; `hj-cosim run --filter mine.py:Cautious` drives it:

    from hj_cosim.control.contract import FilterDecision
    from hj_cosim.scene.observation import Control

    class Cautious:
        def filter(self, observation, values, desired):
            if values.least > 5.0:
                return FilterDecision(desired)
            return FilterDecision(Control(desired.omega, -3.0), constraints=1)

Its constructor is handed what it asks for by the names of its parameters, any of FilterInputs' fields:

    def __init__(self, robot, step): ...

The loop guards every filter (control/guard.py): it is asked only where the observation and V are numbers, the desired
control that it is handed is finite and within the robot's limits, and what it answers is brought within them. A control
that is not finite says that the filter cannot judge: the robot brakes in its lane, and summary.json counts it
(`not_judged_samples`). An answer that takes ten seconds ends the episode, and so does a filter that raises,
or writes into the arrays that it is handed.

It may have a method `prepare(observation, values)`, called once before the drive: what takes long, such as compiling,
belongs there, and must not change what it answers. `hj_cosim.testing.check_filter` tests a filter.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np

from hj_cosim.scene.observation import CarValues, Control, Observation
from hj_cosim.scene.road import Road
from hj_cosim.settings import DriverSettings, FilterSettings, RobotSettings, Settings

if TYPE_CHECKING:
    from hj_cosim.reachability.table.table import ValueTable


_CHANGED = 0.01  # of a control's range, which is noticed


@dataclass(frozen=True)
class FilterInputs:
    """What a filter may ask for, by the names of its constructor's parameters."""

    settings: FilterSettings  # the group `filter`
    options: Settings | None  # its own, where its class has a settings model `Options`
    robot: RobotSettings  # body and limits
    road: Road
    table: "ValueTable"  # V
    step: float  # s, for which a control is held
    drivers: DriverSettings  # the others' mean parameters; how they scatter is not for filters to know


@dataclass(frozen=True, slots=True)
class FilterDecision:
    """What a filter does at one instant, and why."""

    control: Control  # to apply for the next step
    constraints: int = 0  # how many cars constrain it, |K|
    slack: float = 0.0  # by how much the constraints are missed; 0 where they are met
    # (J,) of each car, the probability that its driver means harm, from a filter that judges that; it is recorded.
    belief: np.ndarray | None = None
    # Numbers by name, such as {"escaped": 1}; each is summed over the drive.
    diagnostics: Mapping[str, float] = field(default_factory=dict)

    @property
    def constrained(self) -> bool:
        """Whether any car constrains the control: an intervention, as the paper counts them."""
        return self.constraints > 0

    def intervening(self, desired: Control, robot: RobotSettings) -> bool:
        """Return whether it is an intervention: constrained, or another control than desired, by 1 % of its range."""
        return (
            self.constrained
            or abs(self.control.omega - desired.omega) > _CHANGED * 2.0 * robot.omega_max
            or abs(self.control.acceleration - desired.acceleration)
            > _CHANGED * (robot.acceleration_max - robot.acceleration_min)
        )


CANNOT_JUDGE = FilterDecision(Control(math.nan, math.nan))


class SafetyFilter(Protocol):
    """Turns the desired control into a safe one."""

    def filter(self, observation: Observation, values: CarValues, desired: Control) -> FilterDecision:
        """Return the control to apply for the next step; called once a step, in order.

        Args:
            observation: the robot and the cars around it now, all finite; not to be written to.
            values: V of the cars, finite or +inf; not to be written to.
            desired: what the tracking controller asks for, finite and within the robot's limits.
        """
        ...


@runtime_checkable
class PreparedFilter(SafetyFilter, Protocol):
    """A filter that has something to do before the drive."""

    def prepare(self, observation: Observation, values: CarValues) -> None:
        """Do what takes long, such as compiling; `observation` is the drive's first, `values` are its cars'."""
        ...
