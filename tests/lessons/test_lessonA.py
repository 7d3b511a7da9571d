"""Lesson A: its helpers do what they say."""

import re

import judges

import floatbase as fb
from floatbase.lessons.lessonA import show_tumble


def test_a_tumble_has_the_same_acceleration_in_both_frames():
    view, mass = fb.Viewer(judges.load("go2")), judges.load("go2").mass
    try:
        fast, slow, still = (show_tumble(view, *rates) for rates in ((3, 2), (1, 2), (3, 0)))
    finally:
        view.close()
    assert fast.endswith("0.0 m/s² apart") and still.endswith("0.0 m/s² apart")
    force, less = (float(re.findall(r"base's axes \((-?\d+),", text)[0]) for text in (fast, slow))
    assert abs(force + mass * 3.0 * 2.0) < 5  # N: m ω × v, backwards, and a few newtons of the legs
    assert abs(less - force - mass * 2.0 * 2.0) < 1  # N: the text has two digits
