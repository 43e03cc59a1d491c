"""The value table that a run was driven with."""

from hj_cosim.errors import TableError
from hj_cosim.reachability.table.size_classes import classes_met
from hj_cosim.reachability.table.sized import load_tables
from hj_cosim.reachability.table.store import find_specification
from hj_cosim.reachability.table.table import ValueTable
from hj_cosim.recording.run_folder import CONFIG, Run
from hj_cosim.settings import RobotSettings, read_toml, validate


def table_of(run: Run) -> ValueTable:
    """Return the value table that a run was driven with, solved first if it is not there.

    Raises:
        TableError, ConfigurationError: if it cannot be had, or its game is a Python file: a run's folder may come from
            anybody, and what it names is not run.
    """
    name = str(run.config["table"])
    path = find_specification(name)
    robot = validate(RobotSettings, run.config["robot"], f"{run.folder / CONFIG}: robot")
    traffic = run.record.traffic
    sizes = classes_met(set(zip(traffic.length.tolist(), traffic.width.tolist(), strict=True)))
    if path.suffix == ".npz":  # read, it runs nothing
        return load_tables(name, sizes, robot=robot)
    dynamics = str(read_toml(path).get("dynamics", ""))
    if dynamics.endswith(".py"):
        raise TableError(
            f"{run.folder} was driven with {name}, whose game is the Python file {dynamics}, which is not run because a"
            " run's folder says so; load_table it in Python and give it to write_report or draw_figure"
        )
    return load_tables(name, sizes, robot=robot)
