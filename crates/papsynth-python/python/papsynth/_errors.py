"""What can be wrong with a recipe."""

from __future__ import annotations

from typing import NamedTuple


class Fault(NamedTuple):
    """One thing that is wrong with a recipe."""

    field: str
    """The field, from the top, such as ``"optics.na"``; empty if the text is no TOML."""
    message: str
    """What is wrong with it, its value included."""
    help: str | None
    """What would be accepted, or what may have been meant."""


class RecipeError(ValueError):
    """A recipe asks for what cannot be.

    Attributes
    ----------
    source : str
        The file, or what else the recipe came from.
    faults : list of Fault
        Everything that is wrong, in the order of the text.
    field : str
        The field of the first fault.
    """

    def __init__(self, source: str, faults: list[tuple[str, str, str | None]]) -> None:
        self.source = source
        self.faults = [Fault(*fault) for fault in faults]
        self.field = self.faults[0].field if self.faults else ""
        lines = [f"{fault.message}" + (f" ({fault.help})" if fault.help else "") for fault in self.faults[:12]]
        if len(self.faults) > 12:
            lines.append(f"and {len(self.faults) - 12} more")
        super().__init__(f"{source}: " + "; ".join(lines))

    def __reduce__(self):
        return type(self), (self.source, [tuple(fault) for fault in self.faults])
