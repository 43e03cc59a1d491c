"""What a study consists of: which stacks in which scenarios with which varied knobs, all on the same seeds."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError
from hj_cosim.files import file_name
from hj_cosim.settings import EpisodeConfig, overlay, parse_assignment
from hj_cosim.study.stacks import PAPER_STACKS, Stack

# What a row of the table says of itself; varying it would make the row say something else than what was driven.
_KEYS_OF_A_ROW = ("seed", "preset", "planner.kind", "filter.kind", "filter.scheme", "scenario.name")


@dataclass(frozen=True)
class Variation:
    """A knob and the values that it takes in turn."""

    key: str  # as in `--set`, for example planner.gamma_r
    values: tuple[str, ...]


def parse_variation(text: str) -> Variation:
    """Return the variation of a text such as `planner.gamma_r=0.8,0.9,1.0`.

    Raises:
        ConfigurationError: if there is no key, no value, a value twice, or the key is one that the study sets.
    """
    key, separator, listed = text.partition("=")
    values = tuple(value.strip() for value in listed.split(","))
    if not separator or not key.strip() or not all(values):
        raise ConfigurationError(f"--vary {text}: write KEY=VALUE,VALUE, for example planner.gamma_r=0.8,0.9,1.0")
    if len(set(values)) < len(values):
        raise ConfigurationError(f"--vary {text}: a value is there twice; every value makes rows of its own")
    if key.strip() in _KEYS_OF_A_ROW:
        raise ConfigurationError(
            f"--vary {text}: a study sets {key.strip()} itself; choose stacks, scenarios and seeds instead"
        )
    return Variation(key.strip(), values)


@dataclass(frozen=True)
class Cell:
    """One row of the study's table: a stack in a scenario, with one value of each varied knob."""

    scenario: str  # the scenario's name
    setting: tuple[tuple[str, str], ...]  # (key, value) of each varied knob
    stack: Stack
    config: EpisodeConfig  # with the first seed

    @property
    def factors(self) -> dict[str, Any]:
        """Return what tells this row from the others, as the columns that come first in every table."""
        varied = {key: _value(key, text) for key, text in self.setting}
        stack = {"planner": self.stack.planner, "filter": self.stack.filter, "scheme": self.stack.scheme}
        return {"scenario": self.scenario, **varied, **stack}


def _value(key: str, text: str) -> Any:
    value: Any = parse_assignment(f"{key}={text}")
    for part in key.split("."):
        value = value[part]
    return value


@dataclass(frozen=True)
class StudyDesign:
    """Cells times seeds. Every cell is driven on the same seeds, so that rows can be compared pair by pair."""

    cells: tuple[Cell, ...]
    seeds: tuple[int, ...]

    def episodes(self) -> Iterator[tuple[Cell, int]]:
        """Yield every cell and seed, seed by seed, so that a study cut short has all rows about equally long."""
        for seed in self.seeds:
            for cell in self.cells:
                yield cell, seed

    def folder_name(self, cell: Cell) -> str:
        """Return where a cell's runs lie below `episodes/`: its stack, below its scenario and setting if they vary."""
        parts = [cell.scenario] if len({other.scenario for other in self.cells}) > 1 else []
        parts += [",".join(f"{key}={value}" for key, value in cell.setting)] if cell.setting else []
        return "/".join(file_name(part) for part in [*parts, cell.stack.name])


def design_study(
    scenarios: tuple[str, ...] = ("paper",),
    *,
    episodes: int = 20,
    seed: int = 0,
    preset: str = "best",
    stacks: tuple[Stack, ...] = PAPER_STACKS,
    variations: tuple[Variation, ...] = (),
    flags: Mapping[str, Any] | None = None,
    assignments: tuple[str, ...] = (),
) -> StudyDesign:
    """Return a study of every stack in every scenario with every combination of the varied knobs.

    In a study a collision is counted and driven through, unless an assignment says otherwise.

    Args:
        scenarios: names in sumo_net/ or paths to scenario TOMLs.
        episodes: per cell, on the seeds `seed`, `seed` + 1, ...
        seed: the first one.
        preset: `best` or `paper`.
        stacks: in the order of the table's rows.
        variations: knobs and their values; the first varies slowest.
        flags: nested configuration for every episode, as the command line's options give it.
        assignments: texts `KEY=VALUE` for every episode, as `--set` takes them.

    Raises:
        ConfigurationError: if anything is unknown, of the wrong type or out of range, or two rows would be the same.
    """
    if episodes < 1:
        raise ConfigurationError(f"episodes = {episodes}: a study needs one episode or more")
    if not scenarios or not stacks:
        raise ConfigurationError("a study needs one scenario and one stack or more")
    cells = []
    base = overlay({"seed": seed, "simulation": {"on_collision": "continue"}}, flags or {})
    for scenario in scenarios:
        for values in itertools.product(*(variation.values for variation in variations)):
            setting = tuple((variation.key, value) for variation, value in zip(variations, values, strict=True))
            for stack in stacks:
                config = resolve_config(
                    scenario,
                    preset=preset,
                    flags=overlay(base, stack.flags),
                    assignments=[*assignments, *(f"{key}={value}" for key, value in setting)],
                )
                cells.append(Cell(config.scenario.name, setting, stack, config))
    design = StudyDesign(tuple(cells), tuple(range(seed, seed + episodes)))
    _require_distinct_rows(design)
    return design


def _require_distinct_rows(design: StudyDesign) -> None:
    seen: set[str] = set()
    for cell in design.cells:
        name = design.folder_name(cell)
        if name in seen:
            raise ConfigurationError(
                f"the study would have the row {name} twice; name each scenario, stack, value once"
            )
        seen.add(name)
