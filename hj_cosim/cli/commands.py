"""The command line: one thin command per library function.

The library is imported inside the commands, so that `--help` and mistakes are answered at once.
"""

import logging
import sys
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.markup import escape

from hj_cosim.cli.console import (
    WarningCount,
    bar,
    messages,
    plain_table,
    print_json,
    progress_bars,
    results,
    show_study,
    summary_table,
)
from hj_cosim.errors import ConfigurationError, HjCosimError
from hj_cosim.files import require_writable
from hj_cosim.locations import runs_folder


def _example(*lines: str) -> str:
    return "Example: " + "   or   ".join(f"[bold]{line}[/bold]" for line in lines)


app = typer.Typer(
    name="hj-cosim",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="rich",
    pretty_exceptions_enable=False,
    help="Drive a robot car through SUMO traffic, with one notion of safety for its planner and its controller.",
    epilog=_example("hj-cosim run dense --seed 3", "hj-cosim study --episodes 20"),
)
table_app = typer.Typer(no_args_is_help=True, rich_markup_mode="rich", help="Solve, list, show and check value tables.")
app.add_typer(table_app, name="table")

Scenario = Annotated[str, typer.Argument(help="A name in sumo_net/ or a path to a scenario TOML.")]
Specification = Annotated[str, typer.Argument(help="A name in value_tables/ or a path to a specification TOML.")]
RunFolder = Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a run.")]
Json = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]


@app.command(epilog=_example("hj-cosim run dense --planner op --seed 3 --set planner.expansions=200"))
def run(
    scenario: Scenario = "paper",
    planner: Annotated[str | None, typer.Option(help="hjop, op, idle, or FILE.py:Class of your own.")] = None,
    filter: Annotated[str | None, typer.Option(help="spc, rss, none, or FILE.py:Class of your own.")] = None,
    scheme: Annotated[str | None, typer.Option(help="mi (minimally interventional) or sw (switching).")] = None,
    preset: Annotated[str, typer.Option(help="best or paper.")] = "best",
    seed: Annotated[int | None, typer.Option(help="Seed of the traffic; the scenario's, or 0.")] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds to record; 30 by default.")] = None,
    table: Annotated[str | None, typer.Option(help="A name in value_tables/ or a path to a specification.")] = None,
    assignments: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Any knob.")] = None,
    out: Annotated[Path | None, typer.Option(help="The run's folder; a new one in runs/ by default.")] = None,
    verbose: Annotated[bool, typer.Option("--verbose", help="Print SUMO's warnings instead of counting them.")] = False,
    as_json: Json = False,
) -> None:
    """Drive one episode and write its folder."""
    from hj_cosim.cosim.configuration import resolve_config, stack_flags
    from hj_cosim.cosim.episode import draw_episode, new_run_folder, run_in_sumo, write_episode
    from hj_cosim.reachability.table.store import load_table
    from hj_cosim.recording.run_folder import require_free_folder

    flags = stack_flags(planner=planner, filter=filter, scheme=scheme, duration=duration, table=table, seed=seed)
    config = resolve_config(scenario, preset=preset, flags=flags, assignments=assignments or [])
    folder = out or new_run_folder(config)
    require_free_folder(folder)
    warnings = WarningCount()
    if not verbose:
        logging.getLogger("hj_cosim").addHandler(warnings)
    with progress_bars() as bars:
        solving = bar(bars, f"solving table {config.table}")
        value_table = load_table(config.table, solving, robot=config.robot, announce=messages.print)
        episode = run_in_sumo(config, value_table, bar(bars, f"driving {config.scenario.name}"))
        drawn = bar(bars, "writing and drawing")
        drawn(0, 2)
        write_episode(episode, folder)
        drawn(1, 2)
        draw_episode(folder)
        drawn(2, 2)
    if as_json:
        print_json({**episode.summary, "folder": str(folder)})
    else:
        results.print(summary_table(episode.summary))
        if warnings.count:
            results.print(f"[dim]SUMO warned {warnings.count} times; --verbose shows of what[/dim]")
        results.print(f"Everything is in [bold]{folder}[/bold]")


@app.command(
    epilog=_example(
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
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on with the study in --out, which knows what it was asked for.")
    ] = False,
    out: Annotated[Path | None, typer.Option(help="The study's folder; a new one in runs/ by default.")] = None,
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
    with progress_bars() as bars:
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
            resume=resume,
            out=out,
            progress=bar(bars, "driving episodes"),
            solving=bar(bars, "solving tables"),
        )
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


@app.command(epilog=_example("hj-cosim scenarios", "hj-cosim scenarios --template > mine.toml"))
def scenarios(
    template: Annotated[bool, typer.Option("--template", help="Print a scenario to start one's own from.")] = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of a scenario.")] = False,
    as_json: Json = False,
) -> None:
    """List the scenarios, their roads and densities."""
    from hj_cosim.traffic.sources.catalogue import list_scenarios, scenario_schema, scenario_template

    if template:
        print(scenario_template(), end="")
    elif schema:
        print_json(scenario_schema())
    else:
        _print_rows("scenarios", [asdict(entry) for entry in list_scenarios()], as_json)


