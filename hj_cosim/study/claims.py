"""What the paper claims of its stacks, and what the presets promise, each checked as a difference with its interval.

Both speak of the paper's traffic, so that they are checked in no other.
A claim about two stacks is checked on the seeds that both have (a paired difference). It holds if the observed
difference has the right sign, and is certain if the whole 95 % interval has.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import pandas as pd

from hj_cosim.study.bootstrap import interval
from hj_cosim.study.design import Cell
from hj_cosim.study.stacks import Stack, parse_stack
from hj_cosim.study.statistics import RowStatistics
from hj_cosim.study.tables import Row


@dataclass(frozen=True)
class Claim:
    """A metric of a stack is at least, or at most, `factor` times that of another one, or a number."""

    stack: str
    metric: str
    relation: Literal["at least", "at most", "more than", "less than"]
    than: str | float  # a stack's name or a number
    factor: float = 1.0

    @property
    def text(self) -> str:
        """Return the claim as a sentence."""
        other = parse_stack(self.than).label if isinstance(self.than, str) else f"{self.than:g}"
        share = "" if self.factor == 1.0 else f"{self.factor:g} × "
        return f"{self.metric} of {parse_stack(self.stack).label} is {self.relation} {share}{other}"

    @property
    def needs(self) -> tuple[Stack, ...]:
        """Return the stacks that it speaks of."""
        return tuple(parse_stack(name) for name in (self.stack, self.than) if isinstance(name, str))

    def common_seeds(self, rows: Mapping[Stack, RowStatistics]) -> tuple[int, ...]:
        """Return the seeds, ascending, of which all stacks that it needs have episodes."""
        return tuple(sorted(set.intersection(*(set(rows[stack].seeds) for stack in self.needs))))

    def excess(self, rows: Mapping[Stack, RowStatistics]) -> tuple[int, np.ndarray, np.ndarray]:
        """Return how many episodes it is checked on, and the metric less what it is compared with.

        Args:
            rows: of the stacks that it needs.

        Returns:
            The number of common seeds, the observed difference (1,), and its bootstrap replicates (R,).
        """
        seeds = self.common_seeds(rows)
        observed, drawn = (values[self.metric] for values in rows[self.needs[0]].observed_and_drawn(seeds))
        if isinstance(self.than, float):
            return len(seeds), observed - self.than, drawn - self.than
        other, other_drawn = (values[self.metric] for values in rows[self.needs[1]].observed_and_drawn(seeds))
        return len(seeds), observed - self.factor * other, drawn - self.factor * other_drawn

    def is_met_by(self, excess: float) -> bool:
        """Return whether a difference has the right sign."""
        match self.relation:
            case "at least":
                return excess >= 0.0
            case "at most":
                return excess <= 0.0
            case "more than":
                return excess > 0.0
            case "less than":
                return excess < 0.0


_SAFETY = ("ttc_ge_3", "btn_le_1", "stn_le_1")

CLAIMS: Mapping[str, Sequence[Claim]] = {
    # The paper's three takeaways (section Experimental Results), in the numbers that its table suggests.
    "paper": (
        Claim("op-none", "mean_speed", "at least", 26.0),
        Claim("op-none", "mean_speed", "at most", 29.0),
        Claim("op-none", "ttc_ge_3", "less than", 0.75),
        *(Claim("hjop-none", metric, "more than", "op-none") for metric in _SAFETY),
        Claim("hjop-none", "mean_speed", "less than", "op-none"),
        Claim("hjop-spc-mi", "ttc_ge_3", "at least", 0.995),
        Claim("hjop-spc-mi", "mean_speed", "at least", "hjop-none", factor=0.97),
        *(Claim("hjop-spc-mi", "mean_speed", "more than", f"hjop-rss-{scheme}") for scheme in ("sw", "mi")),
        *(
            Claim(f"hjop-spc-{scheme}", "intervention_percent", "less than", f"op-spc-{scheme}")
            for scheme in ("sw", "mi")
        ),
        *(
            Claim(f"{planner}-{kind}-mi", "mean_abs_acceleration", "less than", f"{planner}-{kind}-sw")
            for planner in ("hjop", "op")
            for kind in ("spc", "rss")
        ),
        *(
            Claim(f"hjop-spc-{scheme}", metric, "less than", f"hjop-rss-{scheme}")
            for metric in ("mean_abs_acceleration", "intervention_percent")
            for scheme in ("sw", "mi")
        ),
    ),
    # Safer and faster than the paper's best row at once.
    "best": (
        Claim("hjop-spc-mi", "collisions", "at most", 0.0),
        Claim("hjop-spc-mi", "mean_speed", "at least", 22.5),
        Claim("hjop-spc-mi", "mean_abs_acceleration", "at most", 1.0),
        Claim("hjop-spc-mi", "intervention_percent", "at most", 10.0),
        Claim("hjop-spc-mi", "ttc_ge_3", "at least", 0.999),
    ),
}


def claim_table(rows: Sequence[Row]) -> pd.DataFrame:
    """Return claims.csv's content: for every setting in the paper's traffic, what its stacks allow to be checked.

    Columns, after the scenario and the setting: claim, episodes (common to the stacks), excess (the metric less what
    it is compared with), its 95 % interval excess_lo and excess_hi, holds, certain.
    """
    records = [
        {**place, **_checked(claim, stacks)}
        for place, preset, stacks in _places(rows)
        for claim in CLAIMS[preset]
        if all(stack in stacks for stack in claim.needs) and claim.common_seeds(stacks)
    ]
    return pd.DataFrame(records) if records else pd.DataFrame(columns=["scenario", *_COLUMNS])


_COLUMNS = ("claim", "episodes", "excess", "excess_lo", "excess_hi", "holds", "certain")


def _places(rows: Sequence[Row]) -> Iterator[tuple[dict[str, Any], str, dict[Stack, RowStatistics]]]:
    """Yield each setting in the paper's traffic, which alone the claims are about, with its preset and its stacks."""
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if not row.cell.is_in_papers_traffic:
            continue
        groups.setdefault((row.cell.scenario, row.cell.setting), []).append(row)
    for group in groups.values():
        first: Cell = group[0].cell
        place = {name: value for name, value in first.factors.items() if name not in ("planner", "filter", "scheme")}
        yield place, first.config.preset, {row.cell.stack: row.statistics for row in group}


def _checked(claim: Claim, rows: Mapping[Stack, RowStatistics]) -> dict[str, Any]:
    episodes, observed, drawn = claim.excess(rows)
    low, high = interval(drawn, episodes)
    return {
        "claim": claim.text,
        "episodes": episodes,
        "excess": float(observed[0]),
        "excess_lo": low,
        "excess_hi": high,
        "holds": claim.is_met_by(float(observed[0])),
        "certain": claim.is_met_by(low) and claim.is_met_by(high),
    }
