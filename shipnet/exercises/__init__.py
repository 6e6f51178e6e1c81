"""Exercises that check themselves: numbers for each student, checks with hints, the glossary."""

from shipnet.exercises.check import Verdict, check, given
from shipnet.exercises.glossary import glossary
from shipnet.exercises.student import Student, student

__all__ = ["Student", "Verdict", "check", "given", "glossary", "student"]
