"""What an episode runs with, resolved: defaults < preset < scenario file < flags < --set."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import tomli_w

from hj_cosim.cosim.motion import require_bends
from hj_cosim.cosim.repetition import is_run_configuration, require_nothing_foreign
from hj_cosim.errors import ConfigurationError, NetworkError
from hj_cosim.locations import scenarios_folder, whole_name
from hj_cosim.plugins import FILTER, PLANNER, PluginKind, find_plugin, options_of, whole_reference
from hj_cosim.settings import (
    MIXED,
    PRESETS,
    DriverSettings,
    EpisodeConfig,
    Scenario,
    SimulationSettings,
    assignment_texts,
    overlay,
    parse_assignment,
    shown,
    validate,
)
from hj_cosim.traffic.net_graph import read_graph, shortest_route
from hj_cosim.traffic.rogues.catalogue import BEHAVIOUR
from hj_cosim.traffic.route import read_network
from hj_cosim.traffic.sources.placement import initial_traffic
from hj_cosim.traffic.sources.scenarios import network_path, own_path, scenario_data, scenario_path

UNNAMED = "unnamed"  # what a scenario is called that was given as a mapping without a name


def resolve_config(
    scenario: str | Path | Scenario | Mapping[str, Any] = "paper",
    *,
    preset: str | None = None,
    flags: Mapping[str, Any] | None = None,
    assignments: Sequence[str] | Mapping[str, Any] = (),
    varied: Sequence[str] = (),
) -> EpisodeConfig:
    """Return the configuration of one episode.

    Args:
        scenario: a name in sumo_net/, a path to a scenario TOML, a Scenario, or a mapping such as a TOML's content; of
            a Scenario, what was left to its default is the preset's. A path to a run's config.toml is that run's whole
            configuration.
        preset: `best`, which it is unless given, or `paper`; a layer that names one (`--set preset=paper`) wins over
            it. A run's config.toml has its own.
        flags: nested values, as the command line's options give them; they win over the scenario.
        assignments: texts `KEY=VALUE`, as `--set` takes them, or a mapping; they win over everything, the last over the
            first.
        varied: texts `KEY=VALUE`, each a value of one of a study's `--vary`; they win over the assignments.

    Raises:
        ConfigurationError: if anything is unknown, of the wrong type, or out of range.
        PluginError: if a planner or a filter of one's own cannot be imported.
        NetworkError, ScenarioError: if the road cannot be used, or the cars do not fit on it.
    """
    if preset is not None and (not isinstance(preset, str) or preset not in PRESETS):
        raise ConfigurationError(f"no preset is called {shown(repr(preset))}; choose one of {', '.join(PRESETS)}")
    layers = [("the options", flags or {})]
    layers += [(f"--set {shown(text)}", parse_assignment(text)) for text in assignment_texts(assignments)]
    layers += [(f"--vary {shown(text)}", parse_assignment(text, "--vary")) for text in varied]
    for _, layer in layers:
        named = layer.get("preset")
        if isinstance(named, str) and named in PRESETS:  # any other value is refused below, with its layer's name
            preset = named
    source, given, folder = _given_scenario(scenario)
    if is_run_configuration(given):
        data = _repeated(given, preset, layers, Path(source))
        config = validate(EpisodeConfig, data, source)
    else:
        data = _lowest_layers(given, preset or "best")
        config = validate(EpisodeConfig, data, source, table="scenario")
    data = overlay(data, {"scenario": {"network": {"file": _network_file(config, folder)}}})
    if config.scenario.own.is_given:
        data = overlay(data, {"scenario": {"own": {"file": str(own_path(config.scenario.own.file, folder))}}})
    config = _with_layers(data, layers)
    config = _with_plugins(config).model_copy(update={"table": whole_name(config.table, "table =")})
    _require_room(config)
    return config


def _lowest_layers(scenario: Mapping[str, Any], preset: str) -> dict[str, Any]:
    """Return what a preset and a scenario state, unchecked."""
    # The drivers' defaults are laid out in full, so that a layer may name a distribution's deviation alone.
    data: dict[str, Any] = {"preset": preset, "scenario": {"drivers": DriverSettings().model_dump()}}
    return overlay(overlay(data, PRESETS[preset]), {"scenario": scenario})


def _repeated(
    recorded: Mapping[str, Any], preset: str | None, layers: Sequence[tuple[str, Mapping[str, Any]]], path: Path
) -> dict[str, Any]:
    """Return what a run's config.toml states, unchecked.

    Raises:
        ConfigurationError: if another preset is asked for than it was driven with, or it names what the user does not.
    """
    if preset not in (None, recorded["preset"]):
        raise ConfigurationError(
            f"{path} has preset = {shown(repr(recorded['preset']))}, and every setting as it was then; leave --preset"
            " out, or run its scenario by name"
        )
    given: dict[str, Any] = {}
    for _, layer in layers:
        given = overlay(given, layer)
    require_nothing_foreign(recorded, given, path)
    return {key: value for key, value in recorded.items() if key != "name"}


def _with_layers(data: Mapping[str, Any], layers: Sequence[tuple[str, Mapping[str, Any]]]) -> EpisodeConfig:
    """Return the configuration with layers laid over it, which have to make sense together.

    Raises:
        ConfigurationError: if they do not; it names the first layer that makes none with those below it.
    """
    whole = dict(data)
    for _, layer in layers:
        whole = overlay(whole, layer)
    try:
        return validate(EpisodeConfig, whole, "the settings")
    except ConfigurationError:
        below = dict(data)
        for source, layer in layers:
            below = overlay(below, layer)
            validate(EpisodeConfig, below, source)
        raise


def _with_plugins(config: EpisodeConfig) -> EpisodeConfig:
    """Return the configuration with whole references to planner, filter and behaviours, and their options in full.

    Raises:
        ConfigurationError, PluginError: if there is none such, or its options are wrong.
    """
    changed: dict[str, Any] = {}
    for kind, settings in ((PLANNER, config.planner), (FILTER, config.filter)):
        reference = whole_reference(kind, settings.kind)
        options = options_of(kind, find_plugin(kind, reference), settings.options)
        full = {} if options is None else options.model_dump(mode="json", exclude_none=True)
        changed[kind.noun] = settings.model_copy(update={"kind": reference, "options": full})
    changed["simulation"] = _with_planners_period(config, changed["planner"].kind)
    return config.model_copy(update=changed | {"scenario": _with_behaviours(config.scenario)})


def _with_planners_period(config: EpisodeConfig, planner: str) -> SimulationSettings:
    """Return the clocks with the planner's own period, where it brings one and no layer says another."""
    simulation = config.simulation
    own = getattr(find_plugin(PLANNER, planner), "plan_period", None)
    if own is None or "plan_period" in simulation.model_fields_set:
        return simulation
    return validate(SimulationSettings, {**simulation.model_dump(), "plan_period": own}, f"{planner}: its plan_period")


