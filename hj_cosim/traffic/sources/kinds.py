"""Kinds of vehicles in a scenario's traffic: cars, and what `[[vehicles]]` says beside them, such as trucks."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from hj_cosim.settings import DriverSettings, NormalDistribution, Scenario
from hj_cosim.vehicles.car import CAR_LENGTH, CAR_WIDTH
from hj_cosim.vehicles.idm import mean_driver, parameter_settings
from hj_cosim.vehicles.mobil import mobil_parameters

CARS = 0  # the kind that cars are


@dataclass(frozen=True)
class Kind:
    """A kind of vehicle."""

    share: float  # of all that are drawn
    length: float  # m
    width: float  # m
    drivers: DriverSettings  # what its drivers are drawn from

    @property
    def mobil(self) -> np.ndarray:
        """MOBIL's parameters, (3,)."""
        return mobil_parameters(self.drivers.politeness, self.drivers.gain_threshold, self.drivers.safe_braking)


def kinds_of(scenario: Scenario) -> tuple[Kind, ...]:
    """Return the kinds in a scenario's traffic, cars first; what a kind leaves unsaid of its drivers is as of cars."""
    rest = max(1.0 - sum(each.share for each in scenario.vehicles), 0.0)
    others = (
        Kind(
            each.share,
            each.length,
            each.width,
            scenario.drivers.model_copy(update={name: value for name, value in each.drivers if value is not None}),
        )
        for each in scenario.vehicles
    )
    return (Kind(rest, CAR_LENGTH, CAR_WIDTH, scenario.drivers), *others)


def draw_kinds(kinds: Sequence[Kind], count: int, random: np.random.Generator) -> np.ndarray:
    """Return of which kind each of `count` vehicles is, (count,) int; nothing is drawn where all are cars."""
    if len(kinds) == 1:
        return np.full(count, CARS)
    shares = np.array([kind.share for kind in kinds])
    return random.choice(len(kinds), count, p=shares / shares.sum())


def draw_drivers(drivers: DriverSettings, count: int, random: np.random.Generator) -> np.ndarray:
    """Return the IDM parameters of `count` drivers, (count, 6) in the order of vehicles.idm."""
    return np.column_stack(
        [
            truncated_normal(each, count, random) if isinstance(each, NormalDistribution) else np.full(count, each)
            for each in parameter_settings(drivers)
        ]
    )


def draw_people(kinds: Sequence[Kind], kind: np.ndarray, random: np.random.Generator) -> np.ndarray:
    """Return the drivers of vehicles whose kinds are known, (J, 6); cars' are the same whatever the others are."""
    drivers = draw_drivers(kinds[CARS].drivers, len(kind), random)
    for number in range(CARS + 1, len(kinds)):
        rows = kind == number
        drivers[rows] = draw_drivers(kinds[number].drivers, int(rows.sum()), random)
    return drivers


def expected_drivers(
    kinds: Sequence[Kind], length: np.ndarray, width: np.ndarray, *, differ: bool = False
) -> np.ndarray | None:
    """Return what may be expected of drivers by the bodies (J,) of their vehicles, m: their kinds' means, (J, 6).

    None where all are cars, unless they `differ` in where they are. Of two kinds with the same body nobody sees which
    is which: the first counts.
    """
    if not kinds or (len(kinds) == 1 and not differ):
        return None
    found = np.tile(mean_driver(kinds[CARS].drivers), (len(length), 1))
    for kind in reversed(kinds):
        found[(length == kind.length) & (width == kind.width)] = mean_driver(kind.drivers)
    return found


def truncated_normal(distribution: NormalDistribution, count: int, random: np.random.Generator) -> np.ndarray:
    """Return `count` draws (count,); those beyond the truncation are drawn again."""
    deviations = random.standard_normal(count)
    while (outside := np.abs(deviations) > distribution.truncation).any():
        deviations[outside] = random.standard_normal(int(outside.sum()))
    return distribution.mean + distribution.deviation * deviations