@app.command(epilog=_example("hj-cosim export runs/paper-hjop-spc-mi-0 --format csv --out drive.csv"))
def export(
    folder: RunFolder,
    format: Annotated[str, typer.Option(help="csv, parquet or fcd (SUMO's floating car data XML).")] = "csv",
    out: Annotated[Path | None, typer.Option(help="The file to write; in the run's folder by default.")] = None,
    as_json: Json = False,
) -> None:
    """Write a run's trajectories in another format."""
    from hj_cosim.analysis.export import export_run

    _print_files([export_run(folder, format, out)], as_json)


@app.command(epilog=_example("hj-cosim figure value-slice", "hj-cosim figure highway --run runs/paper-hjop-spc-mi-0"))
def figure(
    name: Annotated[str | None, typer.Argument(help="Which; without one, all are listed.")] = None,
    run: Annotated[Path | None, typer.Option(metavar="DIR", help="The run to draw, for figures of a run.")] = None,
    study: Annotated[Path | None, typer.Option(metavar="DIR", help="The study, for figures of a study.")] = None,
    out: Annotated[Path | None, typer.Option(help="A .png, .pdf, .svg or .csv; all but .svg by default.")] = None,
    as_json: Json = False,
) -> None:
    """Draw a figure of the paper, or one beyond it, from our own data."""
    from hj_cosim.analysis.figures.gallery import FIGURES, draw_figure
    from hj_cosim.analysis.figures.style import save_drawing

    if name is None:
        rows = [{"name": key, "drawn_from": kind.source, "shows": kind.description} for key, kind in FIGURES.items()]
        _print_rows("figures", rows, as_json)
        return
    folder = run or study
    target = out or (folder / "figures" if folder else runs_folder() / "figures") / name
    _print_files(save_drawing(draw_figure(name, run=run, study=study), target), as_json)


@app.command(epilog=_example("hj-cosim replay runs/paper-hjop-spc-mi-0", "hj-cosim replay DIR --out drive.mp4"))
def replay(
    folder: RunFolder,
    out: Annotated[Path | None, typer.Option(help="A .gif, or an .mp4 where ffmpeg is installed.")] = None,
    as_json: Json = False,
) -> None:
    """Animate a run: the drive from above, the robot's plan, the cars in the colours of their values."""
    from hj_cosim.analysis.figures.gallery import table_of
    from hj_cosim.analysis.replay import write_replay
    from hj_cosim.recording.run_folder import read_run

    recorded = read_run(folder)
    with progress_bars() as bars:
        written = write_replay(recorded, table_of(recorded), out, bar(bars, "drawing frames"))
    _print_files([written], as_json)


@app.command(epilog=_example("hj-cosim report runs/paper-hjop-spc-mi-0", "hj-cosim report runs/study-paper-0"))
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a run or a study.")],
    out: Annotated[Path | None, typer.Option(help="The HTML file; report.html in the folder by default.")] = None,
    as_json: Json = False,
) -> None:
    """Write one self-contained HTML page about a run, with an interactive replay, or about a study."""
    from hj_cosim.analysis.report import write_report
    from hj_cosim.recording.study_files import STUDY, study_progress

    with progress_bars() as bars:
        written = write_report(folder, out, progress=bar(bars, "drawing figures"))
    _print_files([written], as_json)
    if (folder / STUDY).is_file() and (progress := study_progress(folder)).is_unfinished:
        messages.print(
            f"unfinished: {progress.text}; hj-cosim study --resume --out {folder} goes on with it",
            highlight=False,
            soft_wrap=True,
            markup=False,
        )


def _print_rows(title: str, rows: list[dict[str, Any]], as_json: bool) -> None:
    if as_json:
        print_json(rows)
    else:
        results.print(plain_table(title, list(rows[0]), [list(row.values()) for row in rows]))


def _print_files(paths: list[Path], as_json: bool) -> None:
    if as_json:
        print_json([{"file": str(path), "bytes": path.stat().st_size} for path in paths])
    else:
        for path in paths:
            results.print(f"wrote [bold]{path}[/bold] ({path.stat().st_size / 1e6:.2f} MB)")


@table_app.command("solve", epilog=_example("hj-cosim table solve highway --scheme first_order --out quick.npz"))
def table_solve(
    specification: Specification,
    shape: Annotated[list[int] | None, typer.Option(help="Nodes of an axis; once for each axis.")] = None,
    scheme: Annotated[str | None, typer.Option(help="first_order, eno2, weno3 or weno5.")] = None,
    out: Annotated[Path | None, typer.Option(help="The .npz to write; beside the others by default.")] = None,
    as_json: Json = False,
) -> None:
    """Solve a value table and write it."""
    from hj_cosim.reachability.table.catalogue import changed_specification
    from hj_cosim.reachability.table.store import find_specification, save_table, solve_table, table_path

    path = find_specification(specification)
    if out is None and (shape or scheme):
        raise ConfigurationError(f"--shape and --scheme make another table than {path} says: name its file with --out")
    changed = changed_specification(path, shape=shape, scheme=scheme)
    target = out or table_path(path)
    require_writable(target)
    with progress_bars() as bars:
        table = solve_table(changed, bar(bars, f"solving table {path.stem}"))
    save_table(table, target)
    _show_report(table, target, as_json)


