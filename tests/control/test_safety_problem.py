"""The safety problem against solutions of its paper form (fixtures/safety_qp.json) and against its own laws."""

import json
import warnings
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import qpsolvers
from hypothesis import given
from hypothesis import strategies as st
from scipy.optimize import linprog

from hj_cosim.control.problem.enumeration import ENUMERATION
from hj_cosim.control.problem.safety_problem import (
    NOT_NEEDED,
    SafetyRows,
    SafetySolver,
    available_controls,
    least_slack,
)
from hj_cosim.errors import ConfigurationError
from hj_cosim.settings import FilterSettings, RobotSettings

CASES = json.loads((Path(__file__).parent / "fixtures" / "safety_qp.json").read_text(encoding="utf-8"))
ROBOT = RobotSettings()
BOX = np.array([-0.3, 0.3, -6.0, 4.0])
BACKENDS = ("daqp", "quadprog", "piqp", "osqp", "clarabel")


def rows_of(p, q, c):
    return SafetyRows(np.arange(len(p)), np.zeros(len(p)), np.array(p, float), np.array(q, float), np.array(c, float))


def cost_of(weights, rows, desired, control):
    """Return the paper's cost of a control (ω, a), with the t that it needs; `desired` likewise."""
    needed = -float((rows.p * control[0] + rows.q * control[1] + rows.c).min())
    return (
        weights.omega * (control[0] - desired[0]) ** 2
        + weights.acceleration * (control[1] - desired[1]) ** 2
        + weights.slack * (needed if weights.slack_is_free else max(needed, 0.0))
    )


def solver_for(case, backends=("daqp",)):
    settings = FilterSettings(
        scheme=case["mode"].lower(), slack_weight=case["lam"][2], solver=(backends or ("daqp",))[0]
    )
    solver = SafetySolver(settings, ROBOT, Counter())
    solver.backends = backends
    return solver


def check_against(case, solver, tolerance):
    rows = rows_of(case["p"], case["q"], case["c"])
    desired = (case["w_des"], case["a_des"])
    solution = solver.solve(rows, *desired, np.array(case["box"]))
    cost = cost_of(solver.weights, rows, desired, (solution.omega, solution.acceleration))
    assert cost == pytest.approx(case["objective"], abs=tolerance)
    assert solution.slack == pytest.approx(case["t"], abs=tolerance)
    assert case["box"][0] <= solution.omega <= case["box"][1]
    assert case["box"][2] <= solution.acceleration <= case["box"][3]
    return solution


@pytest.mark.parametrize("backend", BACKENDS)
def test_every_backend_gives_the_oracle_s_control(backend):
    for case in CASES:
        solver = solver_for(case, (backend,))
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # a backend that fails says so; it is counted, too
            solution = check_against(case, solver, 1e-3 if backend == "osqp" else 1e-4)
        assert solution.backend in (backend, ENUMERATION, NOT_NEEDED)
        assert solver.counts[f"{backend} failed"] == (solution.backend == ENUMERATION)


def test_enumeration_is_exact():
    for case in CASES:
        solution = check_against(case, solver_for(case, ()), 1e-9)
        assert solution.omega == pytest.approx(case["omega"], abs=1e-7)
        assert solution.acceleration == pytest.approx(case["a"], abs=1e-6)


def test_the_default_backend_never_fails_on_the_oracle():
    for case in CASES:
        solver = solver_for(case)
        check_against(case, solver, 1e-4)
        assert not solver.counts


coefficients = st.tuples(st.floats(-300, 300), st.floats(-8, 8), st.floats(-40, 40))


