"""TOML as dictionaries."""

from __future__ import annotations

try:
    from tomllib import loads
except ModuleNotFoundError:  # Python 3.10
    try:
        from tomli import loads
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError("Python 3.10 needs the package tomli to read recipes back", name="tomli") from error

__all__ = ["loads"]
