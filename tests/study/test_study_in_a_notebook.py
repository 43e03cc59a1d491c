"""Studies as one asks for them, and looks at them, in a notebook."""

from pathlib import Path

import pytest

from hj_cosim.errors import ConfigurationError, RunFolderError
from hj_cosim.study.request import given_fields
from hj_cosim.study.study import read_study


def test_a_study_of_dicts_is_the_study_of_texts():
    given = given_fields(
        stacks=[{"planner": "op", "filter": "rss", "scheme": "sw"}, {"filter": "none"}, {"planner": "mine.py:Keep"}],
        vary={"planner.gamma_r": [0.8, 1], "planner": {"kind": ["a", "b"]}},
        set={"filter": {"keep_escape": True}},
    )
    mine = f"{Path('mine.py').absolute()}:Keep"
    assert given["stacks"] == ("op-rss-sw", "hjop-none", f"{mine}/spc-mi")
    assert given["vary"] == ("planner.gamma_r=0.8,1", "planner.kind=a,b")
    assert given["set"] == ("filter.keep_escape=true",)
    with pytest.raises(ConfigurationError, match="has not planner, filter and scheme alone"):
        given_fields(stacks={"planer": "op"})
    with pytest.raises(ConfigurationError, match=r"vary: planner.gamma_r = 0.8 is no list of values"):
        given_fields(vary={"planner.gamma_r": 0.8})


def test_a_study_tells_what_it_holds_and_has_its_episodes(conduct_synthetic):
    study = conduct_synthetic("<b>study")
    again = read_study(study.folder)
    assert len(again.episodes) == 8
    assert set(again.episodes["seed"]) == set(range(4))
    assert repr(again) == f"Study in {study.folder}: 2 rows, 8 episodes, {_crashed(again)} crashed, 0 missing"
    html = again._repr_html_()
    assert "mean speed (m/s)" in html
    assert f"{again.table['mean_speed'][0]:.2f} [" in html
    assert "&lt;b&gt;study" in html
    (study.folder / "episodes.parquet").unlink()
    with pytest.raises(RunFolderError, match="holds no readable study"):
        _ = read_study(study.folder).episodes


def _crashed(study):
    return int((study.episodes["collisions"] > 0).sum())
