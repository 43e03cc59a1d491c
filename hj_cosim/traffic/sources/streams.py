"""Streams: cars that SUMO lets in during the drive, from one edge of the network to another."""

from dataclasses import dataclass

import numpy as np

from hj_cosim.settings import Scenario
from hj_cosim.traffic.sources.kinds import draw_kinds, draw_people, kinds_of

# Of how many different people a stream's cars are driven; SUMO picks one of them for each car.
PEOPLE = 40


@dataclass(frozen=True)
class Stream:
    """Cars that come one by one, at times that are as random as a Poisson process'."""

    name: str
    from_edge: str
    to_edge: str
    per_hour: float
    drivers: np.ndarray  # (PEOPLE, 6) IDM parameters in the order of vehicles.idm
    bodies: np.ndarray  # (PEOPLE, 2) length and width of what they drive, m


def drawn_streams(scenario: Scenario, seed: int) -> list[Stream]:
    """Return the streams of a scenario, their drivers drawn with `seed` from the same distributions as the others."""
    kinds = kinds_of(scenario)
    found = []
    for number, stream in enumerate(scenario.streams):
        kind = draw_kinds(kinds, PEOPLE, np.random.default_rng([seed, 5, number]))
        drivers = draw_people(kinds, kind, np.random.default_rng([seed, 3, number]))
        bodies = np.array([(kinds[each].length, kinds[each].width) for each in kind])
        name = f"stream_{number}"
        found.append(Stream(name, stream.from_edge, stream.to_edge, stream.flow, drivers, bodies))
    return found
