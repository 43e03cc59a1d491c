"""The application that the commands belong to, and the arguments that several of them share."""

from pathlib import Path
from typing import Annotated

import typer

from hj_cosim import __version__
from hj_cosim.cli.console import answers_alone, results

CONTEXT = {"help_option_names": ["-h", "--help"]}


def example(*lines: str) -> str:
    """Return the line below a command's help that shows how it is used."""
    return "Example: " + "   or   ".join(f"[bold]{line}[/bold]" for line in lines)


app = typer.Typer(
    name="hj-cosim",
    no_args_is_help=True,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    context_settings=CONTEXT,
    help="Drive a robot car through SUMO traffic, with one notion of safety for its planner and its controller.",
    epilog=example("hj-cosim run dense --seed 3", "hj-cosim study --episodes 20"),
)
table_app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode="rich",
    context_settings=CONTEXT,
    help="Solve, list, show and check value tables.",
)
app.add_typer(table_app, name="table")

Scenario = Annotated[
    str,
    typer.Argument(help="A name in sumo_net/, or the path of a scenario TOML, a .sumocfg or a run's config.toml."),
]
Specification = Annotated[str, typer.Argument(help="A name in value_tables/ or a path to a specification TOML.")]
RunFolder = Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a run.")]
Watch = Annotated[bool, typer.Option("--watch", help="Show it as it happens, in a page of this machine's browser.")]


def _alone(context: typer.Context, asked: bool) -> bool:
    if asked:
        context.with_resource(answers_alone())
    return asked


Json = Annotated[bool, typer.Option("--json", callback=_alone, help="Print the result as JSON.")]


def _print_version(asked: bool) -> None:
    if asked:
        results.print(f"hj-cosim {__version__}", highlight=False)
        raise typer.Exit


@app.callback()
def options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version.")
    ] = False,
) -> None:
    """Take the options of the program itself; its help is the application's."""
