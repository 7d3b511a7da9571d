"""Lesson P, Playground."""

from floatbase.lessons.lessonP.exercises import EXERCISES
from floatbase.lessons.lessonP.helpers import BAG, box_in_the_dark, on_two_feet, sinks
from floatbase.lessons.lessonP.pictures import plot_gains, plot_outcomes

__all__ = ["BAG", "EXERCISES", "box_in_the_dark", "on_two_feet", "plot_gains", "plot_outcomes", "sinks"]
