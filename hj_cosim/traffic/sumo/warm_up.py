"""A user's simulation until the robot takes over: run at its own step, searched for a vehicle, and saved."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from hj_cosim.errors import ScenarioError, SimulationError
from hj_cosim.settings import OwnSimulationSettings, Scenario, shown
from hj_cosim.traffic.junctions import Junctions
from hj_cosim.traffic.net_file import CAR_CLASS
from hj_cosim.traffic.sources.own_configuration import OwnConfiguration
from hj_cosim.traffic.sumo.insertion import inserted
from hj_cosim.traffic.sumo.our_drivers import OurDrivers
from hj_cosim.traffic.sumo.session import SUMO_ERRORS, SumoSession, libsumo
from hj_cosim.traffic.sumo.take_over import TakeOver, edges_behind

SHORTEST_WAY = 300.0  # m, ahead of a vehicle that is taken over unasked
FAR_ENOUGH = 0.8  # of the longest way ahead: among these a seed chooses
LATER = 60.0  # s, by which the robot takes over later than without a seed, at most
SEARCHED_EVERY, EGO_SEARCHED_EVERY = 10.0, 1.0  # s
LONGEST_SEARCH, LONGEST_SIMULATION = 1800.0, 86400.0  # s
_NAMES_SHOWN = 8


def warm_up(
    own: OwnConfiguration,
    scenario: Scenario,
    junctions: Junctions,
    seed: int,
    folder: Path,
    length: float,
    drivers: OurDrivers | None = None,
) -> TakeOver:
    """Run a user's simulation until a vehicle can be taken over, and save it.

    Args:
        own: the simulation.
        scenario: when, and whose place, or where the robot is put in.
        junctions: of its network.
        seed: SUMO's, and of the choice among the vehicles that go about as far as any.
        folder: for the state that is saved.
        length: of the robot, m.
        drivers: ours, who drive all vehicles; their own do unless given.

    Raises:
        ScenarioError: if no vehicle can be taken over, or not the one that is asked for.
        SimulationError: if SUMO refuses the configuration, or fails.
    """
    state = folder / "taken_over.xml.gz"
    session = SumoSession(lambda _: ())
    try:
        words = ["sumo", "--configuration-file", str(own.copy), *quiet(session.warnings_file), *_exactly_saved(seed)]
        session.start(words, str(own.path))
        if drivers is not None:
            drivers.take_the_wheel(libsumo.vehicle.getIDList())
        return _search(own, scenario, junctions, seed, state, _Run(length, drivers))
    except SUMO_ERRORS as error:
        raise SimulationError(f"SUMO failed while {own.path} warmed up: {' '.join(str(error).split())}") from error
    finally:
        session.close()


def quiet(warnings_file: Path) -> list[str]:
    """Return the words that keep SUMO from writing anywhere but to `warnings_file`."""
    return ["--no-step-log", "true", "--no-warnings", "true", "--error-log", str(warnings_file)]


def _exactly_saved(seed: int) -> list[str]:
    """Return the words by which a state is saved to all digits.

    Without SUMO's random numbers: how many were drawn it goes on counting from one simulation of a process to the next,
    and finds others when it loads them. So they begin anew with the seed.
    """
    return ["--seed", str(seed % 2**31), "--save-state.precision", "16"]


def resumed(own: OwnConfiguration, taken: TakeOver, seed: int) -> list[str]:
    """Return SUMO's words to go on from a saved state."""
    words = ["sumo", "--configuration-file", str(own.copy), *_exactly_saved(seed)]
    return [*words, "--load-state", str(taken.state), "--begin", repr(taken.time)]


@dataclass(frozen=True)
class _Run:
    length: float  # m, of the robot
    drivers: OurDrivers | None

    def until(self, time: float) -> None:
        """Let the simulation run up to a time, s."""
        while libsumo.simulation.getTime() < time - 1e-9:
            libsumo.simulationStep()
            if self.drivers is not None:
                self.drivers.take_those_who_departed()


def _search(
    own: OwnConfiguration, scenario: Scenario, junctions: Junctions, seed: int, state: Path, run: _Run
) -> TakeOver:
    simulation, wish = libsumo.simulation, scenario.own
    start = _start(own, wish, seed)
    if start >= own.end:
        raise ScenarioError(
            f"{own.path} ends at {own.end:g} s, and the robot is to take over at {start:g} s; set scenario.own.begin"
            " (--begin) to an earlier time"
        )
    every = EGO_SEARCHED_EVERY if wish.ego else SEARCHED_EVERY
    last = min(own.end, start + (LONGEST_SIMULATION if wish.ego else LONGEST_SEARCH))
    run.until(start)
    refusal = "there is no vehicle"
    while True:
        found: TakeOver | _Candidate | str | None
        if scenario.robot.edge:
            found = inserted(scenario.robot, run.length, junctions, state)
        else:
            found = _choose(wish.ego, junctions, seed)
        if isinstance(found, _Candidate):
            found = _taken_over(found, junctions, state)
        if isinstance(found, TakeOver):
            simulation.saveState(str(state))
            return found
        if found is not None:
            refusal = found
        if simulation.getTime() >= last or (simulation.getMinExpectedNumber() == 0 and not scenario.robot.edge):
            raise ScenarioError(f"{own.path}, {start:.0f} to {simulation.getTime():.0f} s: {refusal}")
        run.until(min(float(simulation.getTime()) + every, last))


