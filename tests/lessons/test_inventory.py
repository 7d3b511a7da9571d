"""The concept inventory: well formed, from known mistakes, and a gain per concept."""

from pathlib import Path

import numpy as np
import pinocchio
import pytest

import floatbase
from floatbase.errors import InputError
from floatbase.lessons import all_exercises, hand_in
from floatbase.lessons.inventory import (
    CONCEPTS,
    KEY,
    LETTERS,
    QUESTIONS,
    gain_report,
    inventory,
    mistakes,
    scores,
    stored_letters,
)
from floatbase.lessons.publish import grades
from floatbase.lessons.publish.__main__ import main
from floatbase.lessons.questions import all_questions

pytestmark = pytest.mark.usefixtures("learner")


def test_nine_concepts_have_three_questions_with_four_different_answers_each():
    assert len(CONCEPTS) == 9 and {len(some) for some in CONCEPTS.values()} == {3}
    assert len({question.text for question in QUESTIONS}) == 27
    for question in QUESTIONS:
        assert len(set(question.answers.values())) == 4
        assert question.right in question.answers
    # guessing one letter pays for nobody
    assert all(4 <= KEY.count(letter) <= 9 for letter in LETTERS)


def test_distractors_are_mistakes_that_the_course_knows():
    lessons = Path(floatbase.__file__).parent / "lessons"
    named = [mistake for q in QUESTIONS for mistake in q.mistakes.values()]
    assert sum(bool(q.mistakes) for q in QUESTIONS) >= 20 and len(named) >= 36
    assert all(set(q.mistakes) <= set(q.answers) - {q.right} for q in QUESTIONS)
    for mistake in named:
        name, hint = mistake.split(":")
        if name[-1].isdigit():
            assert name in all_exercises()
            folder = lessons / f"lesson{name.split('.')[0]}"
            assert any(f'"{hint}"' in path.read_text() for path in folder.glob("*.py")), mistake
        else:
            assert hint in all_questions()[name].choices, mistake


def right_answer(words):
    """The right answer to the only question with these words."""
    (found,) = [question for question in QUESTIONS if words in question.text]
    return found.answers[found.right]


def test_right_numbers_follow_from_plain_formulas():
    g = 9.8
    assert right_answer("16 kg accelerates upwards") == f"{16 * (g + 2):.0f} N"
    assert right_answer("80 N in total") == f"{np.cross([0, 0.15, 0], [0, 0, 80])[0]:.0f} N·m"
    assert right_answer("steepest slope") == f"{np.degrees(np.arctan(0.5)):.0f}°"
    assert "up to 70 N" in right_answer("presses on the level floor")
    assert right_answer("capture point") == f"{0.5 * np.sqrt(0.39 / g):.2f} m"
    # min ½ x² - 3 x for x <= 0 has the multiplier 3; with x <= 0.1 it is lower by nearly 0.3
    assert right_answer("multiplier 3") == f"{np.round(0.5 * 0.1**2 - 3 * 0.1, 1)}"
    corners = np.array([[x, y, -0.3] for x in (0.2, -0.2) for y in (0.1, -0.1)])
    skew = np.array([np.cross(np.eye(3), -corner) for corner in corners])  # f -> corner × f
    wrench = np.vstack([np.tile(np.eye(3), 4), np.hstack([part.T for part in skew])])
    assert np.allclose(wrench[3:] @ np.ones(12), np.cross(corners, np.ones(3)).sum(axis=0))
    assert right_answer("corners of a rectangle") == str(12 - np.linalg.matrix_rank(wrench))
    vertical = wrench[[2, 3, 4]][:, 2::3]  # sum and moments of the loads of FL, FR, RL, RR
    change = np.linalg.svd(vertical)[2][3]
    assert np.allclose(change / change[0], [1, -1, -1, 1])
    assert right_answer("10 N less").startswith("The rear right foot carries less")


