"""Exercises of lesson X, The crash investigation."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np

from floatbase._validation import Array
from floatbase.lessons.exercises import Exercise
from floatbase.lessons.judges import (
    Example,
    Mistake,
    NumericJudge,
    ShapeJudge,
    Verdict,
    function_or_verdict,
)
from floatbase.lessons.lessonX import investigation
from floatbase.lessons.lessonX.black_box import BlackBox
from floatbase.lessons.lessonX.cases import (
    FAULTS,
    LARGEST_SEED,
    Case,
    black_boxes,
    faultless_boxes,
    faultless_cases,
    random_cases,
)
from floatbase.lessons.lessonX.diagnostics import required_forces
from floatbase.lessons.lessonX.verdicts import COUNTER_EVIDENCE, judge_line, mistaken

KICK_SEED = 5  # seed of the box of exercise X.1
# seeds from which the last exercise takes one fault each
_UNSEEN_SEEDS = (20611, 20612, 20613, 102, 20615, 20616)
_FAULTLESS_SEED = 20617  # seed of its two robots without a fault
_KICK_FORCE = 20.0  # N: a larger residual is a kick and not a jump of the simulation itself


# X.1 ----------------------------------------------------------------------------------------------


@cache
def kicked_box() -> BlackBox:
    """Return the record of a robot without a fault that was kicked."""
    return faultless_cases(KICK_SEED)[1].record()


@cache
def _residual() -> tuple[Array, Array]:
    """Return the missing force on the base during the kick, (m, 3) [N], in base and world axes."""
    box = kicked_box()
    found = required_forces(box)[:, :3]
    rows = np.flatnonzero(np.linalg.norm(found, axis=1) > _KICK_FORCE)
    rows = rows[box.time[rows] < faultless_cases(KICK_SEED)[1].pushes[0].start + 0.2]
    return found[rows], np.array([_turned(i, found[i]) for i in rows])


def _turned(i: int | np.integer[Any], row: Array) -> Array:
    """Turn a force in base axes at row i, shape (3,) [N], into world axes."""
    return np.asarray(kicked_box().state(i).frame_pose("base").rotation @ row)


def _impulse() -> Array:
    """Return the impulse of the kick."""
    (push,) = faultless_cases(KICK_SEED)[1].pushes
    return np.asarray(push.force * push.duration)


def _momentum_change() -> Array:
    """Return the change of the robot's momentum during the kick."""
    box, (push,) = kicked_box(), faultless_cases(KICK_SEED)[1].pushes
    first, last = (
        int(np.searchsorted(box.time, push.start + part * push.duration)) for part in (0.0, 1.0)
    )
    return np.asarray(
        box.robot.mass * (box.state(last).com_velocity - box.state(first).com_velocity)
    )


@cache
def _kicks() -> list[Mistake]:
    forces = required_forces(kicked_box())[:, :3]
    (push,) = faultless_cases(KICK_SEED)[1].pushes
    return [
        ("zero", np.zeros(3), "There is no answer yet. Take the first three columns of what is "
         "missing from (7), and sum over time."),
        ("base_axes", 0.002 * _residual()[0].sum(axis=0), "These are the axes of the base, which "
         "turn. Convert each row to the world's axes by R before you sum."),
        ("no_duration", _residual()[1].sum(axis=0), "A sum of forces is not an impulse yet. Each "
         "row lasts 2 ms."),
        ("fall", 0.002 * np.sum([_turned(i, row) for i, row in enumerate(forces)], axis=0),
         "This includes the impacts of the fall. Use only the time of the kick."),
        ("force", push.force, "That is the force, N. How long did it act?"),
        ("momentum", _momentum_change(), "That is the change of the robot's momentum. The ground "
         "contributed to it, too."),
    ]  # fmt: skip


# X.2 ----------------------------------------------------------------------------------------------


def _judge_report(answer: Any) -> Verdict:
    """Judge a seed and a line for each of its boxes."""
    if answer is None or answer is Ellipsis:
        return Verdict(False, "There is no answer yet. The report is a list of lines.", "no_answer")
    is_list = isinstance(answer, list | tuple) and len(answer) > 0
    if not is_list or not all(isinstance(line, str) for line in answer):
        text = 'The report must be a list of lines of text, such as "A: mass 0.93".'
        return Verdict(False, text, "no_lines")
    seed = re.fullmatch(r"seed (\d{1,10})", answer[0].strip())
    if not seed or int(seed[1]) > LARGEST_SEED:
        text = 'The first line must give the seed of the boxes, as in "seed 7".'
        return Verdict(False, text, "no_seed")
    lines = {line.strip()[:1].upper(): line.split(":", 1)[1] for line in answer[1:] if ":" in line}
    reports = {name: line for name, line in lines.items() if line.strip(" ?.")}
    return _report_of(int(seed[1]), reports)


