import numpy as np
import pytest

from hj_cosim.study.claims import CLAIMS, Claim, claim_table
from hj_cosim.study.design import design_study
from hj_cosim.study.stacks import PAPER_STACKS
from hj_cosim.study.statistics import EpisodeResult, RowStatistics
from hj_cosim.study.tables import Row, paper_table


def rows_of(preset, value, episodes=20, missing=()):
    """Return the ten rows of a study whose episodes' metrics are `value(stack, seed)`."""
    design = design_study(episodes=episodes, preset=preset)
    samples = {name: np.ones(10) for name in ("ttc", "btn", "stn")}
    return [
        Row(
            cell,
            RowStatistics(
                [
                    EpisodeResult(seed, {"samples": 10, "collisions": 0, **value(cell.stack, seed)}, samples)
                    for seed in design.seeds
                    if (cell.stack.name, seed) not in missing
                ]
            ),
            missing=0,
        )
        for cell in design.cells
    ]


def as_in_the_paper(stack, seed):
    table = paper_table().set_index(["planner", "filter", "scheme"])
    return table.loc[(stack.planner, stack.filter, stack.scheme)].to_dict()


def test_the_papers_own_table_fulfils_every_claim():
    claims = claim_table(rows_of("paper", as_in_the_paper, episodes=2))
    assert len(claims) == len(CLAIMS["paper"])
    assert claims["holds"].all()
    assert claims["certain"].all()


def test_a_claim_that_fails_says_by_how_much():
    def all_alike(stack, seed):
        return {**as_in_the_paper(PAPER_STACKS[0], seed), "mean_speed": 20.0}

    claims = claim_table(rows_of("paper", all_alike, episodes=2)).set_index("claim")
    too_slow = claims.loc["mean_speed of OP + None is at least 26"]
    assert not too_slow["holds"]
    assert too_slow["excess"] == pytest.approx(-6.0)
    assert not claims.loc["mean_speed of HJOP + None is less than OP + None", "holds"]
    assert claims.loc["mean_speed of HJOP + SPC + MI is at least 0.97 × HJOP + None", "excess"] == pytest.approx(0.6)


def test_a_claim_whose_interval_reaches_the_other_side_is_not_certain():
    def noisy(stack, seed):
        own = as_in_the_paper(stack, seed)
        unsure = 5.0 * np.random.default_rng([seed, len(stack.name)]).normal()
        return {**own, "mean_speed": own["mean_speed"] + unsure * (stack.name == "hjop-spc-mi")}

    claims = claim_table(rows_of("paper", noisy)).set_index("claim")
    claim = claims.loc["mean_speed of HJOP + SPC + MI is at least 0.97 × HJOP + None"]
    assert claim["excess_lo"] < 0.0 < claim["excess_hi"]
    assert not claim["certain"]


def test_what_is_hard_for_both_stacks_falls_out_of_a_claim():
    def same_noise(stack, seed):
        own = as_in_the_paper(stack, seed)
        return {**own, "mean_speed": own["mean_speed"] + 5.0 * np.random.default_rng(seed).normal()}

    claims = claim_table(rows_of("paper", same_noise)).set_index("claim")
    assert claims.loc["mean_speed of HJOP + SPC + MI is more than HJOP + RSS + MI", "certain"]


def test_a_claim_is_checked_on_the_common_seeds():
    rows = rows_of("paper", as_in_the_paper, episodes=5, missing={("op-none", 1), ("hjop-none", 3)})
    claims = claim_table(rows).set_index("claim")
    assert claims.loc["mean_speed of HJOP + None is less than OP + None", "episodes"] == 3
    assert claims.loc["mean_speed of OP + None is at least 26", "episodes"] == 4


def test_claims_about_stacks_that_share_no_seed_are_left_out():
    rows = rows_of("paper", as_in_the_paper, episodes=2, missing={("op-none", 0), ("hjop-none", 1)})
    claims = set(claim_table(rows)["claim"])
    assert "mean_speed of HJOP + None is less than OP + None" not in claims
    assert "mean_speed of OP + None is at least 26" in claims


def test_of_a_single_episode_no_claim_is_certain():
    claims = claim_table(rows_of("paper", as_in_the_paper, episodes=1))
    assert claims["holds"].all()
    assert not claims["certain"].any()
    assert claims["excess_lo"].isna().all()


def test_claims_about_stacks_that_are_not_there_are_left_out():
    rows = [row for row in rows_of("best", as_in_the_paper, episodes=2) if row.cell.stack.name == "op-none"]
    assert claim_table(rows).empty


@pytest.mark.parametrize(
    ("relation", "met"), [("at least", (0, 1)), ("at most", (-1, 0)), ("more than", (1,)), ("less than", (-1,))]
)
def test_relations_mean_what_they_say(relation, met):
    claim = Claim("op-none", "mean_speed", relation, 26.0)
    assert [excess for excess in (-1, 0, 1) if claim.is_met_by(excess)] == list(met)
