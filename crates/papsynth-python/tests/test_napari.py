"""Tests of the napari plugin without a screen.

Qt draws off screen (QT_QPA_PLATFORM=offscreen). Layers are added to the model of a viewer, which needs no OpenGL.
"""

import importlib
import os
import re
import subprocess
import sys
import threading
from pathlib import Path

os.environ.setdefault("QT_QPA_PLATFORM", "offscreen")

import npe2
import numpy as np
import papsynth
import pytest
from napari.components import ViewerModel
from napari.utils._proxies import PublicOnlyProxy
from papsynth import _schema
from papsynth.napari import _editors, _widget, add, layers
from qtpy.QtCore import QEvent, QPoint, QPointF, Qt, QTimer
from qtpy.QtGui import QWheelEvent
from qtpy.QtWidgets import QApplication, QComboBox

SMALL = {"field": {"width_px": 320, "height_px": 240}}

# Seconds after which a test fails instead of waiting for an event that does not come.
PATIENCE = 300
LARGEST = _editors.LARGEST


@pytest.fixture(scope="module")
def app():
    yield QApplication.instance() or QApplication([])


@pytest.fixture
def viewer():
    # napari gives plugins this view of a viewer.
    return PublicOnlyProxy(ViewerModel())


@pytest.fixture
def widget(app, viewer):
    made = _widget.FieldWidget(viewer)
    change(made, "field.width_px", "320")
    change(made, "field.height_px", "240")
    yield made
    assert made._worker is None
    made.close()


def change(widget, name, text, place="first"):
    """Type a text into a control of a number."""
    widget._section.value = name.rpartition(".")[0]
    editor = widget._editors[name].widget
    line = {"first": editor._parameters[0], "second": editor._parameters[1], **editor._bounds}[place]
    line.native.setText(text)


def rendered(app, widget):
    """Click the button, and process events until the field is there."""
    widget._button.native.click()
    stuck = QTimer(singleShot=True)
    stuck.start(PATIENCE * 1000)
    while widget._worker is not None:
        app.processEvents()
        assert stuck.isActive(), "the worker did not return"
    return widget.message


def test_the_manifest_is_found_by_the_entry_point_and_valid():
    manifest = npe2.PluginManifest.from_distribution("papsynth")
    manifest.validate_imports()
    assert manifest.name == "papsynth" and len(manifest.contributions.widgets) == 1
    commands = {command.id: str(command.python_name) for command in manifest.contributions.commands}
    used = [*manifest.contributions.widgets, *manifest.contributions.sample_data]
    assert sorted(one.command for one in used) == sorted(commands)
    for name in commands.values():
        module, function = name.split(":")
        assert callable(getattr(importlib.import_module(module), function))


def test_a_frame_becomes_an_image_and_labels_with_the_table_as_features():
    frame = papsynth.render(SMALL, seed=7)
    (image, of_image, kind), cells, nuclei = layers(frame, "mine", {"recipe": SMALL})
    assert kind == "image" and np.array_equal(image, frame.image)
    assert of_image["name"] == "mine: image" and of_image["scale"] == (0.25, 0.25) and of_image["units"] == ("um", "um")
    assert of_image["contrast_limits"] == (0, 255) and not of_image["rgb"]
    assert of_image["metadata"]["papsynth"] == {"seed": 7, "index": 0, "recipe": SMALL}
    for (labels, options, kind), group, part in ((cells, "cytoplasm", "cytoplasm"), (nuclei, "nucleus", "nucleus")):
        assert kind == "labels" and np.array_equal(labels, frame.labels[group]) and options["scale"] == (0.25, 0.25)
        features, chosen = options["features"], frame.table["part"] == part
        assert list(features["index"]) == list(frame.table["id"][chosen])
        assert set(np.unique(labels)) - {0} <= set(features["index"])
        assert list(features["class"]) == list(frame.table["class"][chosen])
        assert {len(column) for column in features.values()} == {chosen.sum()}


def test_the_status_of_a_nucleus_has_the_row_of_the_table(viewer):
    frame = papsynth.render(SMALL, seed=7)
    _, _, nuclei = add(viewer, frame)
    number, row = next((number, row) for row, number in enumerate(nuclei.features["index"]) if number in nuclei.data)
    y, x = np.argwhere(nuclei.data == number)[0]
    status = nuclei.get_status((y * 0.25, x * 0.25), world=True)["value"]
    assert f"area_px: {nuclei.features['area_px'][row]}" in status and nuclei.features["class"][row] in status


