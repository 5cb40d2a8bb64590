"""Errors of recipes."""

from __future__ import annotations

from typing import NamedTuple


class FieldError(NamedTuple):
    """An invalid field of a recipe."""

    field: str
    """Path of the field, such as ``"optics.na"``; empty if the text is not valid TOML."""
    message: str
    """The problem, with the value."""
    help: str | None
    """Accepted values or similar names, if any."""


class RecipeError(ValueError):
    """Raised for invalid recipes.

    Attributes
    ----------
    source : str
        The file or preset of the recipe.
    errors : list of FieldError
        All invalid fields, in the order of the text.
    field : str
        The first invalid field.
    """

    def __init__(self, source: str, errors: list[tuple[str, str, str | None]]) -> None:
        self.source = source
        self.errors = [FieldError(*error) for error in errors]
        self.field = self.errors[0].field if self.errors else ""
        lines = [error.message + (f" ({error.help})" if error.help else "") for error in self.errors[:12]]
        if len(self.errors) > 12:
            lines.append(f"and {len(self.errors) - 12} more")
        super().__init__(f"{source}: " + "; ".join(lines))

    def __reduce__(self):
        return type(self), (self.source, [tuple(error) for error in self.errors])
