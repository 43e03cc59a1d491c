"""Commands about value tables."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer

from hj_cosim.cli.app import Json, Specification, example, table_app
from hj_cosim.cli.console import bar, plain_table, print_json, progress_bars, results, show_files, show_rows
from hj_cosim.errors import ConfigurationError
from hj_cosim.files import require_writable
from hj_cosim.locations import runs_folder


@table_app.command("solve", epilog=example("hj-cosim table solve highway --scheme first_order --out quick.npz"))
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


@table_app.command("list", epilog=example("hj-cosim table list"))
def table_list(as_json: Json = False) -> None:
    """List the specifications, and which of them are solved."""
    from hj_cosim.reachability.table.catalogue import table_overview

    show_rows("value tables", [asdict(row) for row in table_overview()], as_json)


@table_app.command("show", epilog=example("hj-cosim table show highway --out slices.png"))
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
    from hj_cosim.analysis.figures.style import places_of, save_drawing
    from hj_cosim.analysis.figures.value_slice import value_slice
    from hj_cosim.reachability.table.slices import parse_held
    from hj_cosim.reachability.table.store import find_specification, load_table, table_path

    path = find_specification(specification)
    held = parse_held(hold or ())
    target = out or runs_folder() / "figures" / f"{path.stem}-slices"
    places_of(target)  # before it is solved
    with progress_bars() as bars:
        table = load_table(specification, bar(bars, f"solving table {path.stem}"))
    drawing = value_slice(table, held, over=[name.strip() for name in over.split(",")] if over else ())
    _show_report(table, table_path(path), as_json)
    written = save_drawing(drawing, target)
    if not as_json:
        show_files(written, as_json)


@table_app.command("check", epilog=example("hj-cosim table check highway --rollouts 100000"))
def table_check(
    specification: Specification,
    rollouts: Annotated[int, typer.Option(min=1, help="Games played against the worst other car.")] = 10_000,
    seconds: Annotated[float, typer.Option(min=0, help="What solving the finer tables may take.")] = 300.0,
    as_json: Json = False,
) -> None:
    """Measure how good a table is: converged, near finer ones, and keeping its promise in closed loop."""
    from hj_cosim.cli.quality import quality_tables
    from hj_cosim.reachability.table.store import load_table
    from hj_cosim.settings import FilterSettings, robot_and_filter
    from hj_cosim.verification.guarantee import RolloutSettings, measure_guarantee
    from hj_cosim.verification.table_quality import check_table

    with progress_bars() as bars:
        table = load_table(specification, bar(bars, f"solving table {specification}"))
        quality = check_table(table, rollouts=rollouts, seconds=seconds, progress=bar(bars, "solving finer tables"))
    found: dict[str, Any] = {"table": asdict(quality)}
    if table.game.manoeuvres is not None:  # the filter is played out in the highway game alone
        robot, best = robot_and_filter("best")
        alone = FilterSettings(keep_escape=False)
        games = {
            "game": (RolloutSettings(rollouts=rollouts), best),
            "bicycle": (RolloutSettings(rollouts=rollouts, model="bicycle"), best),
            "game, the paper's SPC": (RolloutSettings(rollouts=rollouts), alone),
        }
        with progress_bars() as bars:
            for name, (settings, spc) in games.items():
                guarantee = measure_guarantee(table, settings, spc, robot, progress=bar(bars, f"playing: {name}"))
                found[f"filter, {name}"] = {**asdict(guarantee), "entered_percent": guarantee.entered_percent}
    if as_json:
        print_json(found)
    else:
        for table_to_print in quality_tables(specification, found):
            results.print(table_to_print)