def test_the_planes_of_a_stack_are_the_steps_of_the_focus_slider(viewer):
    frame = papsynth.render({**SMALL, "focus": {"planes": 5, "step_um": 1.5, "centre_um": 2.0}}, seed=7)
    image, cells, _ = add(viewer, frame)
    assert np.array_equal(image.data, frame.stack) and tuple(image.scale) == (1.5, 0.25, 0.25)
    assert [image.translate[0] + k * image.scale[0] for k in range(5)] == pytest.approx(frame.planes_um)
    assert viewer.dims.ndim == 3 and viewer.dims.nsteps[0] == 5 and viewer.dims.current_step[0] == 2
    assert viewer.dims.point[0] == pytest.approx(2.0)
    assert cells.data.shape == (240, 320)


def test_a_fused_image_has_no_focus_slider(viewer):
    recipe = papsynth.recipe("extended-focus")
    frame = papsynth.render({**recipe, "field": {**recipe["field"], **SMALL["field"]}}, seed=7)
    image, *_ = add(viewer, frame)
    assert image.ndim == 2 and np.array_equal(image.data, frame.image)


@pytest.mark.parametrize(("bits", "planes"), [(8, 1), (12, 1), (8, 3), (12, 3)])
def test_colour_is_shown_as_colour(viewer, bits, planes):
    recipe = {**SMALL, "light": {"kind": "colour"}, "camera": {"bits": bits}, "focus": {"planes": planes}}
    frame = papsynth.render(recipe, seed=7)
    image, *_ = add(viewer, frame)
    assert image.rgb and image.data.shape[-3:] == (240, 320, 3) and image.ndim == (2 if planes == 1 else 3)
    shown, white = image.data.reshape(frame.stack.shape), 2**bits - 1
    assert np.allclose(shown / (255 if bits == 8 else 1), frame.stack / white, atol=1e-6)


@pytest.mark.parametrize("key", ["lbc", "high-grade", "endocervical", "inflamed", "colour", "focus-stack"])
def test_sample_data_open(viewer, key):
    npe2.PluginManager.instance().discover()
    opened = viewer.open_sample("papsynth", key)
    assert [type(layer).__name__ for layer in opened] == ["Image", "Labels", "Labels"]
    assert len(opened[2].features) > 0 and opened[0].ndim == (3 if key == "focus-stack" else 2)
    for labels in opened[1:]:
        assert set(np.unique(labels.data)) - {0} <= set(labels.features["index"])


def test_every_sample_is_tested():
    samples = npe2.PluginManifest.from_distribution("papsynth").contributions.sample_data
    marks = test_sample_data_open.pytestmark[0].args[1]
    assert sorted(one.key for one in samples) == sorted(marks)


@pytest.mark.parametrize("preset", ["lbc", "paper-2015", "extended-focus"])
def test_every_control_returns_the_value_of_the_recipe(app, preset):
    recipe = papsynth.recipe(preset)
    for entry in _schema.entries(recipe):
        value = _schema.value_at(recipe, entry.path)
        expected = [] if entry.kind == "list" and value is None else value
        assert _editors.editor(entry, value).read() == expected, entry.name


def test_distributions_are_edited(app):
    recipe = papsynth.recipe()
    entry = next(entry for entry in _schema.entries(recipe) if entry.name == "cells.intermediate.count")
    for value in (
        3,
        2.5,
        {"uniform": [1, 2.25]},
        {"normal": [1, 0.5], "min": 0},
        {"log_normal": [1e-7, 0.5], "min": 0.125, "max": 9},
        {"choice": [1, 2.5, 4]},
        {"per_mm2": 110},
        {"per_mm2": {"uniform": [85.0, 250.0], "max": 200}},
    ):
        editor = _editors.editor(entry, value)
        assert editor.read() == value
        editor.widget._form.value = "choice"
        editor.widget._parameters[0].value = "1, x"
        with pytest.raises(ValueError, match="'x'; expected a number"):
            editor.read()


