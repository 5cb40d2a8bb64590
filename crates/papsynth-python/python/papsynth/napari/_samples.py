"""Sample data of the plugin."""

from __future__ import annotations

import papsynth

from ._layers import LayerData, layers

__all__ = ["colour", "endocervical", "focus_stack", "high_grade", "inflamed", "lbc"]


def _of(recipe: str | dict, name: str) -> list[LayerData]:
    return layers(papsynth.render(recipe, seed=1, threads=0), name, {"recipe": recipe})


def lbc() -> list[LayerData]:
    """Return a field of liquid-based cytology."""
    return _of("lbc", "lbc")


def high_grade() -> list[LayerData]:
    """Return a field with a high-grade lesion."""
    return _of("high-grade", "high-grade")


def endocervical() -> list[LayerData]:
    """Return a field with groups of endocervical cells."""
    return _of("endocervical", "endocervical")


def inflamed() -> list[LayerData]:
    """Return a field with many leukocytes, bacteria and debris."""
    return _of("inflamed", "inflamed")


def colour() -> list[LayerData]:
    """Return a field in colour."""
    return _of({"field": {"width_px": 800, "height_px": 600}, "light": {"kind": "colour"}}, "colour")


def focus_stack() -> list[LayerData]:
    """Return a focus stack of 11 planes."""
    field, focus = {"width_px": 640, "height_px": 480}, {"planes": 11, "step_um": 1.0}
    return _of({"field": field, "focus": focus}, "focus stack")
