"""Lesson C: the game is fair, and solvers in the loop do what the lesson says of them."""

from itertools import combinations

import numpy as np
import pytest

import floatbase as fb
from floatbase.lessons import all_exercises, check, progress
from floatbase.lessons.lessonC import (
    PUZZLES,
    ActiveSetGame,
    SolverController,
    answer_or_default,
    check_active_set,
    corner_table,
    longest_step,
    row_to_drop,
    run_with_push,
    standing_controller,
)
from floatbase.qp import active_set, solve

# exercises ----------------------------------------------------------------------------------------


def test_stubs_with_functions_are_not_tries(monkeypatch, tmp_path):
    monkeypatch.setenv("FLOATBASE_HOME", str(tmp_path))
    for name in ("C.2", "C.3", "C.4"):
        made = {}
        exec("# of a cell\n\n" + all_exercises()[name].stub, {"np": np}, made)
        assert not check(name, next(iter(made.values()))).right
    assert progress.load() == {}
    check("C.2", lambda x, p, G, h, W: (1.0, None))
    check("C.4", ["RR_foot facet 2"])
    assert progress.load() == {name: {"tries": 1, "right": 0} for name in ("C.2", "C.4")}


def test_the_lesson_continues_with_an_answer_only_if_it_is_right(capsys):
    examples = all_exercises()["C.2"].examples()
    (mine, *_), (wrong, *_) = ([a for a, hint in examples if hint == x] for x in ("", "nearest"))
    assert answer_or_default("C.2", mine, longest_step) is mine
    assert "with your answer" in capsys.readouterr().out
    assert answer_or_default("C.2", wrong, longest_step) is longest_step
    assert "not right yet" in capsys.readouterr().out


# problems in the plane ----------------------------------------------------------------------------


def test_every_cost_of_the_game_has_exactly_one_solution():
    solutions = []
    for lowest in PUZZLES:
        qp = corner_table(lowest)
        names = [str(name) for name in qp.inequality_names]
        sets = [some for k in range(len(names) + 1) for some in combinations(names, k)]
        solved_by = [some for some in sets if not check_active_set(qp, some)[1]]
        assert solved_by == [solve(qp).active]
        solutions += solved_by
    assert len(set(solutions)) == 4 and max(map(len, solutions)) == 2


def test_buttons_of_the_game_switch_constraints_and_count_clicks():
    game = ActiveSetGame([(0.5, -1.0), (0.5, 1.0)])
    assert not game.solved
    for name, working, solved in (
        ("table", ("table",), True),
        ("ramp", ("table", "ramp"), False),
        ("ramp", ("table",), True),
    ):
        game.rows[name].click()
        assert (game.working, game.solved) == (working, solved)
    assert game.clicks == 3
    game.next.click()
    assert (game.working, game.clicks) == ((), 0)


def test_equal_solutions_of_any_solver_give_equal_torques():
    controller = standing_controller()
    state = controller.robot.standing().replace(v=0.5 * np.eye(18)[1])
    for solver in (lambda qp: solve(qp).x, lambda qp: active_set(qp).solution.x):
        found = SolverController(controller, solver)(state.q, state.v, 0.0)
        expected = controller(state.q, state.v)
        assert np.allclose(found.tau, expected.tau, atol=1e-6)
        assert np.allclose(np.ravel(found.forces), np.ravel(expected.forces), atol=1e-6)
    with pytest.raises(fb.FloatbaseError, match="x has shape"):
        SolverController(controller, lambda qp: np.zeros(3))(state.q, state.v, 0.0)


def walked(qp, x, most):
    """The lesson's loop around the two solutions: where it ends, and after how many rounds."""
    W = []
    for rounds in range(1, most + 1):
        G = qp.G[W]
        KKT = np.block([[qp.H, G.T], [G, np.zeros((len(W), len(W)))]])
        found = np.linalg.solve(KKT, np.concatenate([-qp.g, qp.h[W]]))
        p = found[: qp.n] - x
        length, blocking = longest_step(x, p, qp.G, qp.h, W)
        x = x + length * p
        pulls = row_to_drop(W, found[qp.n :]) if blocking is None else None
        if blocking is not None:
            W.append(blocking)
        elif pulls is None:
            return x, rounds
        else:
            W.remove(pulls)
    return x, most + 1


def test_the_solver_of_the_lesson_ends_at_every_step_of_a_large_push():
    """At 150 N four facets of one foot are met at once: a speed that is rounding once let it go
    round for ever.
    """
    controller = standing_controller()
    quarter = np.tile([0.0, 0.0, controller.robot.weight / 4], 4)

    def solver(qp):
        space = qp.equality_space
        start = np.linalg.solve(space.A[30:], quarter - space.b[30:])
        beta, rounds = walked(qp.reduced, start, most=60)
        assert rounds <= 60
        assert np.allclose(space(beta), solve(qp).x, atol=1e-6)
        return space(beta)

    assert run_with_push(SolverController(controller, solver), 150.0, 0.3).outcome == "completed"


@pytest.mark.front_end
def test_a_warm_start_saves_rounds_because_problems_follow_one_another():
    controller = standing_controller()
    record = run_with_push(controller, 100.0, 0.16)
    problems = [controller.qp(record.state(i)) for i in range(40, 160)]

    def rounds(order):
        working, total = (), 0
        for i in order:
            run = active_set(problems[i], working_set=working)
            total += len(run.phase_one) + len(run.iterations)
            working = run.working_set
        return total

    in_order = rounds(range(120))
    assert in_order < 1.2 * 120 < 4 * 120 < rounds(np.random.default_rng(1).permutation(120))