@given(
    rows=st.lists(coefficients, min_size=1, max_size=5),
    desired=st.tuples(st.floats(-1, 1), st.floats(-10, 10)),
    scheme=st.sampled_from(["mi", "sw"]),
    weight=st.sampled_from([1.0, 10.0, 100.0]),
    other=st.tuples(st.floats(-0.3, 0.3), st.floats(-6, 4)),
)
def test_no_control_in_the_box_is_cheaper_than_enumeration_s_and_daqp_agrees(rows, desired, scheme, weight, other):
    half_planes = rows_of(*zip(*rows, strict=True))
    solver = SafetySolver(FilterSettings(scheme=scheme, slack_weight=weight), ROBOT, Counter())
    by_daqp = solver.solve(half_planes, *desired, BOX)
    solver.backends = ()
    exact = solver.solve(half_planes, *desired, BOX)
    cost = cost_of(solver.weights, half_planes, desired, (exact.omega, exact.acceleration))
    assert cost <= cost_of(solver.weights, half_planes, desired, other) + 1e-9 * (1 + abs(cost))
    daqp_cost = cost_of(solver.weights, half_planes, desired, (by_daqp.omega, by_daqp.acceleration))
    assert daqp_cost == pytest.approx(cost, abs=1e-6 * (1 + abs(cost)))


def test_where_the_desired_control_meets_all_rows_mi_needs_no_solver_and_agrees_with_one():
    rows = rows_of([3.0, -2.0], [-1.0, -1.0], [4.0, 4.0])
    solver = SafetySolver(FilterSettings(), ROBOT, Counter())
    solution = solver.solve(rows, 0.1, 1.0, BOX)
    assert (solution.omega, solution.acceleration, solution.slack) == (0.1, 1.0, 0.0)
    assert solution.backend == NOT_NEEDED
    assert solver.solve(rows, 0.1, 3.9, BOX).backend == "daqp"
    assert solver.solve(rows, 0.31, 1.0, BOX).backend == "daqp"


def test_where_enumeration_is_chosen_no_backend_is_asked_and_none_fails():
    counts: Counter = Counter()
    chosen = SafetySolver(FilterSettings(solver=ENUMERATION), ROBOT, counts)
    rows = rows_of([3.0, -2.0], [-1.0, -1.0], [4.0, 4.0])
    by_daqp = SafetySolver(FilterSettings(), ROBOT, counts).solve(rows, 0.1, 3.9, BOX)
    solution = chosen.solve(rows, 0.1, 3.9, BOX)
    assert solution.backend == ENUMERATION
    assert not counts
    assert (solution.omega, solution.acceleration) == pytest.approx((by_daqp.omega, by_daqp.acceleration), abs=1e-6)


def test_without_violation_mi_changes_nothing_and_sw_keeps_away_from_the_rows():
    rows = rows_of([0.0], [-1.0], [20.0])  # a <= 20
    interventional = SafetySolver(FilterSettings(scheme="mi"), ROBOT, Counter()).solve(rows, 0.1, 1.0, BOX)
    assert (interventional.omega, interventional.acceleration) == pytest.approx((0.1, 1.0), abs=1e-8)
    switching = SafetySolver(FilterSettings(scheme="sw"), ROBOT, Counter()).solve(rows, 0.1, 1.0, BOX)
    assert switching.acceleration == pytest.approx(-6.0, abs=1e-5)
    assert switching.slack == pytest.approx(-26.0, abs=1e-4)


def test_a_backend_that_fails_is_answered_by_the_next_and_counted(monkeypatch):
    case = next(case for case in CASES if case["mode"] == "MI" and case["K"] == 3)
    solver = SafetySolver(FilterSettings(scheme="mi", slack_weight=1.0), ROBOT, Counter())
    whole = qpsolvers.solve_problem

    def failing(problem, solver, **options):
        if solver == "daqp":
            raise qpsolvers.exceptions.SolverError("out of order")
        solution = whole(problem, solver, **options)
        if solver == "piqp":
            solution.x = solution.x + 1.0  # an answer outside the box is a failure, too
        return solution

    monkeypatch.setattr(qpsolvers, "solve_problem", failing)
    solution = check_against(case, solver, 1e-4)
    assert solution.backend == "clarabel"
    assert solver.counts == {"daqp failed": 1, "piqp failed": 1}


def test_nobody_falls_back_on_quadprog_which_may_never_end():
    for chosen in ("daqp", "osqp"):
        assert "quadprog" not in SafetySolver(FilterSettings(solver=chosen), ROBOT, Counter()).backends
    assert SafetySolver(FilterSettings(solver="quadprog"), ROBOT, Counter()).backends[0] == "quadprog"


