"""Lesson P, Playground."""

from floatbase.lessons.lessonP.exercises import EXERCISES
from floatbase.lessons.lessonP.helpers import (
    BAG_MASS,
    com_sag,
    time_on_two_feet,
    unknown_mass_record,
)
from floatbase.lessons.lessonP.pictures import plot_gains, plot_outcomes

__all__ = [
    "BAG_MASS",
    "EXERCISES",
    "com_sag",
    "plot_gains",
    "plot_outcomes",
    "time_on_two_feet",
    "unknown_mass_record",
]
