"""TOML as dictionaries."""

from __future__ import annotations

from typing import Any

__all__ = ["loads"]


def loads(text: str) -> dict[str, Any]:
    """Return a TOML document as a dictionary. Raises ModuleNotFoundError in Python 3.10 without the package tomli."""
    try:
        import tomllib
    except ModuleNotFoundError:  # Python 3.10
        try:
            import tomli as tomllib  # type: ignore[import-not-found, no-redef]
        except ModuleNotFoundError as error:
            message = "Python 3.10 needs the package tomli to read recipes back"
            raise ModuleNotFoundError(message, name="tomli") from error
    return tomllib.loads(text)
