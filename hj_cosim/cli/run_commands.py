"""Commands that drive an episode, or make something of one that was driven."""

import logging
from contextlib import nullcontext
from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from hj_cosim.cli.app import Json, RunFolder, Scenario, Watch, app, example
from hj_cosim.cli.console import (
    WarningCount,
    bar,
    messages,
    print_json,
    progress_bars,
    results,
    say,
    show_files,
    show_place,
    show_repetition,
    show_rows,
    summary_table,
)
from hj_cosim.cli.watched import watched_drive
from hj_cosim.locations import runs_folder


# Eighteen parameters: each is an option of the command line.
@app.command(
    epilog=example(
        "hj-cosim run dense --planner op --seed 3 --set planner.expansions=200",
        "hj-cosim run runs/paper-hjop-spc-mi-0/config.toml",
    )
)
def run(
    scenario: Scenario = "paper",
    planner: Annotated[str | None, typer.Option(help="hjop, op, mppi, idle, or FILE.py:Class of your own.")] = None,
    filter: Annotated[str | None, typer.Option(help="spc, rss, none, or FILE.py:Class of your own.")] = None,
    scheme: Annotated[str | None, typer.Option(help="mi (minimally interventional) or sw (switching).")] = None,
    preset: Annotated[str | None, typer.Option(help="best or paper; best.")] = None,
    seed: Annotated[int | None, typer.Option(help="Seed of the traffic; the scenario's, or 0.")] = None,
    duration: Annotated[float | None, typer.Option(help="Seconds to record; 30 by default.")] = None,
    table: Annotated[str | None, typer.Option(help="A name in value_tables/ or a path to a specification.")] = None,
    ego: Annotated[str | None, typer.Option(help="Of a .sumocfg: the vehicle whose place the robot takes.")] = None,
    begin: Annotated[float | None, typer.Option(help="Of a .sumocfg: when the robot takes over, s.")] = None,
    traffic: Annotated[
        str | None,
        typer.Option(help="Of a .sumocfg: who drives the others, theirs (their own drivers) or idm-mobil."),
    ] = None,
    record: Annotated[
        str | None,
        typer.Option(help="Which cars are recorded: near (250 m; a .sumocfg's default) or all."),
    ] = None,
    assignments: Annotated[
        list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Any setting; hj-cosim knobs lists them.")
    ] = None,
    out: Annotated[Path | None, typer.Option(help="The run's folder; a new one in runs/ by default.")] = None,
    figures: Annotated[bool, typer.Option("--figures/--no-figures", help="Whether pictures are drawn.")] = True,
    watch: Watch = False,
    verbose: Annotated[bool, typer.Option("--verbose", help="Print SUMO's warnings instead of counting them.")] = False,
    as_json: Json = False,
) -> None:
    """Drive one episode and write its folder; of a run's config.toml, repeat that run and say what is different."""
    from hj_cosim.run import EpisodeProgress, new_run_folder, repetition_of, run_episode

    warnings = WarningCount()
    if not verbose:
        logging.getLogger("hj_cosim").addHandler(warnings)
    with progress_bars() as bars, watched_drive(Path(scenario).stem) if watch else nullcontext() as watching:
        episode = run_episode(
            scenario,
            planner=planner,
            filter=filter,
            scheme=scheme,
            preset=preset,
            seed=seed,
            duration=duration,
            table=table,
            ego=ego,
            begin=begin,
            traffic=traffic,
            record=record,
            settings=assignments or (),
            out=out or new_run_folder,
            figures=figures,
            progress=EpisodeProgress(
                driving=bar(bars, f"driving {Path(scenario).stem}"),
                solving=bar(bars, "solving the value table"),
                drawing=bar(bars, "drawing"),
                announce=say,
                watch=None if watching is None else watching.beside,
            ),
        )
        if watching is not None:
            watching.end(f"the drive is over; it is in {episode.folder}")
    repeated = repetition_of(scenario, episode)
    if as_json:
        of_repetition = (
            {} if repeated is None else {"repetition": {**asdict(repeated), "original": str(repeated.original)}}
        )
        print_json({**episode.summary, **episode.timing, "folder": str(episode.folder), **of_repetition})
    else:
        results.print(summary_table(episode.summary, episode.timing))
        if repeated is not None:
            show_repetition(repeated)
        if warnings.count:
            results.print(f"[dim]SUMO warned {warnings.count} times; --verbose shows of what[/dim]")
        show_place(episode.folder)


