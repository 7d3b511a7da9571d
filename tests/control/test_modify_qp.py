"""`modify_qp`: a function that changes the QP of each control step before it is solved."""

import pickle
from dataclasses import replace

import judges
import numpy as np
import pytest

import floatbase as fb
from floatbase import _blas
from floatbase.behaviours import Gait, Walk
from floatbase.dynamics import EquationsOfMotion

GO2 = judges.load("go2")
PARTS = ("H", "g", "A", "b", "G", "h")


def with_even_knees(qp: fb.QP, eom: EquationsOfMotion) -> fb.QP:
    """Add a row that couples torques: both front knees have the same torque."""
    first, second = (eom.robot.joint_names.index(f"{leg}_calf_joint") for leg in ("FL", "FR"))
    row = np.zeros((1, qp.n))
    row[0, qp.blocks["tau"]][[first, second]] = 1.0, -1.0
    A, b, names = np.vstack([qp.A, row]), np.append(qp.b, 0.0), (*qp.equality_names, "even knees")
    return replace(qp, A=A, b=b, equality_names=names)


def unchanged(qp: fb.QP, eom: EquationsOfMotion) -> fb.QP:
    return qp


def controller(**options: object) -> fb.WholeBodyController:
    return judges.controller_of("go2", **options)


def test_it_changes_the_problem_that_is_solved_and_no_other_is():
    state = GO2.random_state(1, 0.05)
    plain, even = controller(backend="reference"), controller(modify_qp=with_even_knees)
    index = [GO2.joint_names.index(f"{leg}_calf_joint") for leg in ("FL", "FR")]
    assert abs(np.diff(plain(state.q, state.v).tau[index])[0]) > 0.1
    assert abs(np.diff(even(state.q, state.v).tau[index])[0]) < 1e-9
    assert even.qp(state).equality_names[-1] == "even knees"
    same, before = controller(modify_qp=unchanged).qp(state), plain.qp(state)
    assert all(np.array_equal(getattr(same, part), getattr(before, part)) for part in PARTS)


def test_modify_qp_uses_the_reference_backend_and_the_reason_names_modify_qp(standing):
    even = controller(modify_qp=with_even_knees)
    assert even.backend == "reference" and "modify_qp" in even.backend_reason
    assert even(standing.q, standing.v).backend == "reference"
    for other in (
        even.replace(contacts=even.contacts.without("FL_foot")),
        pickle.loads(pickle.dumps(even)),
        controller(modify_qp=with_even_knees, contact_weight=1e4),
    ):
        assert other.backend == "reference"
        assert other.qp(standing).equality_names[-1] == "even knees"


def test_a_walk_hands_it_to_the_controllers_of_all_stances():
    seen = set()

    def watch(qp: fb.QP, eom: EquationsOfMotion) -> fb.QP:
        seen.add(eom.contacts.names)
        return qp

    walk = Walk(GO2, judges.stance(GO2), Gait.trot(GO2, start=0.02), modify_qp=watch)
    record = fb.rollout(fb.Simulation(GO2, 0.7), walk, 0.4, control_period=4e-3)
    assert record.outcome == "completed" and {len(names) for names in seen} == {2, 4}


@pytest.mark.skipif(_blas.SETTER is None, reason="numpy does not use OpenBLAS here")
def test_a_reference_step_uses_one_blas_thread_and_leaves_the_number_as_it_was():
    threads, inside = getattr(_blas.LIBRARY, _blas.SETTER.replace("set", "get")), []

    def read(qp: fb.QP, eom: EquationsOfMotion) -> fb.QP:
        inside.append(threads())
        if len(inside) > 2:
            raise ValueError
        return qp

    made, state = controller(modify_qp=read), GO2.standing()
    before = threads()
    getattr(_blas.LIBRARY, _blas.SETTER)(2)
    try:
        made(state.q, state.v)
        assert inside[-1] == 1 and threads() == 2
        with pytest.raises(ValueError):
            made(state.q, state.v)
        assert inside[-1] == 1 and threads() == 2
    finally:
        getattr(_blas.LIBRARY, _blas.SETTER)(before)
