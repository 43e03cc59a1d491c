"""What a study's episodes depend on besides their configurations: versions, tables, and a user's own files."""

from collections.abc import Mapping, Sequence
from importlib.metadata import version

from hj_cosim import __version__
from hj_cosim.control.belief.believing_filter import WORST_TABLE
from hj_cosim.cosim.plugin_versions import plugin_versions
from hj_cosim.reachability.table.store import KeptTable
from hj_cosim.study.design import StudyDesign


def program_of(
    design: StudyDesign, tables: Mapping[str, Sequence[KeptTable]], against_suspects: Sequence[KeptTable]
) -> dict[str, str]:
    """Return the version of everything that an episode depends on besides its configuration.

    Args:
        design: of the study.
        tables: the value tables of each `table_key` of its configurations.
        against_suspects: the tables against the worst, of filters that have beliefs.

    Raises:
        ConfigurationError, PluginError: if a planner, filter or behaviour cannot be found.
    """
    program = {"hj-cosim": __version__, "libsumo": version("libsumo")}
    if against_suspects:
        program[f"table {WORST_TABLE} of suspects"] = " ".join(sorted(one.identity for one in against_suspects))
    program |= {f"table {name}": " ".join(one.identity for one in kept) for name, kept in tables.items()}
    for cell in design.cells:
        program |= plugin_versions(cell.config)
    return program