def test_the_widget_is_in_the_menu_of_plugins(app):
    import napari

    viewer = napari.Viewer(show=False)
    try:
        _, widget = viewer.window.add_plugin_dock_widget("papsynth", "Synthetic field")
        assert isinstance(widget, _widget.FieldWidget) and widget._viewer.layers == viewer.layers
        widget._section.value = "optics"
        assert "optics.na" in widget._editors
    finally:
        viewer.close()


def test_each_section_shows_its_fields(widget):
    shown = []
    for section in widget._sections[1:]:
        widget._section.value = section
        assert widget._editors and all(name.startswith(f"{section}.") or name == section for name in widget._editors)
        shown += widget._editors
    fields = [entry.name for entry in widget._entries if entry.path[0] != "scan"]
    assert sorted(shown) == sorted(fields)
    tooltip = widget._editors["conditions"].widget.tooltip
    assert tooltip.startswith("conditions: Conditions of slides")


def test_fields_are_found_by_name_and_meaning(widget):
    widget._search.value = "read noise"
    assert "camera.read_noise_e" in widget._editors
    widget._search.value = "no such words"
    assert not widget._editors
    widget._section.value = "optics"
    assert widget._search.value == "" and "optics.na" in widget._editors
    widget._section.value = "changed fields"
    assert list(widget._editors) == ["field.width_px", "field.height_px"]


def test_a_field_is_rendered_into_layers(app, viewer, widget):
    widget._seed.value, widget._index.value = LARGEST, 3
    change(widget, "focus.planes", "3")
    assert rendered(app, widget).startswith(f"lbc, seed {LARGEST}, index 3: ")
    expected = papsynth.render({**SMALL, "focus": {"planes": 3}}, LARGEST, 3)
    image, cells, nuclei = viewer.layers
    assert np.array_equal(image.data, expected.stack)
    assert np.array_equal(cells.data, expected.labels["cytoplasm"])
    assert np.array_equal(nuclei.data, expected.labels["nucleus"])
    again = papsynth.render(image.metadata["papsynth"]["recipe"], LARGEST, 3)
    assert np.array_equal(again.stack, image.data)


def test_a_new_field_replaces_the_last_one_unless_it_is_kept(app, viewer, widget):
    change(widget, "focus.planes", "3")
    rendered(app, widget)
    first = list(viewer.layers)
    first[1].visible, first[2].contour, viewer.dims.current_step = False, 2, (0, 0, 0)
    change(widget, "optics.na", "0.8")
    rendered(app, widget)
    second = list(viewer.layers)
    assert [layer.name for layer in second] == [
        f"lbc, seed 0, index 0: {kind}" for kind in ("image", "cells", "nuclei")
    ]
    assert len(second) == 3 and not set(map(id, first)) & set(map(id, second))
    assert not second[1].visible and second[2].visible and second[2].contour == 2 and viewer.dims.current_step[0] == 0
    widget._keep.value = True
    rendered(app, widget)
    assert list(viewer.layers)[:3] == second and len(viewer.layers) == 6
    viewer.layers.clear()
    rendered(app, widget)
    assert len(viewer.layers) == 3


def test_the_interface_works_while_a_field_is_rendered(app, viewer, widget, monkeypatch):
    begun, go, threads = threading.Event(), threading.Event(), []
    real = _widget.render_layers

    def held(*arguments):
        threads.append(threading.get_ident())
        begun.set()
        # Set by the interface: if that waited for the thread, this would fail.
        assert go.wait(PATIENCE)
        return real(*arguments)

    monkeypatch.setattr(_widget, "render_layers", held)
    timer = QTimer()
    timer.timeout.connect(lambda: begun.is_set() and go.set())
    timer.start(1)
    assert rendered(app, widget).startswith("lbc, seed 0")
    assert threads and threads[0] != threading.get_ident() and len(viewer.layers) == 3
    assert widget._button.enabled


def test_a_second_click_waits_for_the_first_field(app, widget):
    worker = widget.render_field()
    assert worker is not None and widget.render_field() is None and not widget._button.enabled
    assert widget._button.text == "Rendering …"
    while widget._worker is not None:
        app.processEvents()
    assert widget._button.text == "Render" and widget._button.enabled


