"""Exercises of lesson 08, Standing, shifting, stepping, walking."""

from __future__ import annotations

from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import NumericJudge, ShapeJudge
from floatbase.lessons.lesson08.helpers import (
    uneven_stance,
)
from floatbase.lessons.lesson08.verdicts import (
    BUMP_MISTAKES,
    bump_coefficients,
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
        statement="RR stands 6 cm further back. The shortest shift of x_c, (2,), mm, forwards and "
        "to the left, after which "
        "FR can be lifted.",
        stub="way = np.zeros(2)  # replace: forwards and to the left, mm",
        solution="feet = dict(zip(contacts.names, contacts.positions(uneven)))\n"
        'a, b = feet["FL_foot"][:2], feet["RR_foot"][:2]\n'
        "across = np.array([a[1] - b[1], b[0] - a[0]]) / np.linalg.norm(b - a)\n"
        "way = 1000 * ((a - uneven.com[:2]) @ across) * across",
        judge=ShapeJudge(
            NumericJudge(
                right=com_shift,
                praise="The nearest point of the diagonal FL-RR: there RL carries nothing, and a "
                "bit further FR may lift.",
                mistakes=shift_mistakes(),
                hints={
                    "zero": "There is nothing there yet: where is the centre of mass, and where "
                    "may it be without FR?",
                    "sign": "The sign: this way leads further away from the other three feet.",
                    "metres": "In mm, please; these are metres.",
                    "usual_stance": "That is the way for the usual stance; here RR stands further "
                    "back.",
                    "usual_feet": "The feet are those of the usual stance; "
                    "contacts.positions(uneven) tells where they stand "
                    "here.",
                    "order": "The order: first forwards, then to the left.",
                    "y_sign": "To the left is positive, as y is.",
                    "x_sign": "Forwards is positive, as x is.",
                    "other_foot": "That way frees FL. Which two feet does FR's triangle share with "
                    "the other one?",
                    "from_middle": "It starts in the middle of the feet. The weight acts at the "
                    "centre of mass.",
                    "to_middle": "That ends in the middle of the three feet: safe, and longer than "
                    "it must be.",
                    "straight_back": "Straight back it works, too, and it is longer than it must "
                    "be.",
                    "straight_left": "Straight to the left it works, too, and it is longer than it "
                    "must be.",
                },
                tolerance=0.02,
            ),
            {
                (3,): "Two numbers: heights do not count.",
                (): "Two numbers: how far forwards and how far to the left.",
            },
        ),
        explanation="Without FR the triangle ends at the line from FL to RR. The shortest way to a "
        "line is across it.",
        namespace=lambda: {"uneven": uneven_stance()},
    ),
    Exercise(
        name="08.2",
        statement="The coefficients of u⁰ to u⁶, (7,), m, of a bump that is at rest at u = 0 and "
        "1, without acceleration "
        "there, and 0.05 m high half-way.",
        stub="coefficients = np.zeros(7)  # replace: coefficients of u⁰, u¹, …, u⁶, in m",
        solution="coefficients = 0.05 * 64 * np.array([0, 0, 0, 1, -3, 3, -1])  # 64 u³ (1 - u)³",
        judge=ShapeJudge(
            NumericJudge(
                right=bump_coefficients,
                praise="64 u³ (1 - u)³: a factor of three at each end for position, velocity and "
                "acceleration.",
                mistakes=BUMP_MISTAKES,
                hints={
                    "zero": "There is nothing there yet: it stays on the ground.",
                    "parabola": "A parabola: it is not at rest at either end.",
                    "of_the_lesson": "This is the lesson's own bump: its acceleration jumps at "
                    "both ends.",
                    "stays_up": "This goes up and stays there: at u = 1 the foot must be down "
                    "again.",
                    "height": "The shape is right and the height is not: how much is u³ (1 - u)³ "
                    "half-way?",
                    "height_1": "The shape is right; its height is 1. It should be 0.05 m.",
                    "millimetres": "In metres, please: this is in mm.",
                    "order": "The order: the first number belongs to u⁰, the last to u⁶.",
                    "sign": "The sign: this foot digs.",
                },
            ),
            {
                (
                    5,
                ): "Five numbers end at u⁴: with three conditions at each end and one half-way it "
                "takes seven.",
                (
                    6,
                ): "Six numbers end at u⁵: with three conditions at each end and one half-way it "
                "takes seven.",
            },
        ),
        explanation="A root of third order at u = 0 and at u = 1 takes away position, velocity and "
        "acceleration there.",
    ),
    Exercise(
        name="08.3",
        statement="anymal_kinova stands and is pushed backwards for 0.1 s: the largest force, N, "
        "by the rule of the "
        "capture point, the push taken as an impulse.",
        stub="force = 0.0  # replace: N",
        solution='arm = fb.load("anymal_kinova")\n'
        "stands = arm.standing()\n"
        "hind = fb.Contacts.points(arm).positions(stands)[:, 0].min()\n"
        "rate = np.sqrt(arm.gravity / stands.com[2])\n"
        "force = arm.mass * rate * (stands.com[0] - hind) / 0.1",
        judge=NumericJudge(
            right=hardest_push,
            praise="F T = m ω s: mass, pendulum, and the way to the edge.",
            mistakes=push_mistakes(),
            hints={
                "zero": "There is nothing there yet: where must the capture point stay?",
                "impulse": "That is the impulse, N·s. Over how long a time does the push give it?",
                "weight": "That is its weight in place of its mass.",
                "inverse": "ω is √(g/h), not √(h/g).",
                "no_root": "ω is √(g/h): the root is missing.",
                "base_height": "h is the height of the centre of mass above the feet, not that of "
                "the base.",
                "omega_of_go2": "That ω is go2's; this robot's centre of mass is higher.",
                "mass_of_go2": "That mass is go2's.",
                "both_of_go2": "Mass and ω are go2's.",
                "forwards": "That is a push forwards, against the front feet.",
                "from_origin": "Measure from the centre of mass, not from the world's origin.",
                "too_fine": "That is finer than what is asked: it lets the ground push back while "
                "the push lasts. Take an "
                "impulse.",
            },
            tolerance=0.005,
        ),
        explanation="The push gives the velocity v = F T / m; the capture point x + v/ω must not "
        "pass the hind feet.",
    ),
    Exercise(
        name="08.4",
        statement="A crawl, (swing, pause, speed), s, s and m/s: at least 600 mm in 6 s, x_c at "
        "least 32 mm inside the feet "
        "that stand, and never more than 80 N at a foot.",
        stub="design = np.array([0.3, 0.1, 0.08])  # swing, pause, s; speed, m/s",
        solution="design = np.array([0.3, 0.25, 0.12])",
        judge=judge_crawl,
        examples=crawl_examples,
        explanation="Margin comes from pauses, in which x_c shifts; quiet feet come from slow "
        "swings. Speed costs little: "
        "the steps become longer.",
    ),
)
