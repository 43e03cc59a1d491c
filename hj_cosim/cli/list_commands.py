"""Commands that list what there is: scenarios, settings, metrics."""

from dataclasses import asdict
from typing import Annotated, Any

import typer

from hj_cosim.cli.app import Json, app, example
from hj_cosim.cli.console import print_json, show_rows


@app.command(epilog=example("hj-cosim scenarios", "hj-cosim scenarios --template > mine.toml"))
def scenarios(
    template: Annotated[bool, typer.Option("--template", help="Print a scenario to start one's own from.")] = False,
    schema: Annotated[bool, typer.Option("--schema", help="Print the JSON schema of a scenario.")] = False,
    as_json: Json = False,
) -> None:
    """List the scenarios, their roads and densities."""
    from hj_cosim.traffic.sources.catalogue import list_scenarios, scenario_schema, scenario_template

    if template and as_json:
        print_json({"template": scenario_template()})
    elif template:
        print(scenario_template(), end="")
    elif schema:
        print_json(scenario_schema())
    else:
        show_rows("scenarios", [asdict(entry) for entry in list_scenarios()], as_json)


@app.command(epilog=example("hj-cosim knobs planner", "hj-cosim run --set planner.gamma_r=0.8"))
def knobs(
    group: Annotated[
        str | None, typer.Argument(help="A part of the keys, for example planner or scenario.drivers; all by default.")
    ] = None,
    as_json: Json = False,
) -> None:
    """List every setting that --set and --vary take: unit, default, range and what it means."""
    from hj_cosim.settings import list_settings

    entries = list_settings(group)
    if as_json:
        print_json([asdict(entry) for entry in entries])
        return
    show_rows(
        "settings",
        [
            {
                "key": entry.key,
                "unit": "" if entry.unit == "1" else entry.unit,
                "default": _default(entry.default, entry.paper),
                "allowed": entry.allowed,
                "meaning": entry.description,
            }
            for entry in entries
        ],
    )


def _default(best: Any, paper: Any) -> str:
    """Return a default in the preset `best`, and in `paper` where that differs."""
    texts = [
        "–" if value in (None, (), {}) else f"{value:g}" if isinstance(value, float) else str(value)
        for value in (best, paper)
    ]
    return texts[0] if texts[0] == texts[1] else f"{texts[0]} (paper: {texts[1]})"


@app.command(epilog=example("hj-cosim metrics", "hj-cosim metrics --json"))
def metrics(as_json: Json = False) -> None:
    """Explain every metric: its unit, which way is better, and how the episodes of a study become one number."""
    from hj_cosim.metrics.catalogue import FACTS, METRICS, TIMING

    rows = [
        {
            "name": metric.name,
            "what": metric.label,
            "unit": metric.unit,
            "better": metric.better,
            "over episodes": metric.pooling.text,
            "meaning": metric.explanation,
        }
        for metric in METRICS.values()
    ]
    facts = [{"name": fact.name, "unit": fact.unit, "meaning": fact.explanation} for fact in (*FACTS, *TIMING)]
    if as_json:
        print_json({"metrics": rows, "facts": facts})
    else:
        show_rows("metrics", rows)
        show_rows("what else summary.json and timing.json have", facts)