def _start(own: OwnConfiguration, wish: OwnSimulationSettings, seed: int) -> float:
    """Return from when on the robot may take over, s: not at the same instant for every seed, unless that is given."""
    if wish.begin is not None:
        return wish.begin
    if wish.ego:
        return own.begin  # as soon as it can be
    start = min(own.begin + wish.warm_up, 0.5 * (own.begin + own.end))
    if seed == 0:
        return start
    return start + float(np.random.default_rng([seed, 4]).uniform(0.0, min(LATER, 0.5 * (own.end - start))))


def _taken_over(found: "_Candidate", junctions: Junctions, state: Path) -> TakeOver:
    vehicle, name = libsumo.vehicle, found.vehicle
    place, whole = vehicle.getRouteIndex(name), tuple(vehicle.getRoute(name))
    return TakeOver(
        time=float(libsumo.simulation.getTime()),
        state=state,
        vehicle=name,
        route=whole[place:],
        behind=edges_behind(junctions, found.edges, whole[:place]),
        edges=found.edges,
        obstacle=found.obstacle,
        lane=vehicle.getLaneID(name),
        position=float(vehicle.getLanePosition(name)),
        speed=float(vehicle.getSpeed(name)),
    )


@dataclass(frozen=True)
class _Candidate:
    vehicle: str
    edges: tuple[str, ...]
    obstacle: str | None
    way: float  # m, ahead


def _choose(ego: str, junctions: Junctions, seed: int) -> _Candidate | str | None:
    """Return the vehicle to take over, or why there is none now; None where nobody is there to say anything of."""
    names = libsumo.vehicle.getIDList()
    if not names:
        return None
    if ego:
        if ego not in names:
            return f"vehicle {shown(repr(ego))} has not departed, or is gone; others are there: {_some(names)}"
        if not _is_car(ego):
            raise ScenarioError(
                f"the robot cannot take the place of vehicle {shown(repr(ego))}, which is no passenger car but a"
                f" {libsumo.vehicle.getVehicleClass(ego)}; name another one with scenario.own.ego (--ego)"
            )
        found = _candidate(ego, junctions, {})
        return (
            found if isinstance(found, _Candidate) else f"the robot cannot take the place of vehicle {ego!r}: {found}"
        )
    ways: dict[tuple[str, ...], tuple[tuple[str, ...], str | None, float]] = {}
    candidates, refused = [], Counter[str]()
    for name in sorted(names):
        found = _candidate(name, junctions, ways)
        if not isinstance(found, _Candidate):
            refused[found] += 1
        elif found.way < SHORTEST_WAY:
            refused[f"less than {SHORTEST_WAY:.0f} m are ahead, then {found.obstacle or 'its way ends'}"] += 1
        else:
            candidates.append(found)
    if not candidates:
        reasons = "; ".join(f"{count} of them: {reason}" for reason, count in refused.most_common(3))
        return f"the robot can take the place of none of {len(names)} vehicles; {reasons}"
    longest = max(candidate.way for candidate in candidates)
    far = [candidate for candidate in candidates if candidate.way >= FAR_ENOUGH * longest]
    if seed == 0:
        return max(far, key=lambda candidate: candidate.way)
    return far[int(np.random.default_rng([seed, 3]).integers(len(far)))]


def _some(names: Sequence[str]) -> str:
    return ", ".join(sorted(names)[:_NAMES_SHOWN]) + (", ..." if len(names) > _NAMES_SHOWN else "")


def _candidate(
    name: str, junctions: Junctions, ways: dict[tuple[str, ...], tuple[tuple[str, ...], str | None, float]]
) -> _Candidate | str:
    """Return a vehicle with its way ahead, or why it cannot be taken over; `ways` keeps what was found of routes."""
    vehicle = libsumo.vehicle
    if not _is_car(name):
        return f"no passenger car but a {vehicle.getVehicleClass(name)}"
    edge = vehicle.getRoadID(name)
    if not edge or edge.startswith(":"):
        return "inside a junction"
    lanes = [f"{edge}_{index}" for index in range(libsumo.edge.getLaneNumber(edge))]
    if sum(_admits_cars(lane) for lane in lanes) < 2:
        return "on a road with one lane for cars"
    route = tuple(vehicle.getRoute(name)[vehicle.getRouteIndex(name) :])
    if route not in ways:
        edges, obstacle = junctions.as_far_as_it_is_a_road(_once(route))
        length = sum(libsumo.lane.getLength(f"{each}_0") for each in edges)
        ways[route] = edges, obstacle, length
    edges, obstacle, length = ways[route]
    return _Candidate(name, edges, obstacle, length - float(vehicle.getLanePosition(name)))


def _is_car(vehicle: str) -> bool:
    return bool(libsumo.vehicle.getVehicleClass(vehicle) == CAR_CLASS)


def _once(route: tuple[str, ...]) -> tuple[str, ...]:
    """Return a route up to where it comes by an edge again."""
    seen: set[str] = set()
    for place, edge in enumerate(route):
        if edge in seen:
            return route[:place]
        seen.add(edge)
    return route


def _admits_cars(lane: str) -> bool:
    allowed = libsumo.lane.getAllowed(lane)
    return CAR_CLASS in allowed or (not allowed and CAR_CLASS not in libsumo.lane.getDisallowed(lane))
