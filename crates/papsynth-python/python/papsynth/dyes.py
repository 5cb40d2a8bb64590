"""Colours of dyes."""

from ._native import dyes as _dyes

transmittance = _dyes.transmittance

__all__ = ["transmittance"]