def _show_report(table: Any, path: Path, as_json: bool) -> None:
    report = {**asdict(table.report), "file": str(path)}
    if as_json:
        print_json(report)
    else:
        results.print(plain_table(f"value table {path.stem}", ("what", "value"), list(report.items())))


@table_app.command("list", epilog=_example("hj-cosim table list"))
def table_list(as_json: Json = False) -> None:
    """List the specifications, and which of them are solved."""
    from hj_cosim.reachability.table.catalogue import table_overview

    _print_rows("value tables", [asdict(row) for row in table_overview()], as_json)


@table_app.command("show", epilog=_example("hj-cosim table show highway --out slices.png"))
def table_show(
    specification: Specification,
    over: Annotated[str, typer.Option(metavar="NAME,NAME", help="Two state variables; the first by default.")] = "",
    hold: Annotated[
        list[str] | None, typer.Option(metavar="NAME=VALUE", help="Where another is held; mid-grid by default.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="Where to draw it; runs/figures/<name>-slices by default.")] = None,
    as_json: Json = False,
) -> None:
    """Print how a table was solved, and draw a slice of it, of the highway game the paper's."""
    from hj_cosim.analysis.figures.style import save_drawing
    from hj_cosim.analysis.figures.value_slice import value_slice
    from hj_cosim.reachability.table.slices import parse_held
    from hj_cosim.reachability.table.store import find_specification, load_table, table_path

    path = find_specification(specification)
    held = parse_held(hold or ())
    with progress_bars() as bars:
        table = load_table(specification, bar(bars, f"solving table {path.stem}"))
    drawing = value_slice(table, held, over=[name.strip() for name in over.split(",")] if over else ())
    _show_report(table, table_path(path), as_json)
    written = save_drawing(drawing, out or runs_folder() / "figures" / f"{path.stem}-slices")
    if not as_json:
        _print_files(written, as_json)


@table_app.command("check", epilog=_example("hj-cosim table check highway --rollouts 100000"))
def table_check(
    specification: Specification,
    rollouts: Annotated[int, typer.Option(min=1, help="Games played against the worst other car.")] = 10_000,
    seconds: Annotated[float, typer.Option(min=0, help="What solving the finer tables may take.")] = 300.0,
    as_json: Json = False,
) -> None:
    """Measure how good a table is: converged, near finer ones, and keeping its promise in closed loop."""
    from hj_cosim.cli.quality import quality_tables
    from hj_cosim.reachability.table.store import load_table
    from hj_cosim.settings import FilterSettings
    from hj_cosim.verification.guarantee import RolloutSettings, measure_guarantee
    from hj_cosim.verification.table_quality import check_table

    with progress_bars() as bars:
        table = load_table(specification, bar(bars, f"solving table {specification}"))
        quality = check_table(table, rollouts=rollouts, seconds=seconds, progress=bar(bars, "solving finer tables"))
    found: dict[str, Any] = {"table": asdict(quality)}
    if table.game.manoeuvres is not None:  # the filter is played out in the highway game alone
        games = {
            "game": (RolloutSettings(rollouts=rollouts), FilterSettings(keep_escape=True)),
            "bicycle": (RolloutSettings(rollouts=rollouts, model="bicycle"), FilterSettings(keep_escape=True)),
            "game, SPC alone": (RolloutSettings(rollouts=rollouts), FilterSettings(keep_escape=False)),
        }
        with progress_bars() as bars:
            for name, (settings, spc) in games.items():
                guarantee = measure_guarantee(table, settings, spc, progress=bar(bars, f"playing: {name}"))
                found[f"filter, {name}"] = {**asdict(guarantee), "entered_percent": guarantee.entered_percent}
    if as_json:
        print_json(found)
    else:
        for table_to_print in quality_tables(specification, found):
            results.print(table_to_print)


_TYPER_INTERRUPTED = 130  # the status with which Typer answers Ctrl-C, without a word


def main() -> None:
    """Run the command line; what a user got wrong ends in one sentence and exit status 2, and so does Ctrl-C."""
    try:
        app()
    except HjCosimError as error:
        messages.print(f"[bold red]error:[/bold red] {escape(str(error))}", highlight=False, soft_wrap=True)
        sys.exit(2)
    except OSError as error:  # what nobody named on the way, such as a disk that is full while kernels are compiled
        place = f" {error.filename}" if error.filename else ""
        reason = f"the system refuses{place}: {error.strerror or error}; free some space or mend the permissions"
        messages.print(f"[bold red]error:[/bold red] {escape(reason)}", highlight=False, soft_wrap=True)
        sys.exit(2)
    except SystemExit as stopped:
        if stopped.code == _TYPER_INTERRUPTED:
            messages.print("interrupted; nothing half-written was left, and a study goes on with --resume")
            sys.exit(2)
        raise
