"""The command that drives many episodes."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from hj_cosim.cli.app import Json, app, example
from hj_cosim.cli.console import bar, print_json, progress_bars
from hj_cosim.cli.study_table import show_study


@app.command(epilog=example("hj-cosim study --episodes 20", "hj-cosim study --vary planner.gamma_r=0.8,0.9,1.0"))
def study(
    scenario: Annotated[str, typer.Argument(help="Names or paths as for run, separated by commas.")] = "paper",
    scenario_list: Annotated[str | None, typer.Option("--scenario", help="The same as an option.")] = None,
    episodes: Annotated[int, typer.Option(help="Episodes a row of the table.")] = 20,
    seed: Annotated[int, typer.Option(help="The first of as many consecutive seeds, the same for every row.")] = 0,
    preset: Annotated[str, typer.Option(help="best or paper.")] = "best",
    stack: Annotated[list[str] | None, typer.Option(help="Rows, for example hjop-spc-mi; the paper's ten.")] = None,
    vary: Annotated[list[str] | None, typer.Option(metavar="KEY=V,V", help="Sweep a knob; repeatable.")] = None,
    assignments: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Any knob.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; as many as there are cores.")] = None,
    scheduler: Annotated[str | None, typer.Option(help="A Dask scheduler, tcp://HOST:PORT.")] = None,
    keep: Annotated[Literal["all", "robot"], typer.Option(help="robot: no trajectories of cars.")] = "all",
    resume: Annotated[bool, typer.Option("--resume", help="Go on with the study in --out.")] = False,
    out: Annotated[Path | None, typer.Option(help="The study's folder; a new one in runs/ by default.")] = None,
    as_json: Json = False,
) -> None:
    """Drive many episodes of many stacks on the same seeds, and tabulate them beside the paper's numbers."""
    from hj_cosim.study.stacks import PAPER_STACKS, parse_stack
    from hj_cosim.study.study import run_study

    with progress_bars() as bars:
        done = run_study(
            (scenario_list or scenario).split(","),
            episodes=episodes,
            seed=seed,
            preset=preset,
            stacks=[parse_stack(name) for name in stack] if stack else PAPER_STACKS,
            vary=vary or (),
            assignments=assignments or (),
            workers=workers,
            scheduler=scheduler,
            keep=keep,
            resume=resume,
            folder=out,
            progress=bar(bars, "driving episodes"),
            solving=bar(bars, "solving tables"),
        )
    if as_json:
        failures = [asdict(failure) for failure in done.failures]
        print_json({"folder": str(done.folder), "rows": done.table.to_dict("records"), "failures": failures})
    else:
        show_study(done)
