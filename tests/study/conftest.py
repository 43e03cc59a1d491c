"""Small studies of synthetic episodes; worker processes find their functions on the path."""

import importlib
from collections.abc import Callable, Generator, Sequence
from pathlib import Path
from types import ModuleType

import pytest

from hj_cosim.errors import HjCosimError
from hj_cosim.study.design import StudyDesign, design_study
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.jobs import Engine, EpisodeFunction, EpisodeJob, Outcome
from hj_cosim.study.stacks import Stack
from hj_cosim.study.study import Study, conduct


class InThisProcess:
    """An engine for tests of what is independent of engines."""

    def run(self, jobs: Sequence[EpisodeJob], function: EpisodeFunction) -> Generator[Outcome, None, None]:
        for job in jobs:
            try:
                function(job)
            except HjCosimError as error:
                yield Outcome(job, str(error), "its log")
            else:
                yield Outcome(job)


@pytest.fixture
def in_this_process() -> InThisProcess:
    return InThisProcess()


TWO_STACKS = (Stack("hjop", "spc", "mi"), Stack("op", "none"))


@pytest.fixture
def synthetic(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module `synthetic_episodes`, importable here and in the workers."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    return importlib.import_module("synthetic_episodes")


@pytest.fixture
def design() -> StudyDesign:
    return design_study(episodes=4, stacks=TWO_STACKS)


@pytest.fixture
def conduct_synthetic(synthetic: ModuleType, design: StudyDesign, tmp_path: Path) -> Callable[..., Study]:
    """Conduct a study of synthetic episodes; keyword arguments in place of the defaults."""
    table = tmp_path / "table.npz"
    table.write_bytes(b"no episode here looks into it")

    def conduct_it(
        folder: str,
        engine: Engine | None = None,
        *,
        study: StudyDesign = design,
        resume: bool = False,
        version: str = "1.0",
        **changes,
    ) -> Study:
        place = StudyFolder(tmp_path / folder, study)
        place.prepare(resume=resume)
        options = {"function": synthetic.drive, "table_files": {"highway": table}, **changes}
        program = {"hj-cosim": version}
        return conduct(place, engine or InThisProcess(), request={"asked": "for"}, program=program, **options)

    return conduct_it


@pytest.fixture
def reproducible_files() -> Callable[[Path], dict[str, bytes]]:
    """Return the content of a study's files that must not depend on how it was driven."""
    names = ("table.csv", "differences.csv", "comparison.csv", "episodes.parquet", "windows.parquet", "study.toml")
    return lambda folder: {name: (folder / name).read_bytes() for name in names}