def _report_of(seed: int, reports: dict[str, str]) -> Verdict:
    """Judge the lines about the boxes of a seed; reports: name of a box -> its line."""
    cases = {case.name: case for case in random_cases(seed)}
    unknown = sorted(set(reports) - set(cases))
    if unknown:
        text = f"There is no box {unknown[0]}. The boxes are A to F, each on its own line."
        return Verdict(False, text, "no_such_box")
    if not reports:
        text = (
            'There is no line yet. A line names a fault and its evidence, such as "A: mass 0.93".'
        )
        return Verdict(False, text, "nothing_said")
    boxes = {box.name: box for box in black_boxes(seed)}
    verdicts = {
        name: judge_line(cases[name], boxes[name], line) for name, line in sorted(reports.items())
    }
    wrong = [f"{name}: {verdict.text}" for name, verdict in verdicts.items() if not verdict.right]
    solved = [name for name, verdict in verdicts.items() if verdict.right]
    left = [name for name in cases if name not in verdicts]
    if not wrong and not left:
        return Verdict(True, "Six faults, each with solid evidence. The insurance pays.")
    parts = [f"Solved: {', '.join(solved)}."] if solved else []
    parts += wrong
    parts += [f"Open: {', '.join(left)}."] if left else []
    hint = next((verdict.hint for verdict in verdicts.values() if not verdict.right), "open")
    return Verdict(False, "\n".join(parts), hint)


# X.3 ----------------------------------------------------------------------------------------------


@cache
def _unseen_case(i: int) -> tuple[Case, BlackBox]:
    """Return a case of the last exercise: six with a fault, then two without."""
    if i < len(FAULTS):
        case = next(
            case for case in random_cases(_UNSEEN_SEEDS[i]) if case.injected_fault.kind == FAULTS[i]
        )
        return case, replace(case.record(), name="unseen")
    sound = i - len(FAULTS)
    return faultless_cases(_FAULTLESS_SEED)[sound], replace(
        faultless_boxes(_FAULTLESS_SEED)[sound], name="unseen"
    )


def _judge_program(answer: Any) -> Verdict:
    """Judge a function of a box on unseen boxes of each kind."""
    program = function_or_verdict(answer)
    if isinstance(program, Verdict):
        return program
    for i in range(len(FAULTS) + 2):
        if wrong := _tried(program, *_unseen_case(i)):
            return wrong
    return Verdict(
        True,
        "Your program found six faults in unseen boxes, each with its evidence, and accused no "
        "innocent robot.",
    )


def _tried(program: Callable[[BlackBox], Any], case: Case, box: BlackBox) -> Verdict | None:
    """Return what is wrong with a program's answer about a box, or None."""
    kind = case.injected_fault.kind
    what = f"a robot with {kind}" if kind else "a robot without a fault"
    what += " that was kicked over" if case.pushes else ""
    try:
        line = program(box)
    except Exception as error:  # whatever a learner's function raises
        text = f"With {what}, your function stops with {type(error).__name__}: {error}"
        return Verdict(False, text, "stops")
    if not isinstance(line, str):
        text = (
            f'Return a line of text, such as "mass 0.93" or "nothing", not {type(line).__name__}.'
        )
        return Verdict(False, text, "no_text")
    verdict = judge_line(case, box, line)
    if verdict.right:
        return None
    text = f'About {what}, your program says "{line}": {verdict.text}'
    return Verdict(False, text, verdict.hint)


