"""Tests of frames and recipes in Jupyter, and of the fields that controls are made from."""

import copy
import html
import io
import json
import pickle
from html.parser import HTMLParser

import numpy as np
import papsynth
import pytest
from papsynth import _schema
from PIL import Image

SMALL = {"field": {"width_px": 320, "height_px": 240}}
CELL, NUCLEUS = (0, 158, 115), (213, 94, 0)


def picture(frame):
    """Return the picture of a frame in Jupyter, (height, width, 3)."""
    with Image.open(io.BytesIO(frame._repr_png_())) as image:
        assert (image.format, image.mode) == ("PNG", "RGB")
        return np.asarray(image)


def edge(labels):
    """Return the pixels of objects with another label to the left, right, above or below."""
    found = np.zeros(labels.shape, dtype=bool)
    for y, x in np.argwhere(labels > 0):
        others = [(y - 1, x), (y + 1, x), (y, x - 1), (y, x + 1)]
        inside = [labels[b, a] for b, a in others if 0 <= b < labels.shape[0] and 0 <= a < labels.shape[1]]
        found[y, x] = any(other != labels[y, x] for other in inside)
    return found


def test_a_frame_shows_its_image_with_outlines_of_cells_and_nuclei():
    frame = papsynth.render(SMALL, seed=7)
    shown = picture(frame)
    assert shown.shape == (240, 320, 3)
    nuclei, cells = edge(frame.labels["nucleus"]), edge(frame.labels["cytoplasm"])
    assert nuclei.any() and (shown[nuclei] == NUCLEUS).all()
    assert (shown[cells & ~nuclei] == CELL).all()
    rest = ~(nuclei | cells)
    assert (shown[rest] == frame.image[rest][:, None]).all()


def test_a_frame_shows_at_most_768_pixels_a_side_in_any_form():
    for field, size in (((1600, 40), (14, 534)), ((64, 64), (64, 64)), ((769, 17), (9, 385)), ((16, 1537), (513, 6))):
        width, height = field
        frame = papsynth.render({"field": {"width_px": width, "height_px": height}}, seed=1)
        assert picture(frame).shape[:2] == size
    large = papsynth.render("dense", seed=1, threads=0)
    assert picture(large).shape == (519, 688, 3) and len(large._repr_png_()) < 688 * 519 * 3


def test_frames_of_more_bits_stacks_and_colour_show_their_levels():
    deep = papsynth.render({**SMALL, "camera": {"bits": 12}}, seed=7)
    rest = (edge(deep.labels["nucleus"]) | edge(deep.labels["cytoplasm"])) == 0
    assert abs(picture(deep)[rest][:, 0] - deep.image[rest] * (255 / 4095)).max() <= 0.5
    colour = papsynth.render({**SMALL, "light": {"kind": "colour"}, "focus": {"planes": 2}}, seed=7)
    rest = (edge(colour.labels["nucleus"]) | edge(colour.labels["cytoplasm"])) == 0
    assert (picture(colour)[rest] == colour.image[rest]).all()
    empty = papsynth.render({**SMALL, "cells": {"intermediate": {"count": 0}}, "debris": {}}, seed=7)
    assert picture(empty).shape == (240, 320, 3)


class Table(HTMLParser):
    """Texts of the cells of a table."""

    def __init__(self, text):
        super().__init__()
        self.rows, self.words, self.tags = [], [], []
        self.feed(text)
        assert not self.tags, self.tags

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.tags.pop() == tag

    def handle_data(self, data):
        if self.rows and self.tags[-1:] != ["p"]:
            self.rows[-1][-1] += data
        else:
            self.words.append(data)


@pytest.mark.parametrize("preset", papsynth.presets())
def test_a_preset_is_shown_by_its_name(preset):
    text = papsynth.recipe(preset)._repr_html_()
    assert f"<code>{preset}</code>" in text and "without changes" in text and "<table>" not in text
    assert html.escape(papsynth.presets()[preset]) in text


def test_a_recipe_shows_what_differs_from_the_closest_preset():
    recipe = papsynth.recipe("high-grade")
    recipe["optics"]["na"] = 0.75
    recipe["light"] = {"kind": "colour"}
    recipe["cells"]["carcinoma"] = {"count": {"per_mm2": {"log_normal": [3, 0.5], "max": 9}}}
    del recipe["cells"]["intermediate"]
    table = Table(recipe._repr_html_())
    assert "with 4 changes" in "".join(table.words)
    assert table.rows[0] == ["Field", "Value", "In high-grade", "Meaning"]
    rows = {row[0]: row[1:3] for row in table.rows[1:]}
    base = papsynth.recipe("high-grade")["cells"]["intermediate"]["count"]
    assert rows == {
        "optics.na": ["0.75", "0.95"],
        "light.kind": ["colour", "monochrome"],
        "cells.carcinoma.count": ["per_mm2(log_normal(3, 0.5, max=9))", "none"],
        "cells.intermediate": ["none", _schema.notation(base)],
    }
    assert all(row[3] for row in table.rows[1:])
    assert "with 1 change.<" in papsynth.recipe({"camera": {"bits": 12}})._repr_html_()