@app.command(epilog=example("hj-cosim export runs/paper-hjop-spc-mi-0 --out drive.csv"))
def export(
    folder: RunFolder,
    format: Annotated[
        str | None,
        typer.Option(help="csv, parquet, fcd (SUMO's floating car data XML), which the file's name says too; highd."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="The file to write, compressed if its name ends in .gz; by default in DIR.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Write a run's trajectories in another format."""
    from hj_cosim.analysis.export import export_files

    show_files(export_files(folder, format, out), as_json)


@app.command(
    epilog=example("hj-cosim figure value-slice", "hj-cosim figure timeline --run runs/paper-hjop-spc-mi-0 --width 85")
)
def figure(
    name: Annotated[str | None, typer.Argument(help="Which; without one, all are listed.")] = None,
    run: Annotated[Path | None, typer.Option(metavar="DIR", help="The run to draw, for figures of a run.")] = None,
    study: Annotated[Path | None, typer.Option(metavar="DIR", help="The study, for figures of a study.")] = None,
    out: Annotated[Path | None, typer.Option(help="A .png, .pdf, .svg or .csv; all but .svg by default.")] = None,
    width: Annotated[
        int | None, typer.Option(help="85 or 178 mm, one or two columns of a journal; the figure's own.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Draw a figure of the paper, or one beyond it, from our own data."""
    from hj_cosim.analysis.figures.catalogue import FIGURES

    if name is None:
        rows = [{"name": key, "drawn_from": kind.source, "shows": kind.description} for key, kind in FIGURES.items()]
        show_rows("figures", rows, as_json)
        return
    from hj_cosim.analysis.figures.gallery import draw_figure
    from hj_cosim.analysis.figures.style import PRINT_DPI, places_of, save_drawing

    folder = run or study
    target = out or (folder / "figures" if folder else runs_folder() / "figures") / name
    places_of(target)  # before a table is solved for it
    show_files(save_drawing(draw_figure(name, run=run, study=study, width=width), target, PRINT_DPI), as_json)


@app.command(epilog=example("hj-cosim replay runs/paper-hjop-spc-mi-0", "hj-cosim replay DIR --out drive.mp4"))
def replay(
    folder: RunFolder,
    out: Annotated[Path | None, typer.Option(help="A .gif, or an .mp4 where ffmpeg is installed.")] = None,
    as_json: Json = False,
) -> None:
    """Animate a run: the drive from above, the robot's plan, the cars in the colours of their values."""
    from hj_cosim.analysis.figures.run_table import table_of
    from hj_cosim.analysis.replay import write_replay
    from hj_cosim.recording.run_folder import read_run

    recorded = read_run(folder)
    with progress_bars() as bars:
        written = write_replay(recorded, table_of(recorded), out, bar(bars, "drawing frames"))
    show_files([written], as_json)


@app.command(epilog=example("hj-cosim report runs/paper-hjop-spc-mi-0", "hj-cosim report runs/study-paper-0"))
def report(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="The folder of a run or a study.")],
    out: Annotated[Path | None, typer.Option(help="The HTML file; report.html in the folder by default.")] = None,
    replays: Annotated[
        bool, typer.Option("--replays/--no-replays", help="Of a study: a replay in the folder of every episode.")
    ] = True,
    as_json: Json = False,
) -> None:
    """Write one self-contained HTML page about a run, with an interactive replay, or about a study."""
    from hj_cosim.analysis.report import write_report
    from hj_cosim.recording.study_files import STUDY, study_progress

    with progress_bars() as bars:
        written = write_report(folder, out, progress=bar(bars, "drawing"), replays=replays)
    show_files([written], as_json)
    if (folder / STUDY).is_file() and (progress := study_progress(folder)).is_unfinished:
        messages.print(
            f"unfinished: {progress.text}; hj-cosim study --resume --out {folder} goes on with it",
            highlight=False,
            soft_wrap=True,
            markup=False,
        )
