"""What `table check` shows: how good a table is, beside finer ones, and what the filter keeps of its guarantee."""

from collections.abc import Iterator, Mapping
from typing import Any

from rich.table import Table

from hj_cosim.cli.console import plain_table

_QUALITY = (
    ("residual", "largest |dV/dt| in the solve's last step, 0 when settled (m/s)", "{:.2f}"),
    ("unsafe_share", "of the nodes have V <= 0", "{:.2%}"),
    ("no_escape_share", "of all states have V > 0, and no manoeuvre escapes", "{:.3%}"),
    ("rollouts", "games over the horizon from |V| <= 1", "{}"),
    ("broken_share", "of them fell below the promised V by more than the tolerance", "{:.2%}"),
    ("tolerance", "the tolerance (m)", "{:g}"),
    ("shortfall_p99", "99th percentile of what was missing (m)", "{:.2f}"),
    ("shortfall_worst", "the most that was missing (m)", "{:.2f}"),
    ("entered_share", "of those from V > 0 entered the target set", "{:.2%}"),
)
_GUARANTEE = (
    ("rollouts", "games of 10 s from just above ε", "{}"),
    ("without_escape", "no manoeuvre escapes from the start", "{}"),
    ("entered_percent", "entered the target set (%)", "{:.3f}"),
    ("collided", "collided", "{}"),
    ("fall_median", "median fall of V below ε (m)", "{:.2f}"),
    ("fall_p99", "its 99th percentile (m)", "{:.2f}"),
    ("unmet_percent", "steps with cars in K whose rows cannot be met (%)", "{:.1f}"),
)


def quality_tables(name: str, found: Mapping[str, Any]) -> Iterator[Table]:
    """Yield tables to print.

    Args:
        name: of the table.
        found: "table": a TableQuality's fields; "filter, MODEL": a GuaranteeReport's, for each model of the robot.
    """
    quality = found["table"]
    rows = [(what, form.format(quality[key])) for key, what, form in _QUALITY if quality[key] is not None]
    rows += [(f"unsafe nodes on the face {face}", f"{share:.2%}") for face, share in quality["unsafe_on_faces"].items()]
    yield plain_table(f"{name}: the table", ("value", "what"), [(value, what) for what, value in rows])
    if quality["refinements"]:
        yield plain_table(
            f"{name} beside 1.5 times finer ones",
            ("finer", "nodes", "median |ΔV|", "p99", "safe wrongly", "unsafe wrongly", "margin needed (m)"),
            [
                (
                    finer["what"],
                    "x".join(map(str, finer["shape"])),
                    f"{finer['change_median']:.2f}",
                    f"{finer['change_p99']:.2f}",
                    f"{finer['called_safe_wrongly']:.3%}",
                    f"{finer['called_unsafe_wrongly']:.3%}",
                    f"{finer['margin_needed']:.2f}",
                )
                for finer in quality["refinements"]
            ],
        )
    kept = {key.removeprefix("filter, "): facts for key, facts in found.items() if key != "table"}
    if kept:
        models = [(*(form.format(facts[key]) for facts in kept.values()), what) for key, what, form in _GUARANTEE]
        causes = next(iter(kept.values()))["causes"]
        models += [(*(str(facts["causes"][cause]) for facts in kept.values()), f"entered: {cause}") for cause in causes]
        yield plain_table(f"{name}: SPC against the worst other car", (*kept, "what"), models)
