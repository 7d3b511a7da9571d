"""Exercises of lesson 08, Standing, shifting, stepping, walking."""

from __future__ import annotations

from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NumericJudge, ShapeJudge
from floatbase.lessons.lesson08.helpers import (
    uneven_stance,
)
from floatbase.lessons.lesson08.verdicts import (
    com_shift,
    crawl_examples,
    hardest_push,
    judge_crawl,
    push_mistakes,
    shift_mistakes,
)

EXERCISES = (
    Exercise(
        name="08.1",
        statement="RR stands 6 cm further back. Find the shortest shift of x_c, shape (2,), mm, "
        "forwards and to the left, after which FR can be lifted.",
        stub="way = np.zeros(2)  # replace: forwards and to the left, mm",
        solution="feet = dict(zip(contacts.names, contacts.positions(uneven)))\n"
        'a, b = feet["FL_foot"][:2], feet["RR_foot"][:2]\n'
        "across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)\n"
        "way = 1000 * ((a - uneven.com[:2]) @ across) * across",
        judge=ShapeJudge(
            NumericJudge(
                right=com_shift,
                praise="This is the nearest point of the diagonal FL-RR. There RL carries "
                "nothing, and a little further on FR may lift.",
                mistakes=shift_mistakes(),
                hints={
                    "zero": "There is no answer yet. Where is the centre of mass, and where may "
                    "it be without FR?",
                    "sign": "The sign is wrong: this shift leads further away from the other "
                    "three feet.",
                    "metres": "The answer must be in mm. This is in metres.",
                    "usual_stance": "That is the shift for the usual stance. Here RR stands "
                    "further back.",
                    "usual_feet": "These are the feet of the usual stance. "
                    "contacts.positions(uneven) gives their positions here.",
                    "order": "The order is wrong: first forwards, then to the left.",
                    "y_sign": "To the left is positive, like y.",
                    "x_sign": "Forwards is positive, like x.",
                    "other_foot": "That shift frees FL. Which two feet belong both to the "
                    "triangle without FR and to the triangle without RL?",
                    "from_middle": "This shift starts in the middle of the feet. The weight "
                    "acts at the centre of mass.",
                    "to_middle": "That ends in the middle of the three feet, which is safe, but "
                    "longer than necessary.",
                    "straight_back": "Straight back works, too, but it is longer than necessary.",
                    "straight_left": "Straight to the left works, too, but it is longer than "
                    "necessary.",
                },
                tolerance=0.02,
            ),
            {
                (3,): "The answer has two numbers: heights do not count.",
                (): "The answer has two numbers: how far forwards and how far to the left.",
            },
        ),
        explanation="Without FR the triangle ends at the line from FL to RR. The shortest way "
        "to a line is perpendicular to it.",
        namespace=lambda: {"uneven": uneven_stance()},
    ),
    Exercise(
        name="08.2",
        statement="anymal_kinova stands and is pushed backwards for 0.1 s. What is the largest "
        "force, N, by the capture-point rule, if the push is treated as an impulse?",
        stub="force = 0.0  # replace: N",
        solution='arm = fb.load("anymal_kinova")\n'
        "stands = arm.standing()\n"
        "hind = fb.Contacts.points(arm).positions(stands)[:, 0].min()\n"
        "rate = np.sqrt(arm.gravity / stands.com[2])\n"
        "force = arm.mass * rate * (stands.com[0] - hind) / 0.1",
        judge=NumericJudge(
            right=hardest_push,
            praise="F T = m ω s: mass, pendulum, and distance to the edge.",
            mistakes=push_mistakes(),
            hints={
                "zero": "There is no answer yet. Where must the capture point stay?",
                "impulse": "That is the impulse, N·s. How long does the push act?",
                "weight": "That uses the weight instead of the mass.",
                "inverse": "ω is √(g/h), not √(h/g).",
                "no_root": "The square root is missing: ω is √(g/h).",
                "base_height": "h is the height of the centre of mass above the feet, not of "
                "the base.",
                "omega_of_go2": "That is the ω of go2. The centre of mass of this robot is higher.",
                "mass_of_go2": "That is the mass of go2.",
                "both_of_go2": "Mass and ω are those of go2.",
                "forwards": "That is a push forwards, towards the front feet.",
                "from_origin": "Measure from the centre of mass, not from the world's origin.",
                "too_fine": "That is more precise than the question: it lets the ground push "
                "back while the push lasts. Treat the push as an impulse.",
            },
            tolerance=0.005,
        ),
        explanation="The push gives the velocity v = F T / m. The capture point x + v/ω must "
        "not pass the hind feet.",
    ),
    Exercise(
        name="08.3",
        statement="A crawl, (swing, pause, speed), in s, s and m/s, that covers at least 600 mm "
        "in 6 s. x_c must stay at least 32 mm inside the feet on the ground, and no foot may "
        "carry more than 80 N.",
        stub="design = np.array([0.3, 0.1, 0.08])  # swing, pause, s; speed, m/s",
        solution="design = np.array([0.25, 0.22, 0.14])",
        judge=judge_crawl,
        examples=crawl_examples,
        explanation="Pauses give margin, because x_c shifts during them. Slow swings give quiet "
        "feet. Speed costs little: the steps become longer.",
    ),
)