def _reports() -> list[Example]:
    """Return examples with the boxes of seed 1."""
    boxes = black_boxes(1)
    found = {box.name: investigation.investigate(box) for box in boxes}
    cases = {str(case.injected_fault.kind): case for case in random_cases(1)}
    report = ["seed 1", *(f"{name}: {line}" for name, line in found.items())]

    def but(fault: str, line: str) -> list[str]:
        """Return the report with a different line about the faulty box."""
        name = cases[fault].name
        return [f"{name}: {line}" if said.startswith(name) else said for said in report]

    right, wrong = cases["swapped motors"].injected_fault.joints, set(boxes[0].robot.joint_names)
    other, another = sorted(wrong - set(right))[:2]
    made: list[Example] = [
        (report, ""), ([f" {line} " for line in report], ""),
        (but("mass", found[cases["mass"].name].upper()), ""),
        (but("swapped motors", " and ".join(["swapped motors", *right[::-1]])), ""),
        (report[1:], "no_seed"),
        (["seed 1"], "nothing_said"), (["seed 1", "G: mass 0.9"], "no_such_box"),
        ("seed 1", "no_lines"),
        (report[:-1], "open"), (but("mass", "the cat"), "no_fault"),
        (but("friction", "friction"), "no_evidence"),
        (but("swapped motors", f"swapped motors {right[0]} {other}"), "one_joint"),
        (but("swapped motors", f"swapped motors {another} {other}"), "no_joint"),
        (but("swapped motors", f"swapped motors {right[0]}"), "not_two_joints"),
        (but("swapped motors", "swapped motors tail_joint"), "no_such_joint"),
    ]  # fmt: skip
    for fault, case in cases.items():
        made += [
            (but(fault, f"{said} 0.9"), f"not {said}") for said in COUNTER_EVIDENCE if said != fault
        ]
        box = boxes["ABCDEF".index(case.name)]
        made += [(but(fault, line), hint) for hint, line in mistaken(case, box).items()]
        hint = "not_two_joints" if fault == "swapped motors" else "evidence"
        made += [(but(fault, f"{fault} 987"), hint)]
    return made


def _programs() -> list[Example]:
    found = cache(investigation.investigate)
    return [
        (found, ""), (lambda box: "nothing", "not nothing"),
        (lambda box: "friction 0.55", "evidence"),
        (lambda box: found(box).replace("nothing", "friction 0.9"), "innocent"),
        (lambda box: found(box).split()[0], "no_evidence"), (lambda box: ("mass", 0.9), "no_text"),
        (lambda box: box.fault, "stops"), (lambda: "nothing", "stops"), ("nothing", "no_function"),
    ]  # fmt: skip


EXERCISES = (
    Exercise(
        name="X.1",
        stub="impulse = np.zeros(3)  # replace: N·s, in the world's axes",
        solution="missed = required_forces(kicked)[:, :3]\n"
        "rows = np.flatnonzero(np.linalg.norm(missed, axis=1) > 50)  # N\n"
        "rows = rows[rows < rows[0] + 100]  # the kick, and no blow of the fall\n"
        'R = [kicked.state(i).frame_pose("base").rotation for i in rows]\n'
        "impulse = 0.002 * sum(R_i @ missed[i] for R_i, i in zip(R, rows))",
        judge=ShapeJudge(
            NumericJudge(
                right=_impulse,
                praise="The kick was not recorded, and still you know how hard it was and where "
                "it came from.",
                mistakes=_kicks,
                tolerance=0.02,
            ),
            {
                (): "The answer has three numbers: an impulse has a direction.",
                (6,): "Only the force counts, three numbers, without its moment.",
            },
        ),
        examples=lambda: [(0.002 * _residual()[1].sum(axis=0), "")],
        explanation="Whatever touches the robot is missing from (7). No motor acts in the first "
        "rows, so no motor can be the cause.",
        namespace=lambda: {"kicked": kicked_box(), "required_forces": required_forces},
    ),
    Exercise(
        name="X.2",
        stub="report = [\n"
        '    f"seed {seed}",\n'
        '    "A: ?",  # a fault and its evidence, such as "A: mass 0.93"\n'
        '    "B: ?",\n    "C: ?",\n    "D: ?",\n    "E: ?",\n    "F: ?",\n]',
        solution="from floatbase.lessons.lessonX.investigation import investigate as detective\n"
        "\n"
        'report = [f"seed {seed}"]\n'
        'report += [f"{box.name}: {detective(box)}" for box in black_boxes(seed)]',
        judge=_judge_report,
        examples=_reports,
        explanation="The detective is the solution of X.3, which `reveal` shows there.",
        namespace=lambda: {"seed": 1, "black_boxes": black_boxes},
    ),
    Exercise(
        name="X.3",
        stub='def investigate(box):\n    return "nothing"  # replace: a fault and its evidence, as '
        "in your report",
        solution=inspect.getsource(investigation),
        judge=_judge_program,
        examples=_programs,
        explanation="First check the plan, then the motors, then the ground. Each question has "
        "its own answer.",
    ),
)
