"""Cells as cloth that is pressed into their outline."""

from ._native import cloth as _cloth

crumple = _cloth.crumple

__all__ = ["crumple"]
