"""The dock widget: a recipe as a form, rendered into layers."""

from __future__ import annotations

from typing import Any, NamedTuple

from magicgui.widgets import CheckBox, ComboBox, Container, Label, LineEdit, PushButton, SpinBox, TextEdit

import papsynth

from .._schema import Entry, differences, entries, value_at, with_value
from ._editors import LARGEST, Editor, editor
from ._layers import LayerData, add_data, layers

__all__ = ["FieldWidget"]

# Largest number of fields that a search shows.
_FOUND = 40

# Least width, pixels: a name, two numbers and the form of a distribution.
_WIDTH_PX = 420

# Height of the message, pixels.
_MESSAGE_PX = 84

# Settings of a layer that the layer of the next field has, too.
_KEPT = ("visible", "opacity", "gamma", "contour")

_CHANGED = "changed fields"

_RENDER = "Render"


def _section(entry: Entry) -> str:
    """Return the section of a field, such as "optics" or "debris.mucus"."""
    return ".".join(entry.path[: 2 if entry.path[0] in ("cells", "debris") else 1])


class Outcome(NamedTuple):
    """Layers of a field, or what rendering raised."""

    layers: list[LayerData]
    error: BaseException | None


def render_layers(recipe: dict[str, Any], preset: str, seed: int, index: int) -> Outcome:
    """Render a field on all processors.

    Exceptions are returned, because threads of napari raise some of them again outside the widget.
    """
    try:
        frame = papsynth.render(recipe, seed, index, threads=0)
        made = layers(frame, f"{preset}, seed {seed}, index {index}", {"recipe": recipe, "preset": preset})
        return Outcome(made, None)
    except BaseException as error:
        return Outcome([], error)


