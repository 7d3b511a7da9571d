"""Gaits, swings, the pendulum and footholds against finite differences and closed forms."""

import itertools
from dataclasses import replace

import judges
import numpy as np
import pytest
from messages import raises, refused

from floatbase.behaviours import (
    LIPM,
    Gait,
    Swing,
    capture_point,
    neutral_point,
    pitch_and_yaw,
    step_adjustment,
    support_margin,
)
from floatbase.errors import InputError, UnknownNameError

STEP = 1e-5  # s to each side of central differences
QUADRUPED = {
    "go2": ("FL", "RR", "FR", "RL"),
    "solo12": ("FL", "HR", "FR", "HL"),
    "anymal_kinova": ("LF", "RH", "RF", "LH"),
}


@pytest.mark.parametrize("name", QUADRUPED)
def test_a_trot_lifts_diagonal_feet_together(name):
    first, with_it, second, with_that = QUADRUPED[name]
    gait = Gait.trot(judges.load(name), swing=0.25, start=1.0)
    for t, expected in ((1.1, {first, with_it}), (1.3, {second, with_that})):
        assert {foot[:2] for foot in gait.feet if gait.swing_at(foot, t)} == expected
    assert len(gait.stance(0.99)) == 4 and gait.stance(1.0) == gait.stance(1.2)


def test_a_crawl_lifts_one_foot_at_a_time_and_pauses():
    gait = Gait.crawl(judges.load("go2"), swing=0.3, pause=0.2, start=0.0)
    phases = gait.phases(0.0, 16)
    assert [len(stance) for _, _, stance in phases] == [3, 4] * 8
    assert np.allclose([end - begin for begin, end, _ in phases], [0.3, 0.2] * 8, atol=1e-9)
    lifted = [next(iter(set(gait.feet) - set(stance))) for _, _, stance in phases[::2]]
    assert len(set(lifted[:4])) == 4 and lifted[:4] == lifted[4:]


def test_phases_follow_one_another_and_agree_with_the_stance():
    rng = np.random.default_rng(0)
    for _ in range(20):
        period = rng.uniform(0.2, 2.0)
        offsets = {foot: rng.uniform(0.0, 0.99) for foot in "abcd"}
        gait = Gait(offsets, period, rng.uniform(0.05, 0.9) * period, rng.uniform(-1.0, 1.0))
        t = rng.uniform(-2.0, 5.0)
        phases = gait.phases(t, 12)
        assert phases[0][0] == t and all(a[1] == b[0] for a, b in itertools.pairwise(phases))
        for begin, end, stance in phases:
            assert end > begin and all(
                gait.stance(begin + part * (end - begin)) == stance for part in (0.01, 0.5, 0.99)
            )


def test_no_foot_lifts_from_the_stop_on_and_endless_standing_is_cut():
    gait = Gait({"a": 0.0, "b": 0.5}, 1.0, 0.4, stop=1.2)
    assert gait.swing_at("a", 1.3) == (1.0, 1.4)  # it was in the air and comes down
    assert gait.swing_at("b", 1.6) is None and gait.next_swing("a", 1.2) is None
    assert gait.phases(3.0, 4) == [(3.0, 8.0, ("a", "b"))]
    assert gait.phases(3.0, 4, max_duration=1.0) == [(3.0, 4.0, ("a", "b"))]


def test_stances_do_not_depend_on_the_rounding_of_the_clock():
    gait = Gait({"a": 0.0, "b": 0.5}, 0.5, 0.25)
    times = np.cumsum(np.full(20_000, 1e-3)) - 1e-3  # 20 s, added up as in a simulation
    pairs = enumerate(itertools.pairwise(gait.stance(t) for t in times), 1)
    assert [i for i, (before, after) in pairs if before != after] == list(range(250, 20_000, 250))


def test_gaits_refuse_what_does_not_fit():
    go2, talos = judges.load("go2"), judges.load("talos")
    refused(lambda: Gait({"a": 0.0}, 0.5, 0.5), InputError, "swing", "period", 0.5)
    refused(lambda: Gait({"a": 1.0}, 0.5, 0.2), InputError, "a", 1)
    refused(lambda: Gait.trot(talos), InputError, "talos", 2, "Gait.walk")
    refused(lambda: Gait.walk(judges.load("ur5")), InputError, "ur5", 0)
    refused(lambda: Gait.trot(go2).swing_at("FL", 0.0), UnknownNameError, "FL", "FL_foot")


