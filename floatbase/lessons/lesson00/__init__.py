"""Lesson 00: its pictures, helpers and exercises."""

from floatbase.lessons.lesson00.exercises import EXERCISES

__all__ = [
    "EXERCISES",
]
