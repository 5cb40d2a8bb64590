"""Fields of recipes: their entries in the schema, and values that differ between two recipes."""

from __future__ import annotations

import copy
import json
from functools import lru_cache
from typing import Any, NamedTuple

from . import _native

__all__ = ["Entry", "Path", "differences", "entries", "notation", "value_at", "with_value"]

Path = tuple[str, ...]

# Keys of a dictionary that is a value, not a section.
_DISTRIBUTIONS = ("uniform", "normal", "log_normal", "choice")


class Entry(NamedTuple):
    """A field of a recipe."""

    path: Path
    """Names of the sections and of the field, such as ("optics", "na")."""
    kind: str
    """Type of the value.

    "number": a number or a distribution; "abundance": also a density per mm²; "real" and "integer": one number;
    "choice": one of `choices`; "text": a string; "list": a list of dictionaries.
    """
    help: str
    """Meaning, range and unit."""
    default: Any
    """Default, or None if the field is required."""
    least: float | None
    """Least number, if any."""
    most: float | None
    """Largest number, if any."""
    choices: dict[str, str]
    """Values of a "choice" with their meanings; else empty."""
    tags_section: bool
    """Whether the value decides which other fields the section has, as `optics.kind` does."""

    @property
    def name(self) -> str:
        """Path as in error messages, such as "optics.na"."""
        return ".".join(self.path)


@lru_cache(maxsize=1)
def _schema() -> dict[str, Any]:
    return json.loads(_native.recipe_schema())


def _resolved(node: dict[str, Any]) -> tuple[str, dict[str, Any]]:
    """Return the name of a definition, or "", and its schema. Keywords beside the reference replace its own."""
    if "$ref" not in node:
        return "", node
    name = node["$ref"].rsplit("/", 1)[1]
    return name, {**_schema()["$defs"][name], **{key: value for key, value in node.items() if key != "$ref"}}


def _tag(variant: dict[str, Any]) -> str:
    """Return the property whose value selects a variant of a section."""
    return next(name for name, node in variant["properties"].items() if "const" in node)


def _default(node: dict[str, Any]) -> Any:
    """Return the default of a schema, composed of the defaults of its fields if it has none itself."""
    _, node = _resolved(node)
    if "default" in node:
        return copy.deepcopy(node["default"])
    if "const" in node:
        return node["const"]
    if node.get("type") == "string":
        return ""
    return {name: _default(inner) for name, inner in node["properties"].items()} if "properties" in node else None


def _walk(node: dict[str, Any], value: Any, path: Path, found: list[Entry]) -> None:
    name, node = _resolved(node)
    value = _default(node) if value is None else value

    def entry(kind: str, choices: dict[str, str] | None = None, *, at: Path = path, tags: bool = False) -> Entry:
        default = None if tags else node.get("default")
        least, most, text = node.get("minimum"), node.get("maximum"), " ".join(node.get("description", "").split())
        return Entry(at, kind, text, default, least, most, choices or {}, tags)

    variants = node.get("oneOf", [])
    if name in ("Number", "Abundance"):
        found.append(entry(name.lower()))
    elif variants and "const" in variants[0]:
        found.append(entry("choice", {one["const"]: " ".join(one.get("description", "").split()) for one in variants}))
    elif variants:
        tag = _tag(variants[0])
        of_tag = {one["properties"][tag]["const"]: one for one in variants}
        choices = {const: " ".join(one.get("description", "").split()) for const, one in of_tag.items()}
        found.append(entry("choice", choices, at=(*path, tag), tags=True))
        for field, inner in of_tag[value[tag]]["properties"].items():
            if field != tag:
                _walk(inner, value.get(field), (*path, field), found)
    elif "enum" in node:
        found.append(entry("choice", dict.fromkeys(node["enum"], "")))
    elif "properties" in node:
        for field, inner in node["properties"].items():
            _walk(inner, value.get(field), (*path, field), found)
    elif isinstance(node.get("additionalProperties"), dict):
        for field, inner in value.items():
            _walk(node["additionalProperties"], inner, (*path, field), found)
    else:
        kinds = {"integer": "integer", "number": "real", "string": "text"}
        found.append(entry(kinds.get(node.get("type", ""), "list")))


def entries(recipe: dict[str, Any]) -> list[Entry]:
    """Return all fields of a complete recipe, in the order of the schema, without its version."""
    found: list[Entry] = []
    for name, node in _schema()["properties"].items():
        if name != "version":
            _walk(node, recipe.get(name), (name,), found)
    return found


def value_at(recipe: dict[str, Any], path: Path) -> Any:
    """Return the value of a field, or None if the recipe does not have it."""
    value: Any = recipe
    for name in path:
        if not isinstance(value, dict) or name not in value:
            return None
        value = value[name]
    return value


def with_value(recipe: dict[str, Any], entry: Entry, value: Any) -> dict[str, Any]:
    """Return a copy of a complete recipe with another value of a field.

    A value that decides which fields its section has gives the other fields of the section their defaults.
    """
    recipe = copy.deepcopy(recipe)
    section = recipe
    for name in entry.path[:-1]:
        section = section.setdefault(name, {})
    if entry.tags_section and section.get(entry.path[-1]) != value:
        section.clear()
        for one in _variants(entry.path[:-1]):
            if one["properties"][entry.path[-1]]["const"] == value:
                section.update(_default(one))
    section[entry.path[-1]] = value
    return recipe


def _variants(path: Path) -> list[dict[str, Any]]:
    """Return the variants of the section at a path."""
    node: dict[str, Any] = _schema()
    for name in path:
        node = _resolved(node["properties"][name])[1]
    return node["oneOf"]


def differences(recipe: dict[str, Any], base: dict[str, Any]) -> list[tuple[str, Any, Any, str]]:
    """Return the fields of a complete recipe that differ from another one: name, both values and meaning.

    A value is None where a recipe does not have the field. Fields that only `recipe` has are compared with their
    defaults. A class of cells that only `base` has is one field.
    """
    found = []
    for entry in entries(recipe):
        value, other = value_at(recipe, entry.path), value_at(base, entry.path)
        new_class = other is None and entry.path[0] == "cells" and entry.path[-1] == "count"
        if value is not None and (new_class or value != (entry.default if other is None else other)):
            found.append((entry.name, value, other, entry.help))
    for name in base.get("cells", {}):
        if name not in recipe.get("cells", {}):
            found.append((f"cells.{name}", None, base["cells"][name].get("count"), "Cells of this class."))
    return found


def notation(value: Any) -> str:
    """Return a value in the notation of `papsynth.recipes`, such as ``per_mm2(uniform(85, 250))``."""
    if isinstance(value, bool) or value is None or isinstance(value, str):
        return "none" if value is None else str(value)
    if isinstance(value, (int, float)):
        return str(int(value)) if value == int(value) and abs(value) < 1e15 else repr(value)
    if isinstance(value, dict) and "per_mm2" in value:
        return f"per_mm2({notation(value['per_mm2'])})"
    form = next((form for form in _DISTRIBUTIONS if isinstance(value, dict) and form in value), None)
    if form is None:
        return json.dumps(value, ensure_ascii=False)
    words = [notation(number) for number in value[form]]
    words += [f"{bound}={notation(value[bound])}" for bound in ("min", "max") if bound in value]
    return f"{form}({', '.join(words)})"
