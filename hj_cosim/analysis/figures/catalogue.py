"""Every figure by its name: what it shows, and what it is drawn from. Nothing that draws is imported here."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Source = Literal["run", "study", "table"]


@dataclass(frozen=True)
class FigureKind:
    """A figure that can be asked for by name."""

    source: Source  # what it is drawn from
    description: str
    drawn_by: (
        str  # module:function of this folder; of (run), (run, table), (folder of a study), or (table), and of width
    )
    needs_table: bool = False  # a run's figure that looks values up


FIGURES: Mapping[str, FigureKind] = {
    "schematic": FigureKind("table", "the robot among cars, on the value function", "schematic:schematic"),
    "boxed-in": FigureKind("table", "the robot boxed in by four cars", "schematic:boxed_in"),
    "value-slice": FigureKind("table", "the paper's slice of the value function", "value_slice:value_slice"),
    "planner-comparison": FigureKind(
        "table", "what OP and HJOP plan, and where it leads", "planner_comparison:planner_comparison"
    ),
    "highway": FigureKind("run", "a moment from above, cars in the colours of their values", "highway:highway", True),
    "snapshots": FigureKind("run", "the drive from above at evenly spaced times", "snapshots:snapshots"),
    "drive-map": FigureKind(
        "run", "the network from above, and the drive in the colours of its speed", "drive_map:drive_map"
    ),
    "timeline": FigureKind("run", "speed, value, TTC, lane and interventions over time", "timeline:timeline"),
    "value-along-drive": FigureKind(
        "run", "the values and places of the cars over time", "value_along_drive:value_along_drive", True
    ),
    "control-sets": FigureKind("run", "safe controls of SPC and RSS, MI and SW", "control_sets:control_sets", True),
    "trade-off": FigureKind(
        "study", "1st percentile of 2D TTC over mean speed, with intervals", "of_study:trade_off_of"
    ),
    "attack": FigureKind("study", "collisions and speed over the share of drivers who mean harm", "of_study:attack_of"),
    "target-sets": FigureKind(
        "study", "2D TTC over mean speed by the value table, in each traffic", "of_study:target_sets_of"
    ),
    "sweep": FigureKind("study", "speed, safety and interventions over a varied setting", "of_study:sweep_of"),
    "density-sweep": FigureKind(
        "study", "speed, safety and interventions over the density", "of_study:density_sweep_of"
    ),
}
