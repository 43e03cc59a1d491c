"""What a study consists of: which stacks in which scenarios with which varied knobs, all on the same seeds."""

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

from hj_cosim.cosim.configuration import resolve_config
from hj_cosim.errors import ConfigurationError
from hj_cosim.files import file_name
from hj_cosim.recording.study_files import StudyRequest, split_variation
from hj_cosim.settings import EpisodeConfig, Scenario, flattened, overlay, parse_assignment, shown
from hj_cosim.study.stacks import PAPER_STACKS, Stack, parse_stack

# What a row of the table says of itself; varying it would make the row say something else than what was driven.
_KEYS_OF_A_ROW = ("seed", "preset", "planner.kind", "filter.kind", "filter.scheme", "scenario.name")
_SETTABLE = ("preset", "scenario.name")  # for all rows alike


@dataclass(frozen=True)
class Variation:
    """A knob and the values that it takes in turn."""

    key: str  # as in `--set`, for example planner.gamma_r
    values: tuple[str, ...]

    @property
    def text(self) -> str:
        """Return it as `--vary` takes it."""
        return f"{self.key}={','.join(self.values)}"


def parse_variation(text: str) -> Variation:
    """Return the variation of a text such as `planner.gamma_r=0.8,0.9,1.0`.

    Raises:
        ConfigurationError: if there is no key, no value, a value twice, or the key is one that the study sets.
    """
    key, values = split_variation(text)
    if not key or not all(values):
        raise ConfigurationError(
            f"--vary {shown(text)}: write KEY=VALUE,VALUE, for example planner.gamma_r=0.8,0.9,1.0"
        )
    if len({repr(_value(key, value)) for value in values}) < len(values):  # 0.8 and 8e-1 are one
        raise ConfigurationError(f"--vary {shown(text)}: a value is there twice; every value makes rows of its own")
    if key in _KEYS_OF_A_ROW:
        raise ConfigurationError(
            f"--vary {shown(text)}: a study sets {key} itself; choose stacks, scenarios and seeds instead"
        )
    return Variation(key, values)


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
        return {"scenario": self.scenario, **varied, **self.stack.columns}

    def config_of(self, seed: int) -> EpisodeConfig:
        """Return the configuration of one of the row's episodes."""
        return self.config.model_copy(update={"seed": seed})

    @property
    def is_papers(self) -> bool:
        """Whether the paper has numbers of this row: one of its stacks drives in its traffic."""
        return self.stack in PAPER_STACKS and self.is_in_papers_traffic

    @property
    def is_in_papers_traffic(self) -> bool:
        """Whether the scenario is `paper` as it comes with the package, nothing in it changed."""
        return self.config.scenario == _papers_traffic(self.config.preset)


@cache
def _papers_traffic(preset: str) -> Scenario:
    return resolve_config("paper", preset=preset).scenario


def _value(key: str, text: str) -> Any:
    value: Any = parse_assignment(f"{key}={text}", "--vary")
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
    settings: tuple[str, ...] = (),
    traffic: str = "theirs",
) -> StudyDesign:
    """Return a study of every stack in every scenario with every combination of the varied knobs.

    In a study a collision is counted and driven through, unless a setting says otherwise.

    Args:
        scenarios: names in sumo_net/ or paths to scenario TOMLs.
        episodes: per cell, on the seeds `seed`, `seed` + 1, ...
        seed: the first one.
        preset: `best` or `paper`.
        stacks: in the order of the table's rows.
        variations: knobs and their values; the first varies slowest.
        settings: texts `KEY=VALUE` for every episode, as `--set` takes them.
        traffic: `theirs` or `idm-mobil`, who drives the others in users' own simulations.

    Raises:
        ConfigurationError: if anything is unknown, of the wrong type or out of range, or two rows would be the same.
    """
    if episodes < 1:
        raise ConfigurationError(f"episodes = {episodes}: a study needs one episode or more")
    if not scenarios or not stacks:
        raise ConfigurationError("a study needs one scenario and one stack or more")
    for text in settings:
        _require_not_a_rows_own(text)
    _require_each_key_once(settings, variations)
    cells = []
    base: dict[str, Any] = {"seed": seed, "simulation": {"on_collision": "continue"}}
    if traffic != "theirs":
        base["scenario"] = {"own": {"traffic": traffic}}
    for scenario in scenarios:
        for values in itertools.product(*(variation.values for variation in variations)):
            setting = tuple((variation.key, value) for variation, value in zip(variations, values, strict=True))
            for stack in stacks:
                config = resolve_config(
                    scenario,
                    preset=preset,
                    flags=overlay(base, stack.flags),
                    assignments=settings,
                    varied=[f"{key}={value}" for key, value in setting],
                )
                cells.append(Cell(config.scenario.name, setting, stack, config))
    design = StudyDesign(tuple(cells), tuple(range(seed, seed + episodes)))
    _require_distinct_rows(design)
    return design


def _require_not_a_rows_own(assignment: str) -> None:
    """Check that a setting for every episode is none that makes a row's name untrue, or each episode the same."""
    for key in _KEYS_OF_A_ROW:
        found: Any = parse_assignment(assignment)
        for part in key.split("."):
            found = found.get(part) if isinstance(found, Mapping) else None
        if found is not None and key not in _SETTABLE:
            raise ConfigurationError(
                f"--set {shown(assignment)}: a study sets {key} itself; choose stacks and seeds instead"
            )


def _require_each_key_once(settings: Sequence[str], variations: Sequence[Variation]) -> None:
    """Check that nothing is varied twice, or varied and set, of which one would do nothing."""
    taken: dict[str, str] = {}  # the option that gives a key
    for variation in variations:
        option = f"--vary {shown(variation.text)}"
        keys = {key for value in variation.values for key in _keys(f"{variation.key}={value}")}
        for key in sorted(keys):
            if key in taken:
                raise ConfigurationError(f"{option} and {taken[key]} vary the same setting; leave one of them out")
        taken |= dict.fromkeys(keys, option)
    for text in settings:
        for key in _keys(text):
            if key in taken:
                raise ConfigurationError(f"--set {shown(text)}: {taken[key]} gives that setting; leave one of them out")


def _keys(assignment: str) -> list[str]:
    return [key for key, _ in flattened(parse_assignment(assignment))]


def design_of(request: StudyRequest) -> StudyDesign:
    """Return what a request asks for.

    Raises:
        ConfigurationError: as design_study.
    """
    return design_study(
        request.scenarios,
        episodes=request.episodes,
        seed=request.seed,
        preset=request.preset,
        stacks=tuple(parse_stack(text) for text in request.stacks),
        variations=tuple(parse_variation(text) for text in request.vary),
        settings=request.set,
        traffic=request.traffic,
    )


def _require_distinct_rows(design: StudyDesign) -> None:
    seen: set[str] = set()
    for cell in design.cells:
        name = design.folder_name(cell)
        if name in seen:
            raise ConfigurationError(
                f"the study would have the row {name} twice; name each scenario, stack, value once"
            )
        seen.add(name)
