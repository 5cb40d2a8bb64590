"""Controls of the fields of a recipe."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import Any, NamedTuple

from magicgui.widgets import ComboBox, Container, LineEdit, SpinBox
from qtpy.QtCore import QEvent, QObject
from qtpy.QtWidgets import QAbstractSpinBox, QComboBox, QWidget

from .._schema import Entry, notation

__all__ = ["LARGEST", "Editor", "NumberEditor", "editor"]

# Forms of a number, with their parameters.
_FORMS = {
    "constant": ("value",),
    "uniform": ("low", "high"),
    "normal": ("mean", "standard deviation"),
    "log_normal": ("median", "standard deviation of the natural logarithm"),
    "choice": ("numbers, separated by commas",),
}

# Largest number of 64 bits that magicgui compares exactly: it converts numbers to floating point.
LARGEST = 2**64 - 2**11

_UNITS = {"per field": False, "per mm²": True}


def _number(text: str) -> float | int:
    """Return a number; integers stay integers."""
    text = text.strip()
    if not text:
        raise ValueError("a number is missing")
    try:
        return int(text)
    except ValueError:
        pass
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{text!r}; expected a number") from None


class NumberEditor(Container):
    """A number or a distribution: its form, its parameters, and bounds if there are any.

    Numbers are text, so that no digit is lost and the mouse wheel changes nothing.
    """

    def __init__(self, value: Any, abundance: bool = False) -> None:
        self._per_area = ComboBox(choices=list(_UNITS), name="per_area") if abundance else None
        self._form = ComboBox(choices=list(_FORMS), name="distribution")
        self._parameters = [LineEdit(name="first"), LineEdit(name="second")]
        self._bounds = {bound: LineEdit(name=f"bound_{bound}") for bound in ("min", "max")}
        for bound, line in self._bounds.items():
            line.tooltip = f"{bound}: numbers beyond it are not drawn; empty for none"
        bounds = [*self._bounds.values()] if self._per_area is None else [*self._bounds.values(), self._per_area]
        first = Container(widgets=[*self._parameters, self._form], layout="horizontal", labels=False)
        self._second = Container(widgets=bounds, layout="horizontal", labels=False)
        for row in (first, self._second):
            row.margins = (0, 0, 0, 0)
        super().__init__(widgets=[first, self._second], layout="vertical", labels=False)
        self.margins = (0, 0, 0, 0)
        self._fill(value)
        self._form.changed.connect(self._show)

    def _fill(self, value: Any) -> None:
        per_area = isinstance(value, dict) and "per_mm2" in value
        if self._per_area is not None:
            self._per_area.value = next(name for name, is_density in _UNITS.items() if is_density == per_area)
        value = value["per_mm2"] if per_area else value
        form = next((form for form in _FORMS if isinstance(value, dict) and form in value), "constant")
        numbers = [value] if form == "constant" else value[form]
        texts = [", ".join(map(notation, numbers))] if form == "choice" else [notation(number) for number in numbers]
        self._form.value = form
        for line, text in zip(self._parameters, texts):
            line.value = text
        for bound, line in self._bounds.items():
            line.value = notation(value[bound]) if isinstance(value, dict) and bound in value else ""
        self._show()

    def _show(self, *_: Any) -> None:
        """Show the parameters of the form, and name them in tooltips."""
        names = _FORMS[self._form.value]
        for line, name in zip(self._parameters, (*names, "")):
            line.visible = bool(name)
            line.tooltip = name
            _hint(line, name)
        for bound, line in self._bounds.items():
            line.visible = self._form.value != "constant"
            _hint(line, bound)
        self._second.visible = self._form.value != "constant" or self._per_area is not None

    def read(self) -> Any:
        """Return the value of the field. Raises ValueError if a text is not a number."""
        form = self._form.value
        count = len(_FORMS[form])
        numbers = [_number(line.value) for line in self._parameters[:count]] if form != "choice" else None
        if form == "constant":
            value: Any = numbers[0] if numbers else None
        else:
            listed = [_number(text) for text in self._parameters[0].value.split(",")] if numbers is None else numbers
            bounds = {bound: _number(line.value) for bound, line in self._bounds.items() if line.value.strip()}
            value = {form: listed, **bounds}
        return {"per_mm2": value} if self._per_area is not None and _UNITS[self._per_area.value] else value


class _WheelFilter(QObject):
    """Passes wheel events of a control to the scroll area, so that scrolling changes no values."""

    def eventFilter(self, watched: Any, event: Any) -> bool:
        if event.type() != QEvent.Type.Wheel:
            return False
        event.ignore()
        return True


def _ignore_wheel(widget: Any) -> None:
    """Ignore the mouse wheel over a control and the controls in it."""
    for native in (widget.native, *widget.native.findChildren(QWidget)):
        if isinstance(native, (QComboBox, QAbstractSpinBox)):
            native.installEventFilter(_WheelFilter(native))


def _hint(line: LineEdit, text: str) -> None:
    """Show a text in an empty line."""
    line.native.setPlaceholderText(text)


class Editor(NamedTuple):
    """The control of a field."""

    widget: Any
    """Widget of magicgui. Its name is the path of the field with underscores."""
    read: Callable[[], Any]
    """Returns the value, or raises ValueError."""


def editor(entry: Entry, value: Any) -> Editor:
    """Return a control of a field with its value."""
    made: Any
    if entry.kind in ("number", "abundance"):
        made = NumberEditor(value, entry.kind == "abundance")
    elif entry.kind == "choice":
        made = ComboBox(choices=list(entry.choices), value=value)
    elif entry.kind == "integer":
        most = LARGEST if entry.most is None else int(entry.most)
        made = SpinBox(value=value, min=int(entry.least or 0), max=most)
    elif entry.kind == "list":
        made = LineEdit(value=json.dumps(value or [], ensure_ascii=False))
    else:
        made = LineEdit(value=notation(value) if entry.kind == "real" else value or "")
    _ignore_wheel(made)
    made.name = entry.name.replace(".", "_").replace("-", "_")
    made.tooltip = _tooltip(entry)
    if isinstance(made, NumberEditor):
        return Editor(made, made.read)
    parse = {"list": _list, "real": _number}.get(entry.kind, lambda value: value)
    return Editor(made, lambda: parse(made.value))


def _list(text: str) -> Any:
    try:
        return json.loads(text)
    except ValueError as error:
        raise ValueError(f"{text!r}; expected a list in JSON: {error}") from None


def _tooltip(entry: Entry) -> str:
    lines = [f"{entry.name}: {entry.help}"]
    lines += [f"{value}: {meaning}" for value, meaning in entry.choices.items() if meaning]
    return "\n".join(lines)
