"""Concept inventory for contact and floating bases: 27 questions before and after the course.

Nine concepts have three questions each: one about a principle, one about a number, one about a
situation. It has not been validated on a class.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from floatbase._validation import as_string
from floatbase.errors import InputError
from floatbase.lessons import progress

TIMES = ("before", "after")
LETTERS = "abcd"
SKIPPED = "-"
_ENTRY = "inventory {}"  # in the progress file


class InventoryQuestion(NamedTuple):
    """Question with four answers."""

    text: str
    right: str
    wrong: dict[str, str]
    place: int

    @property
    def answers(self) -> list[str]:
        """The four answers in the order in which they are shown."""
        shown = list(self.wrong)
        shown.insert(self.place, self.right)
        return shown


_Q = InventoryQuestion
CONCEPTS: dict[str, tuple[InventoryQuestion, ...]] = {
    "rows without a motor": (
        _Q("A legged robot is in free fall. Can its motors change the acceleration of its base?",
           "Yes, because the inertia couples the base and the joints.",
           {"No, because torques act only on the joints.": "01.e:true",
            "Only in the instant in which a foot touches the ground.": "",
            "Yes, but they can only turn the base, not shift it.": ""}, 1),
        _Q("A quadruped has a floating base and 12 motors. In how many of its 18 equations of "
           "motion does no motor torque appear?", "6",
           {"0": "", "1": "02.1:base_is_one", "12": ""}, 2),
        _Q("A robot arm is unscrewed from the floor and stands on a plate that moves with it. "
           "What changes in its equations of motion?",
           "Six rows for the base are added, without any motor torque.",
           {"Nothing, but the motors of the arm need larger torques.": "",
            "One row for the motion of the plate is added.": "02.1:base_is_one",
            "Six rows for the base are added, with six new motor torques.": ""}, 3),
    ),
    "contact forces": (
        _Q("The equations of this course treat the ground as rigid. What determines the contact "
           "forces on feet that do not slip?", "The condition that the feet stay where they are.",
           {"The controller, which sends them to the feet.": "",
            "The depth to which each foot sinks into the ground.": "",
            "The weight alone, of which each foot carries a quarter.": "00.a:a quarter"}, 0),
        _Q("The centre of mass of a robot of 16 kg accelerates upwards at 2 m/s² (g = 9.8 m/s²). "
           "How large is the sum of the vertical contact forces?", "189 N",
           {"157 N": "00.1:weight_alone", "32 N": "00.1:ma_alone", "125 N": "00.1:downwards"}, 3),
        _Q("A quadruped stands with bent legs, and all motors are switched off. How much of the "
           "weight do its feet carry in the first instant, as it begins to collapse?",
           "a part of the weight",
           {"nothing": "03.d:it falls freely", "the whole weight": "03.d:it stands",
            "more than the weight": ""}, 1),
    ),
    "drift": (
        _Q("A foot must not move: J q̇ = 0 at all times. What follows for the accelerations?",
           "J q̈ = -J̇ q̇", {"J q̈ = 0": "03.1:b_missing", "J q̈ = J̇ q̇": "03.1:b_sign",
                             "q̈ = 0": ""}, 2),
        _Q("A controller demands J q̈ = 0 for a foot that should stay, and leaves out the drift "
           "term. All velocities of the robot, in the same posture, are doubled. By which factor "
           "does the unwanted acceleration of the foot grow?", "4",
           {"1, since the foot is at rest": "03.1:b_missing", "2": "", "8": ""}, 2),
        _Q("A controller forgets the drift term, and in a fast motion a hand that should stay in "
           "place moves by 3 cm. Control and simulation are repeated with half the time step. How "
           "far does the hand move now?", "about 3 cm",
           {"about 1.5 cm": "", "about 0.8 cm": "", "hardly at all": ""}, 0),
    ),
    "internal forces": (
        _Q("A robot stands still. The ground pushes its front left foot to the left and its front "
           "right foot to the right, each a little harder than before. What changes?",
           "The friction that these feet use, but not the motion.",
           {"The robot starts to move.": "03.g:it moves",
            "The sum of the vertical forces.": "03.2:weight",
            "Nothing, neither the motion nor the friction.": ""}, 1),
        _Q("Four point feet stand on the corners of a rectangle. In how many independent ways can "
           "the 12 force components change without changing the total force and moment?", "6",
           {"0": "", "3": "", "12": ""}, 2),
        _Q("A quadruped stands on level ground. Its front left foot is to carry 10 N less, and the "
           "robot must not move. What do the other feet do?",
           "The rear right foot carries less, the other two carry more.",
           {"They carry the same as before. The sum decreases by 10 N.": "03.2:weight",
            "The front right foot carries 10 N more, and the rear feet the same.": "03.2:moments",
            "Each of the other three carries a third of the 10 N more.": "03.2:moments"}, 3),
    ),
    "costs": (
        _Q("All weights in the cost of a controller's QP are multiplied by 1000, and its "
           "constraints stay. What does the robot do differently?", "Nothing.",
           {"It needs other torques for the same motion.": "P.i:only the torques",
            "It needs other torques, and moves differently.": "P.i:torques and motion",
            "It violates some constraints.": ""}, 0),
        _Q("A quadruped stands on four feet. A cost of its 12 torques is zero where the centre of "
           "mass has one desired acceleration, three numbers. In how many independent directions "
           "of the torques is this cost flat?", "9",
           {"0": "", "3": "", "12": ""}, 2),
        _Q("A cart accelerates in proportion to its motor's torque. One cost asks for 2 m/s². A "
           "second cost, with a small weight, is the square of the torque. Which acceleration "
           "minimizes the sum?",
           "a little less than 2 m/s²",
           {"exactly 2 m/s²": "", "a little more than 2 m/s²": "", "0": ""}, 1),
    ),
    "momentum and wrench": (
        _Q("A robot floats at rest without gravity. Its joints move around a loop and come back to "
           "where they were. Which of these can differ from the start: the orientation of the "
           "base, or the position of the robot's centre of mass?", "the orientation only",
           {"neither of them": "01.g:both", "the centre of mass only": "01.g:orientation",
            "both of them": "01.g:neither"}, 2),
        _Q("The ground pushes up with 80 N in total at the two left feet, 0.15 m to the left of "
           "the centre of mass, and not at the right feet. x points forwards, y to the left, z up. "
           "What is the moment about the x axis through the centre of mass?", "12 N·m",
           {"-12 N·m": "05.b:negative", "0": "", "80 N·m": ""}, 0),
        _Q("A quadruped's body accelerates forwards over its feet, and does not turn. Which way "
           "do the contact forces lean, and which feet carry more than at rest?",
           "forwards, rear feet",
           {"forwards, front feet": "01.h:forwards, front feet",
            "backwards, rear feet": "01.h:backwards, rear feet",
            "backwards, front feet": "01.h:backwards, front feet"}, 3),
    ),
    "friction": (
        _Q("A controller replaces each round friction cone by a pyramid that lies inside the cone. "
           "What follows?", "Some forces that friction allows are no longer used.",
           {"Planned forces can need more friction than there is.": "06.2:outside",
            "Nothing, because the pyramid has the same μ.": "06.2:round",
            "Feet can pull on the ground.": ""}, 1),
        _Q("A foot stands on a slope with μ = 0.5, and its force is vertical. What is the steepest "
           "slope on which it does not slip?", "27°",
           {"30°": "06.2:sine", "45°": "06.2:45", "60°": ""}, 0),
        _Q("A foot presses on the level floor with 100 N, μ = 0.7, and does not slip. Which "
           "horizontal force can the floor exert on it?", "any force up to 70 N, in any direction",
           {"exactly 70 N": "", "any force up to 100 N": "06.1:no_mu",
            "up to 70 N, but only along x or y": ""}, 2),
    ),
    "multipliers": (
        _Q("At the minimum of a convex QP, an inequality constraint holds with room to spare. You "
           "delete the constraint. What happens to the minimum?", "It stays where it is.",
           {"It falls.": "", "It rises.": "07.2:sign", "There is none any more.": ""}, 3),
        _Q("An inequality constraint has the multiplier 3. Its bound is relaxed by 0.1. By how "
           "much does the minimum change, approximately?", "-0.3",
           {"+0.3": "07.2:sign", "-3": "07.2:whole_mu", "0": "07.2:zero"}, 1),
        _Q("A solver guesses that an inequality is active, and treats it as an equality. The "
           "multiplier that it finds is negative. What does that mean?",
           "The cost falls if the point leaves this constraint on its allowed side.",
           {"The minimum with all constraints has been found.": "C.3:pulls",
            "The point violates this constraint, so it must be kept.": "",
            "No point satisfies all the constraints of the problem.": ""}, 0),
    ),
    "balance": (
        _Q("A robot stands at rest on level ground. Seen from above, where can its centre of mass "
           "be?", "inside the convex hull of its feet",
           {"anywhere, if the friction is high enough": "",
            "exactly in the middle of its feet": "08.1:from_middle",
            "only above one of its feet": ""}, 2),
        _Q("A centre of mass at height 0.39 m moves at 0.5 m/s (g = 9.8 m/s², √25 = 5). How far "
           "ahead of it is the capture point?", "0.10 m",
           {"0.02 m": "08.2:no_root", "2.5 m": "08.2:inverse", "0": "08.2:zero"}, 0),
        _Q("A quadruped stands on four feet and is to lift the front right foot slowly. What must "
           "be true first?", "The centre of mass is above the triangle of the other feet.",
           {"Nothing, because three feet always suffice for standing.": "08.a:all four",
            "The centre of mass is straight above the rear left foot.": "",
            "The front left foot, next to it, carries the whole weight.": ""}, 1),
    ),
}  # fmt: skip
QUESTIONS = [question for some in CONCEPTS.values() for question in some]
KEY = "".join(LETTERS[question.place] for question in QUESTIONS)


def inventory(time: str = "", letters: str = "") -> None:
    """Print the questions of the concept inventory, or store your answers to them."""
    if not time:
        for number, question in enumerate(QUESTIONS, 1):
            print(f"{number}. {question.text}")
            for letter, answer in zip(LETTERS, question.answers, strict=True):
                print(f"   {letter}) {answer}")
        print(f'Answer with inventory("before", "…"), {len(QUESTIONS)} letters, - for no answer.')
        return
    if time not in TIMES:
        raise InputError(f"time must be one of {', '.join(TIMES)}, not {time!r}.")
    given = "".join(as_string("letters", letters).lower().split())
    if not _are_letters(given):
        raise InputError(
            f"letters must be {len(QUESTIONS)} letters from {LETTERS}, or {SKIPPED} for no answer; "
            f"you gave {len(given)}."
        )
    problem = progress.append(_ENTRY.format(time), {"letters": given, "time": progress.now()})
    print(problem or f"Your answers {time} the course are kept. hand_in(…) includes them.")


def _are_letters(given: Any) -> bool:
    return (
        isinstance(given, str)
        and len(given) == len(QUESTIONS)
        and set(given) <= {*LETTERS, SKIPPED}
    )


def stored_letters() -> dict[str, str]:
    """Return the learner's last answers, by time."""
    found = {time: progress.last(_ENTRY.format(time), "letters") for time in TIMES}
    return {time: letters for time, letters in found.items() if _are_letters(letters)}


