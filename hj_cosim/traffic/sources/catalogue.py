"""Showing scenarios: the list of those that exist, and a template and a schema to write one's own from."""

import json
from dataclasses import dataclass
from typing import Any

from pydantic.fields import FieldInfo

from hj_cosim.settings import (
    DriverSettings,
    NetworkSettings,
    NormalDistribution,
    RobotStart,
    Scenario,
    Settings,
    TrafficSettings,
    explanation,
)
from hj_cosim.traffic.chain import read_lane_count
from hj_cosim.traffic.sources.density import density, stream_speed
from hj_cosim.traffic.sources.scenarios import load_scenario, network_path, scenario_names, scenario_path

# The tables of a scenario's TOML, in the order of the template.
_TABLES: dict[str, type[Settings]] = {
    "network": NetworkSettings,
    "traffic": TrafficSettings,
    "drivers": DriverSettings,
    "robot": RobotStart,
}


# Of keys without a default, what stands in the template.
_EXAMPLES = {"route": ["e0", "e1"], "from_edge": "e0", "to_edge": "e1"}


@dataclass(frozen=True)
class ScenarioEntry:
    """A row of the list of scenarios."""

    name: str
    lanes: int
    cars_ahead: int
    cars_behind: int
    density: float  # cars per km and lane; 0 where all cars are placed by hand
    stream_speed: float  # m/s, what a mean driver keeps at that density
    description: str


def list_scenarios() -> list[ScenarioEntry]:
    """Return the scenarios of sumo_net/, from the emptiest road to the fullest.

    Raises:
        ConfigurationError, NetworkError: if one of them is broken.
    """
    return sorted((_entry(name) for name in scenario_names()), key=lambda entry: (entry.density, entry.name))


def _entry(name: str) -> ScenarioEntry:
    scenario = load_scenario(name)
    lanes = read_lane_count(network_path(scenario.network, scenario_path(name).parent), scenario.network)
    drawn = not scenario.is_hand_made
    return ScenarioEntry(
        name=name,
        lanes=lanes,
        cars_ahead=scenario.traffic.count + sum(car.x > 0.0 for car in scenario.cars),
        cars_behind=scenario.traffic.count_behind + sum(car.x <= 0.0 for car in scenario.cars),
        density=round(density(scenario.traffic, lanes), 2) if drawn else 0.0,
        stream_speed=round(stream_speed(scenario, lanes), 2) if drawn else 0.0,
        description=scenario.description,
    )


def scenario_schema() -> dict[str, Any]:
    """Return the JSON schema of a scenario's TOML file; its name is optional there."""
    schema = Scenario.model_json_schema()
    schema["required"] = [key for key in schema.get("required", []) if key != "name"]
    return schema


def scenario_template() -> str:
    """Return a scenario as commented TOML that states every key at its default."""
    lines = [
        "# A scenario: the road, the traffic, its drivers, and where the robot starts. Every key may be left out.",
        "# SI units; lanes count from 0 at the right. Run it with `hj-cosim run mine.toml`.",
        'description = "my scenario"',
        f"seed = 0  # {Scenario.model_fields['seed'].description}",
    ]
    for table, settings in _TABLES.items():
        lines += ["", f"[{table}]  # {_summary(settings)}"]
        lines += [_line(name, field) for name, field in settings.model_fields.items()]
    lines += [
        "",
        "# Kinds of vehicles beside cars of 5 x 2 m: repeat the tables. What is left out of their drivers is as above.",
        "# [[vehicles]]",
        "# share = 0.15  # of the drawn vehicles",
        "# length = 16.5  # m",
        "# width = 2.5  # m",
        "# [vehicles.drivers]",
        "# desired_speed = { mean = 22.0, deviation = 0.8 }",
        "",
        "# Cars that come during the drive, where the road is a route: repeat the table.",
        "# [[streams]]",
        '# from_edge = "e0"',
        '# to_edge = "e1"',
        "# flow = 900.0  # cars/h",
        "",
        "# Cars at places of your own, beside the drawn ones: repeat the table. With traffic.count = 0 and",
        "# traffic.count_behind = 0 there are only these, and nothing settles before the robot takes over.",
        "# [[cars]]",
        "# lane = 2",
        "# x = 40.0  # m ahead of the robot, from centre to centre; negative behind it",
        "# speed = 22.0",
        "# desired_speed = 22.0  # drawn like any driver's when left out",
        "# length = 5.0",
        "# width = 2.0",
    ]
    return "\n".join(lines) + "\n"


def _line(name: str, field: FieldInfo) -> str:
    value = field.default
    comment = f"  # {explanation(field)}"
    if value is None:  # TOML has no null: shown, but commented out
        return f"# {name} = {json.dumps(_EXAMPLES.get(name, 13.5))}{comment}"
    if isinstance(value, NormalDistribution):
        parts = ", ".join(f"{key} = {number}" for key, number in value.model_dump().items())
        return f"{name} = {{ {parts} }}{comment}"
    text = f'"{value}"' if isinstance(value, str) else str(value).lower()  # TOML writes true and false small
    return f"{name} = {text}{comment}"


def _summary(settings: type[Settings]) -> str:
    first = (settings.__doc__ or "").strip().splitlines()[0]
    return first.rstrip(".")