@pytest.mark.parametrize("name", ["go2", "solo12", "hyq"])
def test_right_answers_about_a_quadruped_are_those_of_pinocchio(name):
    robot = floatbase.load(name)
    state = robot.standing()
    contacts = floatbase.Contacts.points(robot)
    model, data = robot.model, robot.model.createData()
    mass = pinocchio.computeTotalMass(model)
    M = pinocchio.crba(model, data, state.q)
    M = np.triu(M) + np.triu(M, 1).T
    h = pinocchio.rnea(model, data, state.q, 0 * state.v, 0 * state.v)
    J = contacts.jacobian(state)
    solve = np.linalg.solve
    # motors off, feet fixed: M q̈ + h = Jᵀλ and J q̈ = 0
    force = solve(J @ solve(M, J.T), J @ solve(M, h))
    assert 0.01 < force[2::3].sum() / (9.81 * mass) < 0.9
    assert right_answer("motors are switched off") == "a part of the weight"
    S = np.vstack([np.zeros((6, 12)), np.eye(12)])
    assert right_answer("does no motor torque appear") == str(18 - np.linalg.matrix_rank(S))
    # torques -> acceleration of the centre of mass, with the contact forces that they cause
    to_force = solve(J @ solve(M, J.T), -J @ solve(M, S))
    to_com = (np.tile(np.eye(3), 4) @ to_force) / mass
    assert right_answer("this cost flat") == str(12 - np.linalg.matrix_rank(to_com, 1e-9))
    # the drift of a foot grows with the square of the velocity
    v = np.random.default_rng(0).standard_normal(18)
    drifts = []
    for k in (1, 2):
        pinocchio.forwardKinematics(model, data, state.q, k * v, 0 * v)
        joint = model.getJointId(model.names[-1])
        drifts.append(pinocchio.getClassicalAcceleration(
            model, data, joint, pinocchio.LOCAL_WORLD_ALIGNED).linear)  # fmt: skip
    assert np.allclose(drifts[1], int(right_answer("leaves out the drift")) * drifts[0])


def test_two_students_gain_what_they_learned(learner, monkeypatch, capsys):
    """A guesser learns two concepts; another one knows half and loses nothing."""
    wrong = "".join("b" if right == "a" else "a" for right in KEY)
    files = []
    for name, before, after in (
        ("Ada", wrong, KEY[:6] + wrong[6:]),
        ("Emmy", KEY[:12] + wrong[12:], KEY[:26] + "-"),
    ):
        monkeypatch.setenv("FLOATBASE_HOME", str(learner / name))
        for time, letters in (("before", before), ("after", after)):
            inventory(time, f" {letters[:10].upper()} {letters[10:]}")
        assert stored_letters() == {"before": before, "after": after}
        files.append(str(hand_in(name)))
    first = scores(wrong)
    assert first is not None and set(first.values()) == {0} and scores(KEY[:-1]) is None
    capsys.readouterr()
    main(["grade", *files, files[0], "--inventory"])  # a student may hand in again
    report = capsys.readouterr().out.splitlines()[-11:]
    assert report[0].endswith("(2 learners)")
    numbers = {line[:24].strip(): line[24:].split() for line in report[1:]}
    assert numbers["rows without a motor"] == ["50%", "100%", "1.00"]
    assert numbers["drift"] == ["50%", "50%", "0.00"]
    assert numbers["balance"] == ["0%", "33%", "0.33"]
    assert numbers["all"] == ["22%", "59%", "0.48"]
    assert len(mistakes(wrong)) > 5 and mistakes(KEY) == []
    assert grades.grade_file(files[0]).inventory["before"] == wrong


def test_questions_are_printed_without_the_key_and_odd_answers_are_refused(capsys):
    inventory()
    shown = capsys.readouterr().out
    assert shown.count("   a) ") == 27 and KEY not in shown
    for time, letters in (("before", KEY[:-1]), ("before", "e" * 27), ("now", KEY)):
        with pytest.raises(InputError):
            inventory(time, letters)
    assert stored_letters() == {}
    with pytest.raises(InputError, match="before and after"):
        gain_report([{}, {"before": KEY}, {"before": 5, "after": [KEY]}])
