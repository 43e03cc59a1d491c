"""`hj-cosim check`: how a filter and a table do together, against the worst other car known or one that searches."""

from dataclasses import asdict
from typing import Annotated, Any

import typer

from hj_cosim.cli.app import Json, Specification, app, example
from hj_cosim.cli.console import bar, plain_table, print_json, progress_bars, results
from hj_cosim.errors import ConfigurationError

_ROWS = (
    ("games", "games", "{}"),
    ("entered", "entered the target set", "{}"),
    ("collided", "collided", "{}"),
    ("without_escape", "in which at some instant no manoeuvre escaped", "{}"),
    ("least_target", "least V(0, ·) (m)", "{:.2f}"),
    ("fall_median", "fall of V below its start, median (m)", "{:.2f}"),
    ("fall_p90", "90th percentile", "{:.2f}"),
    ("fall_p99", "99th percentile", "{:.2f}"),
    ("fall_max", "the largest", "{:.2f}"),
)


# Ten parameters: each is an option of the command line.
@app.command(epilog=example("hj-cosim check highway --adversary search --games 200 --seed 1"))
def check(
    specification: Specification,
    adversary: Annotated[str, typer.Option(help="search: cross-entropy over the other car's inputs.")] = "search",
    games: Annotated[int, typer.Option(min=1, help="Games of each kind.")] = 200,
    desired: Annotated[
        list[str] | None,
        typer.Option(help="cruise, full_throttle, steering_at_the_car, tracker_range, free; all by default."),
    ] = None,
    above: Annotated[float, typer.Option(help="m; games start with V above this.")] = 2.0,
    up_to: Annotated[float, typer.Option(help="m; and with V up to this.")] = 2.5,
    seed: Annotated[int, typer.Option(min=0, help="Of starts and search.")] = 0,
    bicycle: Annotated[bool, typer.Option(help="The robot moves as a bicycle does, not as the table assumes.")] = False,
    preset: Annotated[str, typer.Option(help="best or paper: whose robot and filter.")] = "best",
    as_json: Json = False,
) -> None:
    """Attack the filter: search for what another car, and the planner, could do that hurts most."""
    from hj_cosim.reachability.table.store import load_table
    from hj_cosim.settings import robot_and_filter
    from hj_cosim.verification.adversary import DESIRED, AdversarySettings, search_adversary

    if adversary != "search":
        raise ConfigurationError(f"--adversary {adversary} is not known; there is: search")
    for name in desired or ():
        if name not in DESIRED:
            raise ConfigurationError(f"--desired {name} is not known; choose from {', '.join(DESIRED)}")
    if not above < up_to:
        raise ConfigurationError(f"--above {above:g} and --up-to {up_to:g} leave no V to start from; --up-to is larger")
    robot, spc = robot_and_filter(preset)
    found: dict[str, dict[str, Any]] = {}
    with progress_bars() as bars:
        table = load_table(specification, bar(bars, f"solving table {specification}"))
        for name in DESIRED:
            if desired is None or name in desired:
                settings = AdversarySettings(
                    games=games, desired=name, above=above, up_to=up_to, bicycle=bicycle, seed=seed
                )
                report = search_adversary(table, settings, spc, robot, progress=bar(bars, f"searching: {name}"))
                found[name] = {**asdict(report), "games": games}
    if as_json:
        print_json(found)
        return
    rows = [(*(form.format(facts[key]) for facts in found.values()), what) for key, what, form in _ROWS]
    results.print(
        plain_table(f"{specification}: SPC against a search, V in ({above:g}, {up_to:g}]", (*found, ""), rows)
    )
