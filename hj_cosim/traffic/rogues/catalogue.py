"""Who among the cars is a rogue, and the behaviour that the settings name."""

from dataclasses import dataclass, fields, replace

import numpy as np

from hj_cosim.plugins import PluginKind, construct, find_plugin, options_of
from hj_cosim.settings import MIXED, RogueSettings, Scenario
from hj_cosim.traffic.rogues.contract import Behaviour, BehaviourInputs

BEHAVIOUR = PluginKind(
    noun="behaviour",
    method="act",
    group="hj_cosim.behaviours",
    setting="scenario.rogues.behaviour",
    options="scenario.rogues.options",
    ours={
        "cut_in": "hj_cosim.traffic.rogues.cut_in:CutIn",
        "brake_check": "hj_cosim.traffic.rogues.brake_check:BrakeCheck",
        "tailgate": "hj_cosim.traffic.rogues.tailgate:Tailgate",
        "drift": "hj_cosim.traffic.rogues.drift:Drift",
        "block": "hj_cosim.traffic.rogues.block:Block",
        "worst": "hj_cosim.traffic.rogues.worst:Worst",
    },
    several=(MIXED,),
)
_SEED_STREAM = 4  # of the draws that concern rogues, so that they change no other


@dataclass(frozen=True)
class ChosenRogue:
    """A car whose driver is a rogue."""

    car: int  # its place among the scenario's cars: the drawn ones first, then those placed by hand
    behaviour: str  # a reference
    seed: tuple[int, int, int]  # of the rogue's own random numbers


def choose_rogues(scenario: Scenario, drawn: int, seed: int) -> tuple[ChosenRogue, ...]:
    """Return who is a rogue: a share of the drawn cars, and those placed by hand that name a behaviour.

    Args:
        scenario: whose.
        drawn: how many cars are drawn.
        seed: of the episode.
    """
    random = np.random.default_rng([seed, _SEED_STREAM])
    count = round(scenario.rogues.share * drawn)
    cars = np.sort(random.permutation(drawn)[:count]).tolist()
    ours = tuple(BEHAVIOUR.ours)
    drawn_behaviours = [ours[each] for each in random.integers(len(ours), size=drawn + len(scenario.cars))]

    def behaviour(named: str, car: int) -> str:
        return drawn_behaviours[car] if named == MIXED else named

    chosen = [(car, behaviour(scenario.rogues.behaviour, car)) for car in cars]
    by_hand = enumerate(scenario.cars, start=drawn)
    chosen += [(car, behaviour(start.rogue, car)) for car, start in by_hand if start.rogue is not None]
    return tuple(ChosenRogue(car, reference, (seed, _SEED_STREAM, car)) for car, reference in chosen)


def make_behaviour(reference: str, settings: RogueSettings, inputs: BehaviourInputs) -> Behaviour:
    """Return a behaviour, ours or a user's own, which are made in the same way.

    Args:
        reference: see plugins.
        settings: their options are filled in where they name this behaviour.
        inputs: what it may ask for; those that are None it may not.

    Raises:
        ConfigurationError: if there is no such behaviour, or its options are wrong.
        PluginError: if it cannot be imported or made.
    """
    plugin = find_plugin(BEHAVIOUR, reference)
    given = settings.options if settings.behaviour == reference else {}
    inputs = replace(inputs, options=options_of(BEHAVIOUR, plugin, given))
    offered = {field.name: getattr(inputs, field.name) for field in fields(inputs)}
    found: Behaviour = construct(
        BEHAVIOUR, plugin, {name: what for name, what in offered.items() if name == "options" or what is not None}
    )
    return found
