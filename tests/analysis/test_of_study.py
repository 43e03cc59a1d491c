import pandas as pd
import pytest

from hj_cosim.analysis.figures.attack import BEHAVIOUR, ROWS, SHARE
from hj_cosim.analysis.figures.gallery import draw_figure
from hj_cosim.analysis.figures.trade_off import METRICS_SHOWN
from hj_cosim.errors import RunFolderError

METRICS = {*METRICS_SHOWN, *(metric for metric, _ in ROWS)}


@pytest.fixture
def study(tmp_path):
    """Return the folder of a study that varied nothing."""
    row = {"scenario": "paper", "planner": "hjop", "filter": "spc", "scheme": "mi", "episodes": 2}
    row |= {f"{metric}{ending}": 1.0 for metric in METRICS for ending in ("", "_lo", "_hi")}
    pd.DataFrame([row]).to_csv(tmp_path / "table.csv", index=False)
    (tmp_path / "study.toml").touch()
    return tmp_path


def said_of(figure, study) -> str:
    with pytest.raises(RunFolderError) as refused:
        draw_figure(figure, study=study)
    return str(refused.value)


@pytest.mark.parametrize(("figure", "knob"), [("attack", BEHAVIOUR), ("target-sets", "table")])
def test_a_figure_about_what_a_study_did_not_vary_says_so(study, figure, knob):
    assert said_of(figure, study) == f"the study in {study} did not vary {knob}, which the figure is about"


def test_the_attack_needs_the_behaviours_and_their_share(study):
    table = pd.read_csv(study / "table.csv")
    table.assign(**{BEHAVIOUR: "cut_in"}).to_csv(study / "table.csv", index=False)
    assert f"did not vary {SHARE}" in said_of("attack", study)


def test_a_broken_table_is_not_taken_for_one_of_a_study_that_varied_nothing(study):
    (study / "table.csv").write_text("a,b\n1,2\n")
    assert "holds no complete study: table.csv has no column planner" in said_of("attack", study)


def test_a_figure_of_an_unfinished_study_says_how_to_go_on(study):
    (study / "table.csv").unlink()
    goes_on = f"hj-cosim study --resume --out {study} goes on with it"
    assert said_of("attack", study) == f"the study in {study} is not finished, table.csv is missing; {goes_on}"
    (study / "study.toml").unlink()
    assert said_of("attack", study) == f"{study} holds no complete study: table.csv is missing"
