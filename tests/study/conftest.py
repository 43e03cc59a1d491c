"""Small studies of synthetic episodes; worker processes find their functions on the path."""

import importlib
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import ModuleType

import pytest
from in_this_process import InThisProcess

from hj_cosim.reachability.table.store import kept_table
from hj_cosim.study.design import StudyDesign, design_of
from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.jobs import Engine, EpisodeFunction
from hj_cosim.study.onlooker import Onlooker
from hj_cosim.study.request import new_study, resumed_study
from hj_cosim.study.study import Study, conduct


@pytest.fixture
def in_this_process() -> InThisProcess:
    return InThisProcess()


TWO_STACKS = ("hjop-spc-mi", "op-none")
FOUR_OF_TWO = {"episodes": 4, "stacks": TWO_STACKS}


@pytest.fixture
def synthetic(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The module `synthetic_episodes`, importable here and in the workers."""
    monkeypatch.syspath_prepend(str(Path(__file__).parent))
    return importlib.import_module("synthetic_episodes")


@pytest.fixture
def design() -> StudyDesign:
    return design_of(new_study(FOUR_OF_TWO))


@pytest.fixture
def study_folder(tmp_path: Path) -> Callable[..., StudyFolder]:
    """Return a function that makes the folder of a new study: four episodes of two stacks, unless given otherwise."""
    return lambda name, **given: StudyFolder.of(tmp_path / name, new_study({**FOUR_OF_TWO, **given}))


@pytest.fixture
def without_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Conduct without drawing, which takes longer than all the rest."""
    monkeypatch.setattr("hj_cosim.study.study.draw_figures", lambda *_: None)


@pytest.fixture(scope="session")
def conducted() -> dict[str, Study]:
    """Studies that the tests here have in common, by what was asked for: half of conducting one is its pictures."""
    return {}


@pytest.fixture
def conduct_synthetic(
    synthetic: ModuleType,
    study_folder: Callable[..., StudyFolder],
    conducted: dict[str, Study],
    tmp_path: Path,
    request: pytest.FixtureRequest,
    tmp_path_factory: pytest.TempPathFactory,
) -> Callable[..., Study]:
    """Conduct a study of synthetic episodes, new or resumed; keyword arguments are fields of its request.

    A new one that is to be conducted in the usual way is a copy of what came of it the first time.
    """
    table = replace(kept_table("highway"), path=tmp_path / "table.npz")
    table.path.write_bytes(b"no episode here looks into it")

    def conduct_it(
        name: str,
        engine: Engine | None = None,
        *,
        resume: bool = False,
        version: str = "1.0",
        function: EpisodeFunction = synthetic.drive,
        progress: Callable[[int, int], None] | None = None,
        watch: Onlooker | None = None,
        **given,
    ) -> Study:
        place = tmp_path / name
        folder = StudyFolder.of(place, resumed_study(place, given)) if resume else study_folder(name, **given)
        is_usual = (engine, version, function, progress, watch) == (None, "1.0", synthetic.drive, None, None)
        asked = None
        if is_usual and not place.exists() and "without_figures" not in request.fixturenames:
            asked = repr(given)
        if asked in conducted:
            shutil.copytree(conducted[asked].folder, place)
            return replace(conducted[asked], folder=place)
        folder.begin({"hj-cosim": version}, resume=resume)
        tables = dict.fromkeys(folder.tables, (table,))
        engine = engine or InThisProcess()
        study = conduct(folder, engine, function=function, tables=tables, progress=progress, watch=watch)
        if asked is not None:
            kept = shutil.copytree(place, tmp_path_factory.mktemp("conducted") / "study")
            conducted[asked] = replace(study, folder=kept)
        return study

    return conduct_it


@pytest.fixture
def reproducible_files() -> Callable[[Path], dict[str, bytes]]:
    """Return the content of a study's files that must not depend on how it was driven."""
    names = ("table.csv", "differences.csv", "comparison.csv", "claims.csv", "episodes.parquet", "windows.parquet")
    return lambda folder: {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in [folder / "study.toml", *(folder / name for name in names), *sorted(folder.glob("figures/*"))]
    }
