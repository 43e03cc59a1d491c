"""Finding, reading and explaining scenarios: the TOML files of sumo_net/ and users' own."""

from pathlib import Path
from typing import Any

from hj_cosim.errors import ConfigurationError, NetworkError
from hj_cosim.locations import find_toml, given_path, names_in, scenarios_folder
from hj_cosim.settings import NetworkSettings, Scenario, read_toml, shown, validate
from hj_cosim.traffic.sources.own_configuration import own_seed

SUMO_CONFIGURATION = ".sumocfg"


def scenario_path(name_or_path: str) -> Path:
    """Return the TOML file that a scenario's name or path means, or the .sumocfg.

    Raises:
        ConfigurationError: if there is none.
    """
    if is_own_simulation(name_or_path):
        path = given_path(name_or_path, "scenario").expanduser()
        if not path.is_file():
            raise ConfigurationError(f"the simulation {shown(repr(str(name_or_path)))} does not exist; give a .sumocfg")
        return path.resolve()
    if str(name_or_path).endswith((".net.xml", ".net.xml.gz")):
        raise ConfigurationError(
            f"{shown(repr(str(name_or_path)))} is a network without traffic; give a .sumocfg, or a scenario that"
            " names it under [network], which hj-cosim scenarios --template begins"
        )
    return find_toml(str(name_or_path), scenarios_folder(), "scenario")


def own_path(file: str, scenario_folder: Path | None = None) -> Path:
    """Return the whole path of a user's own simulation, which a scenario may have beside it.

    Raises:
        ConfigurationError: if there is no such file.
    """
    path = _existing_file(scenario_folder or Path(), file)
    if path is None:
        raise ConfigurationError(f"scenario.own.file = {shown(repr(file))}: there is no such .sumocfg")
    return path


def is_own_simulation(name_or_path: str) -> bool:
    """Return whether a scenario is a user's own SUMO configuration."""
    return str(name_or_path).endswith(SUMO_CONFIGURATION)


def scenario_data(name_or_path: str) -> dict[str, Any]:
    """Return what a scenario's file states, unchecked, with its name; presets lie below it, `--set` above.

    Raises:
        ConfigurationError: if there is no such file or it is not TOML.
    """
    path = scenario_path(name_or_path)
    if is_own_simulation(name_or_path):
        return {"name": path.stem, "seed": own_seed(path), "own": {"file": str(path)}}
    return {"name": path.stem, **read_toml(path)}


def load_scenario(name_or_path: str) -> Scenario:
    """Return a scenario by its name in sumo_net/ or by the path of its TOML file, SI units throughout.

    Raises:
        ConfigurationError: if there is no such file, it is not TOML, or a key or value in it is wrong.
    """
    return validate(Scenario, scenario_data(name_or_path), str(scenario_path(name_or_path)))


def network_path(network: NetworkSettings, scenario_folder: Path | None = None) -> Path:
    """Return the network's file: an absolute path, beside the scenario, or in sumo_net/, in this order.

    Raises:
        NetworkError: if there is no such file.
    """
    folders = [scenario_folder] if scenario_folder is not None else []
    for folder in [*folders, scenarios_folder()]:
        path = _existing_file(folder, network.file)
        if path is not None:
            return path
    looked = " or ".join(str(folder) for folder in [*folders, scenarios_folder()])
    name = shown(repr(network.file))
    raise NetworkError(f"the network {name} is not in {looked}; set network.file to a .net.xml that exists")


def _existing_file(folder: Path, name: str) -> Path | None:
    try:
        path = (folder / Path(name).expanduser()).resolve()
        return path if path.is_file() else None
    except (OSError, ValueError, RuntimeError):  # a name too long, with NUL in it, of a user whom nobody knows
        return None


def scenario_names() -> list[str]:
    """Return the names of the scenarios in sumo_net/."""
    return names_in(scenarios_folder())
