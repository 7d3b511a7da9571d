"""Lesson 00, Start here."""

from floatbase.lessons.lesson00.exercises import EXERCISES

__all__ = ["EXERCISES"]