def scores(letters: Any) -> dict[str, int] | None:
    """Return the number of right answers for each concept, or None if these are no answers."""
    if not _are_letters(letters):
        return None
    marks = iter(given == right for given, right in zip(letters, KEY, strict=True))
    return {name: sum(next(marks) for _ in some) for name, some in CONCEPTS.items()}


def mistakes(letters: str) -> list[str]:
    """Return the mistakes that led to wrong answers, such as "00.1:weight_alone"."""
    return [
        mistake
        for letter, question in zip(letters, QUESTIONS, strict=True)
        if letter != SKIPPED
        and (mistake := question.wrong.get(question.answers[LETTERS.index(letter)]))
    ]


def gain_report(answers: list[dict[str, Any]]) -> str:
    """Write the gain of a class for each concept."""
    found = [(scores(one.get("before")), scores(one.get("after"))) for one in answers]
    both = [(first, last) for first, last in found if first is not None and last is not None]
    if not both:
        raise InputError("There is no file with answers to the inventory before and after.")
    lines = [f"{'concept':24}before  after  gain ({len(both)} learners)"]
    rows = {name: [name] for name in CONCEPTS} | {"all": list(CONCEPTS)}
    for label, names in rows.items():
        most = len(both) * sum(len(CONCEPTS[name]) for name in names)
        first, last = (sum(one[i][name] for one in both for name in names) for i in (0, 1))
        gain = f"{(last - first) / (most - first):5.2f}" if first < most else "    -"
        lines.append(f"{label:24}{first / most:6.0%} {last / most:6.0%} {gain}")
    return "\n".join(lines)
