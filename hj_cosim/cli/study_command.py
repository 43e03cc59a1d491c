"""The command that drives many episodes."""

from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import typer

from hj_cosim.cli.app import Json, Watch, app, example
from hj_cosim.cli.console import bar, messages, print_json, progress_bars
from hj_cosim.cli.study_table import show_study
from hj_cosim.cli.watched import watched_study
from hj_cosim.errors import ConfigurationError


# Fifteen parameters: each is an option of the command line.
@app.command(
    epilog=example(
        "hj-cosim study --episodes 20",
        "hj-cosim study --vary planner.gamma_r=0.8,0.9,1.0",
        "hj-cosim study --resume --out runs/study-paper-0",
    )
)
def study(
    scenario: Annotated[
        str | None, typer.Argument(help="Names or paths as for run, separated by commas; paper.")
    ] = None,
    scenario_list: Annotated[str | None, typer.Option("--scenario", help="The same as an option.")] = None,
    episodes: Annotated[int | None, typer.Option(help="Episodes a row of the table; 20.")] = None,
    seed: Annotated[
        int | None, typer.Option(help="The first of as many consecutive seeds, the same for every row; 0.")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="best or paper; best.")] = None,
    stack: Annotated[
        list[str] | None,
        typer.Option(help="Rows, for example hjop-spc-mi or mine.py:KeepRight/spc-mi; the paper's ten."),
    ] = None,
    vary: Annotated[list[str] | None, typer.Option(metavar="KEY=V,V", help="Sweep a knob; repeatable.")] = None,
    assignments: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Any knob.")] = None,
    workers: Annotated[int | None, typer.Option(help="Processes; as many as there are cores.")] = None,
    scheduler: Annotated[str | None, typer.Option(help="A Dask scheduler, tcp://HOST:PORT.")] = None,
    keep: Annotated[
        Literal["all", "robot"] | None, typer.Option(help="all, or robot: no trajectories of cars; all.")
    ] = None,
    traffic: Annotated[
        str | None,
        typer.Option(help="Of a .sumocfg: who drives the others, theirs (their own drivers) or idm-mobil."),
    ] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the study in --out, which knows what it was asked for.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="The study's folder; a new one in runs/ by default.")] = None,
    watch: Watch = False,
    as_json: Json = False,
) -> None:
    """Drive many episodes of many stacks on the same seeds, and tabulate them beside the paper's numbers.

    The exit status is 1 if episodes failed and so are missing.
    """
    from hj_cosim.study.study import run_study

    if scenario is not None and scenario_list is not None:
        raise ConfigurationError(
            f"scenario {scenario} is given, and --scenario {scenario_list} too; give all in one place,"
            f" for example {scenario},{scenario_list}"
        )
    scenarios = scenario_list if scenario is None else scenario
    with progress_bars() as bars, watched_study() if watch else nullcontext() as watching:
        done = run_study(
            None if scenarios is None else scenarios.split(","),
            episodes=episodes,
            seed=seed,
            preset=preset,
            stacks=stack or None,
            vary=vary or None,
            settings=assignments or None,
            workers=workers,
            scheduler=scheduler,
            keep=keep,
            traffic=traffic,
            resume=resume,
            out=out,
            progress=bar(bars, "driving episodes"),
            solving=bar(bars, "solving tables"),
            watch=watching,
        )
        if watching is not None:
            watching.end(f"the study is over; it is in {done.folder}")
    if as_json:
        failures = [asdict(failure) for failure in done.failures]
        found = {"folder": str(done.folder), "rows": done.table.to_dict("records"), "missing": done.missing}
        print_json({**found, "failures": failures})
    else:
        show_study(done)
    if done.missing:
        total = done.missing + int(done.table["episodes"].sum())
        messages.print(
            f"{done.missing} of {total} episodes are missing; hj-cosim study --resume --out {done.folder} drives them",
            highlight=False,
            soft_wrap=True,
            markup=False,
        )
        raise typer.Exit(1)
