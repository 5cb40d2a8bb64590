"""Fields in napari: layers of a frame, sample data, and a widget that renders recipes.

The plugin is in napari's menus as soon as both packages are installed: ``pip install 'papsynth[napari]'``.

>>> import napari  # doctest: +SKIP
>>> import papsynth.napari
>>> viewer = napari.Viewer()  # doctest: +SKIP
>>> papsynth.napari.add(viewer, papsynth.render("high-grade", seed=7))  # doctest: +SKIP
"""

from __future__ import annotations

from ._layers import LayerData, add, layers

__all__ = ["LayerData", "add", "layers"]
