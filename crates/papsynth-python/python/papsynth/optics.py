"""Microscope optics."""

from ._native import optics as _optics

bright_field = _optics.bright_field
gaussian = _optics.gaussian
gibson_lanni = _optics.gibson_lanni

__all__ = ["bright_field", "gaussian", "gibson_lanni"]