def test_enumeration_answers_when_all_backends_fail(monkeypatch):
    case = CASES[0]
    solver = solver_for(case, BACKENDS)
    monkeypatch.setattr(qpsolvers, "solve_problem", lambda problem, *_, **__: qpsolvers.Solution(problem, found=False))
    assert check_against(case, solver, 1e-9).backend == ENUMERATION
    assert solver.counts.total() == len(BACKENDS)


def test_a_backend_that_is_not_installed_is_named(monkeypatch):
    monkeypatch.setattr(qpsolvers, "available_solvers", ["daqp"])
    with pytest.raises(ConfigurationError, match=r"filter.solver = 'piqp' is not installed.*daqp"):
        SafetySolver(FilterSettings(solver="piqp"), ROBOT, Counter())


def test_least_slack_is_zero_where_rows_can_be_met_and_else_the_least_violation():
    assert least_slack(rows_of([1.0, -1.0], [0.0, 0.0], [0.1, 0.1]), BOX) == pytest.approx(0.0, abs=1e-9)
    # ω >= 0.2 and ω <= -0.2: in the middle each is missed by 0.2.
    assert least_slack(rows_of([1.0, -1.0], [0.0, 0.0], [-0.2, -0.2]), BOX) == pytest.approx(0.2, abs=1e-9)
    # a >= 10 is missed by 6 at a = 4.
    assert least_slack(rows_of([0.0], [1.0], [-10.0]), BOX) == pytest.approx(6.0, abs=1e-9)


@pytest.mark.parametrize("count", [5, 40, 500])
def test_least_slack_of_many_rows_is_the_linear_program_s(count):
    draw = np.random.default_rng(count)
    for _ in range(5):
        rows = rows_of(draw.uniform(-300, 300, count), draw.uniform(-8, 8, count), draw.uniform(-40, 80, count))
        program = linprog(
            [0.0, 0.0, 1.0],
            A_ub=-np.column_stack([rows.p, rows.q, np.ones(count)]),
            b_ub=rows.c,
            bounds=[(-0.3, 0.3), (-6.0, 4.0), (0.0, None)],
        )
        assert least_slack(rows, BOX) == pytest.approx(program.fun, abs=1e-6)


@pytest.mark.parametrize("scheme", ["mi", "sw"])
def test_enumeration_of_many_rows_costs_what_daqp_s_solution_costs(scheme):
    draw = np.random.default_rng(2)
    for count in (5, 40, 500):
        rows = rows_of(draw.uniform(-300, 300, count), draw.uniform(-8, 8, count), draw.uniform(-40, 80, count))
        solver = SafetySolver(FilterSettings(scheme=scheme), ROBOT, Counter())
        by_daqp = solver.solve(rows, 0.1, 1.0, BOX)
        assert by_daqp.backend == "daqp"
        solver.backends = ()
        exact = solver.solve(rows, 0.1, 1.0, BOX)
        cost = cost_of(solver.weights, rows, (0.1, 1.0), (exact.omega, exact.acceleration))
        daqp_cost = cost_of(solver.weights, rows, (0.1, 1.0), (by_daqp.omega, by_daqp.acceleration))
        assert cost == pytest.approx(daqp_cost, rel=1e-6)
        assert exact.slack == pytest.approx(by_daqp.slack, abs=1e-5)


def test_controls_that_would_leave_the_table_are_not_available_and_those_that_lead_back_are():
    bounds, step = np.array([-0.4, 0.4, 0.0, 40.0]), 0.02
    np.testing.assert_array_equal(available_controls(BOX, 0.0, 20.0, bounds, step), BOX)
    np.testing.assert_allclose(available_controls(BOX, 0.399, 0.01, bounds, step), [-0.3, 0.05, -0.5, 4.0])
    np.testing.assert_allclose(available_controls(BOX, -0.6, 41.0, bounds, step), [0.3, 0.3, -6.0, 0.0])
    np.testing.assert_allclose(available_controls(BOX, 0.402, 20.0, bounds, step), [-0.3, -0.1, -6.0, 4.0])