class FieldWidget(Container):
    """Renders fields of a recipe into layers of a viewer: an image or a focus stack, cells and nuclei.

    Controls of the recipe are made from its schema. Rendering runs in a thread. A new field replaces the layers of the
    last one, unless "keep earlier layers" is checked.

    Parameters
    ----------
    napari_viewer : napari.Viewer
    """

    def __init__(self, napari_viewer: Any) -> None:
        presets = papsynth.presets()
        self._viewer = napari_viewer
        self._recipe: dict[str, Any] = {}
        self._editors: dict[str, Editor] = {}
        self._invalid: dict[str, str] = {}
        self._layers: dict[str, Any] = {}
        self._worker: Any = None
        self._preset = ComboBox(name="preset", choices=list(presets), tooltip="Recipe to start from")
        self._seed = SpinBox(name="seed", min=0, max=LARGEST, tooltip="Seed of the data set")
        self._index = SpinBox(name="index", min=0, max=LARGEST, tooltip="Index of the image in the data set")
        self._sections = [_CHANGED]
        self._section = ComboBox(name="section", choices=self._choices, tooltip="Section of the recipe to change")
        self._search = LineEdit(name="search", tooltip="Shows all fields whose name or meaning contains these words")
        self._form: Any = Container(name="form")
        self._reset = PushButton(name="reset_fields", text="Reset fields", tooltip="Use the preset without changes")
        self._keep = CheckBox(name="keep", text="Keep earlier layers")
        self._button = PushButton(name="render_field", text=_RENDER)
        self._message = TextEdit(name="message")
        head: Any = Container(widgets=[self._preset, self._seed, self._index, self._section, self._search], name="head")
        foot: Any = Container(widgets=[self._reset, self._keep, self._button, self._message], labels=False, name="foot")
        super().__init__(widgets=[head, foot], labels=False, name="papsynth")
        self._arrange()
        self._preset.changed.connect(self._start)
        self._reset.changed.connect(self._start)
        self._section.changed.connect(self._show_section)
        self._search.changed.connect(self._show)
        self._button.changed.connect(self.render_field)
        self._start()

    def _arrange(self) -> None:
        """Put the fields into a scroll area with the free height."""
        from qtpy.QtCore import Qt
        from qtpy.QtWidgets import QScrollArea

        # Containers of magicgui scroll only as windows of their own.
        area = QScrollArea()
        area.setWidgetResizable(True)
        area.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        area.setWidget(self._form.native)
        self._form.native.layout().addStretch()
        self.native.layout().insertWidget(1, area, 1)
        self.native.setMinimumWidth(_WIDTH_PX)
        self._message.native.setReadOnly(True)
        self._message.native.setFixedHeight(_MESSAGE_PX)

    @property
    def recipe(self) -> dict[str, Any]:
        """The complete recipe of the form."""
        return self._recipe

    @property
    def message(self) -> str:
        """The text below the button: what is wrong, or what was rendered."""
        return self._message.value

    def _start(self, *_: Any) -> None:
        """Use the chosen preset without changes."""
        self._base = self._recipe = papsynth.recipe(self._preset.value)
        self._entries = entries(self._recipe)
        self._invalid = {}
        chosen = self._section.value
        # Only whole slides have a scan.
        shown = dict.fromkeys(_section(entry) for entry in self._entries if entry.path[0] != "scan")
        self._sections = [_CHANGED, *shown]
        self._section.reset_choices()
        self._section.value = chosen if chosen in shown else "field"
        self._message.value = papsynth.presets()[self._preset.value]
        self._show()

    def _choices(self, _: Any) -> list[str]:
        """Return the sections. napari asks for them again when it adds the widget."""
        return self._sections

    def _show_section(self, *_: Any) -> None:
        self._search.value = ""
        self._show()

    def _shown(self) -> list[Entry]:
        """Return the fields of the section, or those that the search finds."""
        words = self._search.value.lower().split()
        if words:
            texts = ((entry, f"{entry.name} {entry.help}".lower()) for entry in self._entries)
            return [entry for entry, text in texts if all(word in text for word in words)][:_FOUND]
        if self._section.value == _CHANGED:
            changed = {name for name, *_ in differences(self._recipe, self._base)}
            return [entry for entry in self._entries if entry.name in changed]
        return [entry for entry in self._entries if _section(entry) == self._section.value]

    def _show(self, *_: Any) -> None:
        """Make the controls of the fields that are shown."""
        self._form.clear()
        self._editors = {}
        if self._invalid:
            # Texts that are not numbers are gone with their controls.
            self._invalid = {}
            self._check()
        shown = self._shown()
        for entry in shown:
            made = editor(entry, value_at(self._recipe, entry.path))
            made.widget.label = self._shown_name(entry)
            made.widget.changed.connect(lambda *_, entry=entry: self._change(entry))
            self._editors[entry.name] = made
            self._form.append(made.widget)
        if not shown:
            none = "No field differs from the preset." if self._section.value == _CHANGED else "No field found."
            self._form.append(Label(value=none, label=""))

    def _shown_name(self, entry: Entry) -> str:
        """Return the name of a field in the section that is shown, with a star if it differs from the preset."""
        is_whole = self._search.value.strip() or self._section.value == _CHANGED
        name = entry.name if is_whole else entry.name.removeprefix(f"{self._section.value}.")
        is_changed = value_at(self._recipe, entry.path) != value_at(self._base, entry.path)
        return f"{name} *" if is_changed else name

    def _change(self, entry: Entry) -> None:
        """Take the value of a control into the recipe, and show errors."""
        try:
            value = self._editors[entry.name].read()
        except ValueError as error:
            self._invalid[entry.name] = f"{entry.name}: {error}"
        else:
            self._invalid.pop(entry.name, None)
            self._recipe = with_value(self._recipe, entry, value)
            if entry.tags_section:
                self._entries = entries(self._recipe)
                self._show()
            else:
                self._editors[entry.name].widget.label = self._shown_name(entry)
        self._check()

    def _check(self) -> bool:
        """Return whether the recipe is valid, and show its errors."""
        errors = list(self._invalid.values())
        try:
            papsynth.recipe(self._recipe)
        except papsynth.RecipeError as error:
            errors += [one.message + (f" ({one.help})" if one.help else "") for one in error.errors]
        except Exception as error:
            errors.append(str(error))
        self._message.value = "\n".join(f"Error: {error}" for error in errors)
        return not errors

    def render_field(self, *_: Any) -> Any:
        """Render the recipe in a thread, and return the worker, or None if the recipe is invalid."""
        from napari.qt.threading import create_worker

        if self._worker is not None or not self._check():
            return None
        given = self._recipe, self._preset.value, self._seed.value, self._index.value
        self._button.enabled, self._button.text = False, "Rendering …"
        self._worker = create_worker(render_layers, *given, _start_thread=False)
        self._worker.returned.connect(self._finish)
        self._worker.start()
        return self._worker

    def _finish(self, outcome: Outcome) -> None:
        """Show the layers or the error of the thread."""
        self._worker = None
        try:
            self._button.enabled, self._button.text = True, _RENDER
        except RuntimeError:
            # The widget was closed during rendering, and Qt has deleted its controls.
            return
        if outcome.error is not None:
            self._message.value = f"Error: {outcome.error}"
            return
        self._put(outcome.layers)
        count = len(self._layers["nuclei"].features)
        self._message.value = f"{self._layers['image'].name.rpartition(':')[0]}: {count} nuclei."

    def _put(self, made: list[LayerData]) -> None:
        """Add layers, in place of those of the last field unless they are kept."""
        earlier = {} if self._keep.value else {kind: layer for kind, layer in self._layers.items() if self._has(layer)}
        focus = self._viewer.dims.point
        # Added before the others are removed, because an empty viewer forgets its zoom.
        self._layers = dict(zip(("image", "cells", "nuclei"), add_data(self._viewer, made)))
        for kind, old in earlier.items():
            self._viewer.layers.remove(old)
            for setting in _KEPT:
                if hasattr(old, setting):
                    setattr(self._layers[kind], setting, getattr(old, setting))
        # Names were made unique beside those of the earlier layers.
        for layer, (_, options, _) in zip(self._layers.values(), made):
            layer.name = options["name"]
        new, old = self._layers["image"], earlier.get("image")
        if old is not None and _planes(old) == _planes(new):
            self._viewer.dims.point = focus

    def _has(self, layer: Any) -> bool:
        return layer in self._viewer.layers


def _planes(image: Any) -> tuple[Any, ...]:
    """Return number, step and position of the planes of an image layer, or its number of axes."""
    return (len(image.data), image.scale[0], image.translate[0]) if image.ndim > 2 else (image.ndim,)
