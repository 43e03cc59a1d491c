"""`hj-cosim realism`: background traffic beside what is published of real motorways."""

from dataclasses import asdict
from typing import Annotated

import typer

from hj_cosim.cli.app import Json, Scenario, app, example
from hj_cosim.cli.console import bar, print_json, progress_bars, show_rows


# Seven parameters and the flag: each is an option of the command line.
@app.command(epilog=example("hj-cosim realism dense", "hj-cosim realism mine.toml --episodes 5"))
def realism(
    scenario: Scenario = "paper",
    preset: Annotated[str | None, typer.Option(help="best or paper, whose drivers differ; best.")] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="The first of as many as there are episodes.")] = None,
    episodes: Annotated[int, typer.Option(min=1, help="How many to drive.")] = 3,
    duration: Annotated[float, typer.Option(help="Seconds of each, after the traffic has settled.")] = 60.0,
    assignments: Annotated[list[str] | None, typer.Option("--set", metavar="KEY=VALUE", help="Any setting.")] = None,
    as_json: Json = False,
) -> None:
    """Measure the background traffic, and say of each quantity whether it lies within what is published."""
    from hj_cosim.cosim.configuration import resolve_config, stack_flags
    from hj_cosim.cosim.episode import open_world
    from hj_cosim.verification.realism import traffic_realism

    flags = stack_flags(duration=duration, seed=seed)
    config = resolve_config(scenario, preset=preset, flags=flags, assignments=assignments or ())
    with progress_bars() as bars:
        measures, findings = traffic_realism(config, episodes, open_world, bar(bars, f"driving {config.scenario.name}"))
    rows = [
        {
            "quantity": finding.quantity,
            "value": f"{finding.value:.3g}" if finding.value < 100 else f"{finding.value:.0f}",
            "unit": finding.unit,
            "published": finding.band.text if finding.band else "–",
            "verdict": finding.verdict,
            "source": finding.band.source if finding.band else "",
        }
        for finding in findings
    ]
    if as_json:
        print_json({"scenario": config.scenario.name, "measures": asdict(measures), "findings": rows})
    else:
        show_rows(f"traffic of {config.scenario.name}, {episodes} x {duration:g} s", rows)