@pytest.mark.parametrize(
    ("name", "together"),
    [
        ("trot", {("FL", "RR"), ("FR", "RL")}),
        ("pace", {("FL", "RL"), ("FR", "RR")}),
        ("bound", {("FL", "FR"), ("RL", "RR")}),
        ("pronk", {("FL", "FR", "RL", "RR")}),
        ("walk", {("FL",), ("FR",), ("RL",), ("RR",)}),
        ("crawl", {("FL",), ("FR",), ("RL",), ("RR",)}),
    ],
)
def test_gaits_lift_the_feet_that_their_names_say(name, together, go2):
    gait = getattr(Gait, name)(go2)
    groups = set()
    for offset in gait.offsets.values():
        standing = gait.stance(gait.start + (offset + 1.0) * gait.period + gait.swing / 2.0)
        groups.add(tuple(sorted(foot[:2] for foot in set(gait.feet) - set(standing))))
    assert groups == together


def test_a_swing_leads_from_rest_to_rest_over_its_height():
    rng = np.random.default_rng(1)
    swing = Swing(rng.normal(size=3), rng.normal(size=3), 0.3, 0.8, height=0.05)
    for t, place in ((0.3, swing.start), (0.8, swing.end), (0.0, swing.start), (2.0, swing.end)):
        x, v, a = swing(t)
        assert np.allclose(x, place) and np.allclose(v, 0.0) and np.allclose(a, 0.0)
    middle = swing(0.55)[0]
    assert np.allclose(middle, (swing.start + swing.end) / 2.0 + [0.0, 0.0, 0.05])
    for t in np.linspace(0.31, 0.79, 25):
        (x0, v0, _), (x1, v1, _), (_, v, a) = swing(t - STEP), swing(t + STEP), swing(t)
        assert np.allclose((x1 - x0) / (2 * STEP), v, atol=1e-6)
        assert np.allclose((v1 - v0) / (2 * STEP), a, atol=1e-4)
    refused(lambda: replace(swing, touchdown=0.3), InputError, 0.3)


def test_the_pendulum_keeps_its_equation_and_ends_on_the_last_zmp():
    rng, omega = np.random.default_rng(2), 3.4
    times = np.cumsum(rng.uniform(0.2, 0.8, 6))
    places = rng.normal(0.0, 0.1, (6, 2))
    pieces = [
        (a, b, p0, p1) for a, b, p0, p1 in zip(times, times[1:], places, places[1:], strict=False)
    ]
    plan = LIPM(pieces, rng.normal(0.0, 0.1, 2), omega)
    assert np.allclose(plan(times[0])[0], plan.com)
    assert np.allclose(plan.dcm(times[-1]), places[-1], atol=1e-12)
    for t in rng.uniform(times[0] + STEP, times[-1] + 1.0, 50):
        c, v, a = plan(t)
        scale = 1.0 + np.abs(a).max()
        assert np.allclose(a, omega**2 * (c - plan.zmp(t)), atol=1e-12 * scale)
        assert np.allclose(plan.dcm(t), c + v / omega, atol=1e-12)
        if all(abs(t - edge) > 2 * STEP for edge in times):
            before, after = plan(t - STEP), plan(t + STEP)
            assert np.allclose((after[0] - before[0]) / (2 * STEP), v, atol=1e-6)
            assert np.allclose((after[1] - before[1]) / (2 * STEP), a, atol=1e-4)
    for edge in times[1:]:  # position and velocity are continuous where the ZMP turns
        before, after = plan(edge - 1e-9), plan(edge + 1e-9)
        assert np.allclose(before[0], after[0], atol=1e-7)
        assert np.allclose(before[1], after[1], atol=1e-7)
    assert np.allclose(plan(times[-1] + 20.0)[0], places[-1], atol=1e-9)  # at rest on the last ZMP


