"""Writes python/papsynth/recipes.py: a class for each section of a recipe, from the JSON schema of recipes.

Usage: papsynth schema | python write_recipes.py [--check]. The schema is read from standard input; with --check nothing is written, and a
difference ends with status 1.
"""

import json
import sys
import textwrap
from pathlib import Path

TARGET = Path(__file__).parent.parent / "python/papsynth/recipes.py"

HEAD = '''"""Recipes as objects: every field with its type and meaning, for editors that complete them.

>>> from papsynth.recipes import CellMix, Field, Recipe, uniform
>>> recipe = Recipe(field=Field(width_px=640, height_px=480), cells={"intermediate": CellMix(count=uniform(3, 6))})
>>> frame = papsynth.render(recipe)

What is left out is the default. Written by tools/write_recipes.py from the schema; not to be changed by hand.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, Literal, Union

Number = Union[int, float, "dict[str, Any]"]
"""A number, or a distribution that it is drawn from."""

Abundance = Union[int, float, "dict[str, Any]"]
"""A count per field, or a density per mm² (see per_mm2); each a number or a distribution."""


def _bounded(distribution: dict[str, Any], min: float | None, max: float | None) -> dict[str, Any]:
    bounds = {name: bound for name, bound in (("min", min), ("max", max)) if bound is not None}
    return {**distribution, **bounds}


def uniform(low: float, high: float, *, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """Any number between two, all equally likely."""
    return _bounded({"uniform": [low, high]}, min, max)


def normal(mean: float, sd: float, *, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """A normal number."""
    return _bounded({"normal": [mean, sd]}, min, max)


def log_normal(median: float, sd: float, *, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """A number whose logarithm is normal, of that standard deviation."""
    return _bounded({"log_normal": [median, sd]}, min, max)


def choice(*numbers: float, min: float | None = None, max: float | None = None) -> dict[str, Any]:
    """One of some numbers, all equally likely."""
    return _bounded({"choice": list(numbers)}, min, max)


def per_mm2(density: Number) -> dict[str, Any]:
    """A number of objects per mm², which may be a distribution: ``per_mm2(uniform(90, 270))``."""
    return {"per_mm2": density}


def _plain(value: Any) -> Any:
    if isinstance(value, Section):
        return value.to_dict()
    if isinstance(value, dict):
        return {key: _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    return value


class Section:
    """A section of a recipe."""

    __slots__ = ()

    def to_dict(self) -> dict[str, Any]:
        """As a dictionary, without what was left out."""
        values = ((field.name, getattr(self, field.name)) for field in fields(self))
        return {name: _plain(value) for name, value in values if value is not None}

'''


def name_of(reference):
    return reference.rsplit("/", 1)[1]


class Writer:
    def __init__(self, schema):
        self.definitions = schema["$defs"]
        self.written = []
        self.text = []

    def type_of(self, schema):
        if "$ref" in schema:
            return name_of(schema["$ref"])
        for key in ("anyOf", "oneOf"):
            if key in schema:
                return " | ".join(dict.fromkeys(self.type_of(inner) for inner in schema[key]))
        if "const" in schema:
            return f"Literal[{schema['const']!r}]"
        if "enum" in schema:
            return f"Literal[{', '.join(map(repr, schema['enum']))}]"
        kind = schema.get("type")
        if isinstance(kind, list):
            return " | ".join(dict.fromkeys(self.type_of({**schema, "type": one}) for one in kind))
        if kind == "array":
            return f"list[{self.type_of(schema.get('items', {}))}]"
        if kind == "object":
            inner = schema.get("additionalProperties")
            return f"dict[str, {self.type_of(inner)}]" if isinstance(inner, dict) else "dict[str, Any]"
        return {"number": "float", "integer": "int", "boolean": "bool", "string": "str", "null": "None"}.get(kind, "Any")

    def described(self, text, indent=4):
        if not text:
            return []
        text = text.replace("\\", "\\\\").replace('"""', "'''")
        lines = textwrap.wrap(" ".join(text.split()), 130 - indent)
        if len(lines) == 1:
            return [" " * indent + f'"""{lines[0]}"""']
        return [" " * indent + f'"""{lines[0]}', *(" " * indent + line for line in lines[1:]), " " * indent + '"""']

    def section(self, name, schema, description):
        self.written.append(name)
        lines = ["", "@dataclass(kw_only=True, slots=True)", f"class {name}(Section):"]
        lines += self.described(description) or ['    """A section of a recipe."""']
        properties = schema.get("properties", {})
        for field, inner in sorted(properties.items(), key=lambda item: item[0] != "kind"):
            kind = self.type_of(inner)
            if "const" in inner:
                lines += ["", f"    {field}: {kind} = {inner['const']!r}"]
                continue
            lines += ["", f"    {field}: {kind} | None = None"]
            lines += self.described(inner.get("description"))
        self.text.append("\n".join(lines) + "\n")

    def definition(self, name):
        if name in self.written or name in ("Number", "Abundance"):
            return
        self.written.append(name)
        schema = self.definitions[name]
        variants = schema.get("oneOf") or schema.get("anyOf")
        if variants and all("properties" in variant for variant in variants):
            names = []
            for variant in variants:
                kind = variant["properties"].get("kind", variant["properties"].get("form", {})).get("const")
                own = name + "".join(word.capitalize() for word in (kind or str(len(names))).split("-"))
                names.append(own)
                self.section(own, variant, variant.get("description") or schema.get("description"))
            self.text.append("\n" + f"{name} = Union[{', '.join(names)}]\n" + "\n".join(self.described(schema.get("description"), 0)) + "\n")
        elif "properties" in schema:
            self.section(name, schema, schema.get("description"))
        else:
            kind = self.type_of(schema)
            kind = f"Union[{', '.join(kind.split(' | '))}]" if " | " in kind else kind
            self.text.append("\n" + f"{name} = {kind}\n" + "\n".join(self.described(schema.get("description"), 0)) + "\n")


def text(schema):
    writer = Writer(schema)
    for name in sorted(schema["$defs"]):
        writer.definition(name)
    writer.section("Recipe", schema, schema.get("description"))
    # Annotations are read by editors alone; aliases name classes above them.
    aliases = [part for part in writer.text if not part.startswith("\n@dataclass")]
    classes = [part for part in writer.text if part.startswith("\n@dataclass")]
    names = sorted({*writer.written, "Number", "Abundance", "Section", "Recipe", "uniform", "normal", "log_normal", "choice", "per_mm2"})
    listed = "\n__all__ = [\n" + "".join(f'    "{name}",\n' for name in names) + "]\n"
    return HEAD + "\n".join(classes) + "\n" + "\n".join(aliases) + listed


def main(check):
    made = text(json.load(sys.stdin))
    compile(made, str(TARGET), "exec")
    if not check:
        TARGET.write_text(made)
        return 0
    if TARGET.read_text() == made:
        return 0
    print(f"{TARGET} is not what the schema says: run tools/write_recipes.py", file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main("--check" in sys.argv[1:]))
