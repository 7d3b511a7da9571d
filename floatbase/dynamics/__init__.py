"""Constrained equations of motion and the space of motions they leave (§2 and Appendix A of the document)."""

from floatbase.dynamics.contacts import Contacts, FlatFootContact, PointContact
from floatbase.dynamics.equations import EquationsOfMotion, equations_of_motion

__all__ = ["Contacts", "EquationsOfMotion", "FlatFootContact", "PointContact", "equations_of_motion"]