def test_a_pendulum_refuses_gaps_and_what_is_no_plan():
    zero = np.zeros(2)
    with raises(InputError, "ZMP", 1.5, 2):
        LIPM([(0.0, 1.0, zero, zero), (1.5, 2.0, zero, zero)], zero, 3.0)
    refused(lambda: LIPM([], zero, 3.0), InputError, "ZMP")
    refused(lambda: LIPM([(0.0, 1e3, zero, zero)], zero, 3.0), InputError, "omega", 1000)


def test_footholds_by_their_closed_forms():
    assert np.allclose(neutral_point([0.2, 0.1], [0.4, 0.0], 0.5), [0.3, 0.1])
    assert np.allclose(capture_point([0.1, 0.0, 0.3], [0.5, 0.2, 9.0], 5.0), [0.2, 0.04])
    # an error of the DCM grows as ξ̇ = ω (ξ - p), and a step there brings it to rest
    error, omega, left = np.array([0.01, -0.02]), 5.0, 0.2
    grown = error.copy()
    for _ in range(10_000):
        grown += left / 10_000 * omega * grown
    assert np.allclose(step_adjustment(error, left, omega), grown, rtol=1e-3)
    assert not step_adjustment(error, left, omega, dead_zone=0.03).any()
    beyond = step_adjustment(error, left, omega, dead_zone=0.01)
    assert np.isclose(np.linalg.norm(beyond), np.exp(omega * left) * (np.linalg.norm(error) - 0.01))


def test_the_support_margin_is_the_distance_to_the_hull_of_the_feet():
    feet = [[0.0, 0.0], [2.0, 0.0], [1.0, 0.5], [2.0, 2.0], [0.0, 2.0]]  # the third is inside
    assert np.isclose(support_margin([0.5, 1.0], feet), 0.5)
    assert np.isclose(support_margin([3.0, 3.0], feet), -np.sqrt(2.0))
    assert np.isclose(support_margin([0.0, 1.0], [[-1.0, 0.0], [1.0, 0.0]]), -1.0)  # of a line
    refused(lambda: support_margin([0.0, 0.0], np.zeros((0, 2))), InputError, "feet")


def test_a_gait_that_is_taken_late_keeps_its_lift_offs_and_leaves_out_what_is_over():
    rng = np.random.default_rng(4)
    for _ in range(20):
        period, start = rng.uniform(0.2, 2.0), rng.uniform(-1.0, 1.0)
        offsets, swing = {foot: rng.uniform(0.0, 0.99) for foot in "abcd"}, rng.uniform(0.05, 0.9)
        gait = Gait(offsets, period, swing * period, start, stop=9.0)
        late = start + rng.uniform(0.0, 5.0)
        after = gait.starting_at(late)
        assert gait.starting_at(start) is gait
        assert not any(after.swing_at(foot, late - 1e-6) for foot in "abcd")
        for t, foot in itertools.product(rng.uniform(late, 12.0, 20), "abcd"):
            times, found = gait.swing_at(foot, t), after.swing_at(foot, t)
            if times is None or times[0] < late:
                assert found is None
            else:
                assert found is not None and np.allclose(times, found, atol=1e-9)
    gait = Gait({"a": 0.0, "b": 0.5}, 0.5, 0.25)
    # 30 · 0.1 is not 3 but more, due to rounding
    assert gait.starting_at(30 * 0.1).swing_at("a", 3.0) == pytest.approx((3.0, 3.25))


def test_a_swing_of_no_duration_is_refused():
    swing = Swing(np.zeros(3), np.ones(3), 0.0, 1e-3)
    assert np.all(np.isfinite(swing(5e-4)[2]))
    for touchdown in (0.0, 1e-200, 1e-160, 5e-4):
        with raises(InputError, "touchdown", 0.001):
            replace(swing, touchdown=touchdown)


def test_pitch_and_yaw_take_any_sequence_of_two_angles():
    listed, stacked = (
        pitch_and_yaw(lambda t, kind=kind: kind([0.1 * t, 0.2 * t])) for kind in (list, np.array)
    )
    for a, b in zip(listed(1.0), stacked(1.0), strict=True):
        assert np.array_equal(a, b)
    refused(lambda: pitch_and_yaw(lambda t: [0.1])(0.0), InputError, "angles", 1, 2)