def _with_behaviours(scenario: Scenario) -> Scenario:
    """Return a scenario with whole references to its rogues' behaviours, and their options in full.

    Raises:
        ConfigurationError, PluginError: if there is no such behaviour, or its options are wrong.
    """

    def whole(reference: str, kind: PluginKind = BEHAVIOUR) -> str:
        if reference != MIXED:
            reference = whole_reference(kind, reference)
            find_plugin(kind, reference)
        return reference

    rogues = scenario.rogues
    changed: dict[str, Any] = {"behaviour": whole(rogues.behaviour)}
    if rogues.behaviour != MIXED:
        options = options_of(BEHAVIOUR, find_plugin(BEHAVIOUR, changed["behaviour"]), rogues.options)
        changed["options"] = {} if options is None else options.model_dump(mode="json", exclude_none=True)
    by_hand = replace(BEHAVIOUR, setting="rogue of [[scenario.cars]]")
    cars = tuple(car.model_copy(update={"rogue": car.rogue and whole(car.rogue, by_hand)}) for car in scenario.cars)
    return scenario.model_copy(update={"rogues": rogues.model_copy(update=changed), "cars": cars})


def _require_room(config: EpisodeConfig) -> None:
    """Check the road and that the cars fit on it now, rather than after a value table has been solved.

    Raises:
        NetworkError, ScenarioError: as the world would, which builds the same.
    """
    if config.scenario.own.is_given:
        own_path(config.scenario.own.file)
        return  # what drives there is found when it runs
    network = config.scenario.network
    path = network_path(network)
    road, _ = read_network(path, network)
    require_bends(road, config.robot, str(path))
    initial_traffic(config.scenario, road, config.robot, config.seed)
    for number, stream in enumerate(config.scenario.streams):
        try:
            shortest_route(read_graph(path), stream.from_edge, stream.to_edge)
        except NetworkError as error:
            raise NetworkError(f"scenario.streams, number {number + 1}: {error}") from error


def stack_flags(
    *,
    planner: str | None = None,
    filter: str | None = None,
    scheme: str | None = None,
    duration: float | None = None,
    table: str | None = None,
    seed: int | None = None,
) -> dict[str, Any]:
    """Return the command line's options that were given (not None) as nested configuration."""
    nested: dict[str, dict[str, Any]] = {
        "planner": {"kind": planner},
        "filter": {"kind": filter, "scheme": scheme},
        "simulation": {"duration": duration},
    }
    given: dict[str, Any] = {
        section: {key: value for key, value in keys.items() if value is not None} for section, keys in nested.items()
    }
    top = {"table": table, "seed": seed}
    return given | {key: value for key, value in top.items() if value is not None}


def _given_scenario(scenario: str | Path | Scenario | Mapping[str, Any]) -> tuple[str, dict[str, Any], Path | None]:
    """Return how a scenario is called in messages, what it states, and the folder of its file, if it has one.

    Raises:
        ConfigurationError: if it is none, or there is no such file, or it is not TOML.
    """
    if isinstance(scenario, Scenario):
        return f"the Scenario {shown(repr(scenario.name))}", scenario.model_dump(exclude_unset=True), None
    if isinstance(scenario, Mapping):
        return "the scenario", {"name": UNNAMED, **scenario}, None
    if not isinstance(scenario, str | Path):
        raise ConfigurationError(
            "a scenario is a name in sumo_net/, a path to a TOML file, a Scenario or a dict of its settings, not a"
            f" {type(scenario).__name__}"
        )
    path = scenario_path(str(scenario))
    return str(path), scenario_data(str(scenario)), path.parent


def _network_file(config: EpisodeConfig, folder: Path | None) -> str:
    """Return the network as sumo_net/ names it, or the whole path of one that lies beside a user's own scenario."""
    network = config.scenario.network
    path = network_path(network, folder)
    return network.file if path.parent == scenarios_folder() else str(path)


def config_toml(config: EpisodeConfig) -> str:
    """Return the configuration as the text of a run folder's config.toml."""
    return tomli_w.dumps(config.model_dump(mode="json", exclude_none=True))