def test_recipes_and_engines_in_every_form_are_shown():
    from papsynth.recipes import Field, Recipe

    for shown in (papsynth.recipe(SMALL), papsynth.Engine(SMALL), Recipe(field=Field(width_px=320, height_px=240))):
        rows = {row[0]: row[1] for row in Table(shown._repr_html_()).rows[1:]}
        assert rows == {"field.width_px": "320", "field.height_px": "240"}, shown
    assert "Engine" in papsynth.Engine("dense")._repr_html_()


def test_a_long_table_ends_with_the_number_of_other_fields(monkeypatch):
    from papsynth import _display

    recipe = papsynth.recipe("lbc", widen=2.0)
    count = len(Table(recipe._repr_html_()).rows) - 1
    monkeypatch.setattr(_display, "_ROWS", 5)
    table = Table(recipe._repr_html_())
    assert len(table.rows) == 6 and f"{count - 5} more fields differ." in table.words


def test_texts_of_recipes_are_escaped():
    attack = "<script>alert(1)</script>&\"'"
    recipe = papsynth.recipe({"layout": {"kind": "density-map", "path": attack}})
    text = recipe._repr_html_()
    assert "<script" not in text and html.escape(attack) in text
    assert attack in {row[1] for row in Table(text).rows}
    recipe[attack] = {}
    text = recipe._repr_html_()
    assert "<script" not in text and "Invalid recipe" in text
    recipe = papsynth.recipe()
    recipe["field"]["width_px"] = object()
    assert "Invalid recipe" in recipe._repr_html_() and "<object" not in recipe._repr_html_()


def test_a_shown_recipe_is_a_dictionary():
    recipe = papsynth.recipe(SMALL)
    assert isinstance(recipe, dict) and recipe == json.loads(json.dumps(recipe))
    for copied in (copy.deepcopy(recipe), pickle.loads(pickle.dumps(recipe))):
        assert copied == recipe and copied._repr_html_() == recipe._repr_html_()
    assert np.array_equal(papsynth.render(recipe, seed=2).image, papsynth.render(SMALL, seed=2).image)


def test_ipython_finds_the_pictures_and_tables():
    from IPython.core.formatters import DisplayFormatter

    found, _ = DisplayFormatter().format(papsynth.render(SMALL, seed=7))
    assert found["image/png"].startswith(b"\x89PNG") and found["text/plain"].startswith("<papsynth.Frame")
    found, _ = DisplayFormatter().format(papsynth.recipe(SMALL))
    assert "<table>" in found["text/html"] and "320" in found["text/plain"]


def leaves(value, path=()):
    """Yield the paths of all values of a recipe that are not sections."""
    is_section = isinstance(value, dict) and not {"uniform", "normal", "log_normal", "choice", "per_mm2"} & set(value)
    if not is_section:
        yield path
        return
    for name, inner in value.items():
        yield from leaves(inner, (*path, name))


@pytest.mark.parametrize("preset", papsynth.presets())
def test_the_fields_of_the_schema_are_those_of_the_recipe(preset):
    recipe = papsynth.recipe(preset)
    entries = _schema.entries(recipe)
    expected = {path for path in leaves(recipe) if path != ("version",)}
    assert {entry.path for entry in entries} - {("conditions",)} == expected - {("conditions",)}
    for entry in entries:
        assert entry.help, entry
        assert entry.kind != "choice" or _schema.value_at(recipe, entry.path) in entry.choices


def test_another_kind_of_a_section_has_its_own_fields():
    recipe = papsynth.recipe()
    for entry in [entry for entry in _schema.entries(recipe) if entry.tags_section]:
        for kind in entry.choices:
            changed = _schema.with_value(recipe, entry, kind)
            if kind in ("density-map", "labels"):
                # They need a file.
                changed[entry.path[0]]["path"] = "map.png"
            assert _schema.value_at(papsynth.recipe(changed), entry.path) == kind
            whole = _schema.value_at(papsynth.recipe(changed), entry.path[:-1])
            assert set(whole) == set(_schema.value_at(changed, entry.path[:-1]))
    assert recipe == papsynth.recipe()