def test_errors_are_shown_and_nothing_is_rendered(app, viewer, widget):
    change(widget, "optics.na", "x")
    assert widget.message == "Error: optics.na: 'x'; expected a number"
    assert widget.render_field() is None
    change(widget, "optics.na", "")
    assert widget.message == "Error: optics.na: a number is missing"
    change(widget, "optics.na", "7")
    assert widget.message.startswith("Error: optics.na: 7 is out of range: expected 0.05 to 1.6\n")
    assert rendered(app, widget).startswith("Error: optics.na") and not viewer.layers
    change(widget, "optics.na", "0.9")
    assert widget.message == ""
    assert rendered(app, widget).startswith("lbc, seed 0")


def test_a_text_that_is_not_a_number_is_forgotten_with_its_control(app, widget):
    change(widget, "optics.na", "x")
    widget._section.value = "camera"
    assert widget.message == ""
    widget._section.value = "optics"
    assert widget._editors["optics.na"].read() == papsynth.recipe()["optics"]["na"]
    assert rendered(app, widget).startswith("lbc, seed 0")


def test_errors_of_the_engine_are_shown(app, viewer, widget):
    widget._section.value = "layout"
    widget._editors["layout.kind"].widget.value = "density-map"
    assert list(widget._editors) == ["layout.kind", "layout.path"]
    widget._editors["layout.path"].widget.value = "no such file.png"
    message = rendered(app, widget)
    assert message.startswith("Error: ") and "no such file.png" in message and not viewer.layers
    assert widget._button.enabled
    widget._reset.native.click()
    change(widget, "field.width_px", "32768")
    change(widget, "field.height_px", "32768")
    change(widget, "focus.planes", "1000")
    assert "GiB" in rendered(app, widget) and not viewer.layers


def test_a_widget_may_be_closed_while_it_renders(app, viewer):
    widget = _widget.FieldWidget(viewer)
    change(widget, "field.width_px", "64")
    assert widget.render_field() is not None
    widget.native.deleteLater()
    app.sendPostedEvents(None, QEvent.Type.DeferredDelete)
    while widget._worker is not None:
        app.processEvents()
    assert not viewer.layers


def test_another_kind_shows_its_own_fields(widget):
    widget._section.value = "optics"
    widget._editors["optics.kind"].widget.value = "gaussian"
    assert list(widget._editors) == ["optics.kind", "optics.sigma_xy_um", "optics.sigma_z_um_per_um"]
    assert widget.message == "" and papsynth.recipe(widget.recipe) == widget.recipe
    widget._editors["optics.kind"].widget.value = "bright-field"
    assert widget.recipe["optics"] == papsynth.recipe()["optics"]


def test_changed_fields_are_marked_and_can_be_reset(widget):
    change(widget, "optics.na", "0.8")
    assert widget._editors["optics.na"].widget.label == "na *"
    assert widget._editors["optics.condenser_na"].widget.label == "condenser_na"
    widget._reset.native.click()
    assert widget.recipe == papsynth.recipe() and widget._editors["optics.na"].widget.label == "na"
    for preset in papsynth.presets():
        widget._preset.value = preset
        assert widget.recipe == papsynth.recipe(preset) and widget.message == papsynth.presets()[preset]


def test_the_mouse_wheel_scrolls_and_changes_nothing(app, widget):
    widget._section.value = "optics"
    widget.show()
    before = papsynth.recipe(widget.recipe)
    boxes = widget._form.native.findChildren(QComboBox)
    for box in boxes:
        point, turn = QPointF(box.rect().center()), QPoint(0, -120)
        none = Qt.KeyboardModifier.NoModifier
        phase = Qt.ScrollPhase.NoScrollPhase
        event = QWheelEvent(point, point, turn, turn, Qt.MouseButton.NoButton, none, phase, False)
        app.sendEvent(box, event)
    assert boxes and widget.recipe == before


def test_the_code_of_the_readme_runs(app):
    text = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```python napari\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    names = {"papsynth": papsynth, "viewer": ViewerModel()}
    exec(compile(block.replace("viewer = napari.Viewer()\n", ""), "README.md", "exec"), names)
    assert len(names["viewer"].layers) == 3


def test_layers_need_no_napari():
    frame = "papsynth.render({'field': {'width_px': 64, 'height_px': 64}})"
    script = f"import sys, papsynth.napari; papsynth.napari.layers({frame}); assert 'napari' not in sys.modules"
    subprocess.run([sys.executable, "-c", script], check=True)
