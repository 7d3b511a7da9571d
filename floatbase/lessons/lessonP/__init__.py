"""Lesson P, Playground."""

from floatbase.lessons.lessonP.helpers import (
    BAG_MASS,
    com_sag,
    time_on_two_feet,
    unknown_mass_record,
)
from floatbase.lessons.lessonP.pictures import plot_gains, plot_outcomes
