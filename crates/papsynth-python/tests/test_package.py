"""Tests of the package: bytes of the command line, errors that name fields, forks, threads and pickles.

PAPSYNTH names the program to compare with.
"""

import copy
import functools
import json
import multiprocessing
import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import papsynth
import pytest

SMALL = {"field": {"width_px": 320, "height_px": 240}}
WORDS = ["--set", "field.width_px=320", "--set", "field.height_px=240"]
PROGRAM = os.environ.get("PAPSYNTH")


@pytest.fixture(scope="module")
def frame():
    return papsynth.render(SMALL, seed=7, index=3)


def test_arrays_have_their_shapes_and_types(frame):
    assert (frame.image.shape, frame.image.dtype) == ((240, 320), np.uint8)
    assert (frame.stack.shape, frame.noise_free.shape) == ((1, 240, 320), (1, 240, 320))
    assert np.array_equal(frame.stack[0], frame.image)
    assert frame.noise_free.dtype == np.float32 and abs(frame.noise_free.mean() - frame.image.mean()) < 1
    assert frame.image.flags.c_contiguous and frame.image.flags.writeable
    deep = papsynth.render({**SMALL, "camera": papsynth.recipe()["camera"] | {"bits": 12}}, seed=7)
    assert deep.image.dtype == np.uint16 and deep.image.max() > 255 and deep.bits == 12
    stack = papsynth.render({**SMALL, "focus": {"planes": 3}}, seed=7)
    assert stack.stack.shape == (3, 240, 320) and len(stack.planes_um) == 3 and stack.image.shape == (240, 320)
    colour = papsynth.render({**SMALL, "light": {"kind": "colour"}}, seed=7)
    assert colour.image.shape == (240, 320, 3) and colour.noise_free.shape == (1, 240, 320, 3)


def test_truth_agrees_with_itself(frame):
    table = frame.table
    assert len(frame) == len(frame.masks) == len(table["id"]) == len(frame.boxes) == len(frame.rle) > 0
    assert all(len(column) == len(frame) for column in table.values())
    assert np.array_equal(frame.masks.sum(axis=(1, 2)), table["area_px"])
    assert np.array_equal(frame.visible_masks.sum(axis=(1, 2)), table["visible_area_px"])
    assert not (frame.visible_masks & ~frame.masks).any()
    for mask, box in zip(frame.masks, frame.boxes):
        if mask.any():
            rows, columns = np.nonzero(mask.any(1))[0], np.nonzero(mask.any(0))[0]
            assert list(box) == [columns[0], rows[0], columns[-1] + 1, rows[-1] + 1]
    for group, part in (("cytoplasm", "cytoplasm"), ("nucleus", "nucleus"), ("debris", "whole")):
        labels = np.zeros(frame.image.shape, dtype=np.int32)
        for mask, number in zip(frame.visible_masks[table["part"] == part], table["id"][table["part"] == part]):
            labels[mask] = number
        assert np.array_equal(labels, frame.labels[group])
    assert np.array_equal(frame.masks[table["part"] == "cytoplasm"].sum(axis=0), frame.layers)
    assert frame.defocus_um.shape == frame.detectability.shape == (len(frame), 1)
    assert frame.labels is frame.labels, "made once"


def test_a_scene_can_be_changed_and_rendered(tmp_path):
    engine = papsynth.Engine(SMALL)
    scene = engine.scene(seed=7, index=3)
    before = engine.render(7, 3)
    assert np.array_equal(engine.render(scene=scene).image, before.image)
    (tmp_path / "scene.json").write_text(json.dumps(scene))
    assert np.array_equal(papsynth.render(SMALL, scene=tmp_path / "scene.json").image, before.image)
    scene["objects"][0]["centre_um"] = [5.0, 5.0]
    assert not np.array_equal(engine.render(scene=scene).image, before.image)
    scene["objects"][0]["depth_um"] = None
    with pytest.raises(ValueError, match=r"objects\[0\]"):
        engine.render(scene=scene)


@pytest.mark.skipif(PROGRAM is None, reason="PAPSYNTH does not name the program")
def test_bytes_are_those_of_the_command_line(tmp_path):
    for preset, words, recipe in ((None, WORDS, SMALL), ("high-grade", [], "high-grade")):
        out = tmp_path / str(preset)
        chosen = [] if preset is None else ["--preset", preset]
        subprocess.run(
            [PROGRAM, "generate", "--out", out, "--frames", "2", "--seed", "7", "--quiet", *chosen, *words], check=True
        )
        from PIL import Image

        for index in range(2):
            found = papsynth.render(recipe, seed=7, index=index)
            assert np.array_equal(np.asarray(Image.open(out / f"images/{index:06}.png")), found.image)
            import csv

            rows = [row for row in csv.DictReader((out / "objects.csv").open()) if int(row["image"]) == index]
            assert [int(row["id"]) for row in rows] == list(found.table["id"])
            assert [row["class"] for row in rows] == list(found.table["class"])
            assert [int(row["area_px"]) for row in rows] == list(found.table["area_px"])


@pytest.mark.skipif(PROGRAM is None, reason="PAPSYNTH does not name the program")
def test_data_sets_have_the_root_hash_of_the_command_line(tmp_path):
    words = ["--frames", "4", "--seed", "7", "--no-parquet"] if has_parquet() else ["--frames", "4", "--seed", "7"]
    subprocess.run([PROGRAM, "generate", "--out", tmp_path / "cli", "--quiet", *words, *WORDS], check=True)
    for part in range(3):
        papsynth.generate(SMALL, tmp_path / "py", 4, seed=7, task=(part, 3))
    assert papsynth.merge(tmp_path / "py", 4) == papsynth.verify(tmp_path / "cli", 4)["root"]


def has_parquet():
    told = subprocess.run([PROGRAM, "generate", "--help"], capture_output=True, text=True, check=True)
    return "--no-parquet" in told.stdout


def test_scenes_of_a_data_set_reproduce_its_frames(tmp_path):
    papsynth.generate(SMALL, tmp_path / "set", 2, seed=7, scenes=True)
    again = papsynth.render(SMALL, scene=tmp_path / "set/scenes/000001.json")
    assert np.array_equal(again.image, papsynth.render(SMALL, seed=7, index=1).image)


def test_data_sets_can_be_written_without_some_files(tmp_path):
    papsynth.generate(SMALL, tmp_path / "all", 1)
    papsynth.generate(SMALL, tmp_path / "few", 1, without=["noise-free", "layers", "contact-sheet"])
    names = {}
    for out in ("all", "few"):
        papsynth.merge(tmp_path / out, 1)
        assert not papsynth.verify(tmp_path / out, 1)["findings"]
        names[out] = {str(path.relative_to(tmp_path / out)) for path in (tmp_path / out).rglob("*") if path.is_file()}
    left_out = {"noise-free/000000.tif", "labels/layers/000000.tif", "contact-sheet.png"}
    assert names["all"] - names["few"] == left_out and not names["few"] - names["all"]
    papsynth.generate(SMALL, tmp_path / "one", 1, without="contact-sheet")
    with pytest.raises(ValueError, match="without: .*`labels` cannot be left out"):
        papsynth.generate(SMALL, tmp_path / "none", 1, formats=["folder", "stardist"], without=["labels"])
    assert not (tmp_path / "none").exists()


def test_data_sets_continue_and_list_missing_shards(tmp_path):
    seen = []
    first = papsynth.generate(SMALL, tmp_path / "set", 4, task=(0, 2), progress=seen.append)
    assert first == {"written": 2, "present": 0} and sorted(seen) == [0, 2]
    assert papsynth.missing(tmp_path / "set", 4) == [1, 3]
    with pytest.raises(ValueError, match="2 shards missing: 1, 3"):
        papsynth.merge(tmp_path / "set", 4)
    assert papsynth.generate(SMALL, tmp_path / "set", 4) == {"written": 2, "present": 2}
    papsynth.merge(tmp_path / "set", 4)
    image = tmp_path / "set/images/000002.png"
    image.write_bytes(image.read_bytes()[:-1])
    assert [path for path, _ in papsynth.verify(tmp_path / "set")["findings"]] == ["images/000002.png"]
    with pytest.raises(ValueError, match="seed"):
        papsynth.generate(SMALL, tmp_path / "set", 4, seed=1)
    for wrong in (
        {"task": (2, 2)},
        {"threads": 0},
        {"formats": ["jpeg"]},
        {"frames_per_shard": 0},
        {"without": "images"},
    ):
        with pytest.raises(ValueError):
            papsynth.generate(SMALL, tmp_path / "none", 4, **wrong)
    with pytest.raises(OSError):
        papsynth.generate(SMALL, "/proc/none", 4)


@pytest.mark.parametrize(
    ("recipe", "field"),
    [
        ({"field": {"widht_px": 3}}, "field.widht_px"),
        ({"field": {"width_px": "wide"}}, "field.width_px"),
        ({"field": {"width_px": 7}}, "field.width_px"),
        ({"field": {"width_px": float("nan")}}, "field.width_px"),
        ({"focus": {"planes": {"uniform": [3, 1]}}}, "focus.planes"),
        ({"layout": {"kind": "band"}, "cells": {"unknown": {"count": 3}}}, "cells.unknown"),
        ({"cytoplasm": {"sheet": "xpdb"}}, "cytoplasm.sheet"),
    ],
)
def test_errors_name_the_field(recipe, field):
    with pytest.raises(papsynth.RecipeError) as caught:
        papsynth.render(recipe)
    assert caught.value.field == field and field in str(caught.value)
    assert pickle.loads(pickle.dumps(caught.value)).errors == caught.value.errors


def test_invalid_arguments_are_rejected(tmp_path):
    for recipe in (7, {3: 4}, {"field": None}, {"field": {"width_px": object()}}, "no-such-preset.toml", tmp_path):
        with pytest.raises((ValueError, TypeError, OSError)):
            papsynth.render(recipe)
    loop = {}
    loop["field"] = loop
    with pytest.raises((ValueError, RecursionError)):
        papsynth.render(loop)
    for words in ({"seed": -1}, {"index": 2**64}, {"seed": 1.5}, {"threads": -1}, {"seed": "1"}):
        with pytest.raises((OverflowError, TypeError)):
            papsynth.render(SMALL, **words)
    (tmp_path / "recipe.toml").write_text("[field]\nwidth_px = = 3\n")
    with pytest.raises(papsynth.RecipeError, match="recipe.toml"):
        papsynth.render(tmp_path / "recipe.toml")
    (tmp_path / "model.json").write_text("{")
    with pytest.raises(ValueError, match="model.json"):
        papsynth.render(SMALL, model=tmp_path / "model.json")


def test_numbers_of_numpy_and_distributions_are_numbers():
    plain = papsynth.render(SMALL, seed=1)
    numpy = papsynth.render({"field": {"width_px": np.int64(320), "height_px": np.float32(240)}}, seed=np.uint8(1))
    assert np.array_equal(plain.image, numpy.image)


def test_threads_do_not_change_the_result(frame):
    assert np.array_equal(papsynth.render(SMALL, seed=7, index=3, threads=2).image, frame.image)
    images = {}

    def work(number):
        images[number] = papsynth.render(SMALL, seed=7, index=3).image

    threads = [threading.Thread(target=work, args=(number,)) for number in range(4)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert len(images) == 4 and all(np.array_equal(image, frame.image) for image in images.values())


def test_a_fork_after_threads_have_started_renders(frame):
    papsynth.render(SMALL, seed=7, threads=2)
    if "fork" not in multiprocessing.get_all_start_methods():
        pytest.skip("no fork here")
    with multiprocessing.get_context("fork").Pool(2) as pool:
        found = pool.map_async(_image, [(3, 2), (3, 1)]).get(timeout=120)
    assert all(np.array_equal(image, frame.image) for image in found)


def _image(words):
    index, threads = words
    return papsynth.render(SMALL, seed=7, index=index, threads=threads).image


def test_a_data_set_is_the_same_in_every_process(frame):
    samples = papsynth.Dataset(SMALL, seed=7, length=5, transform=_as_image)
    assert len(samples) == 5 and np.array_equal(samples[3], frame.image) and np.array_equal(samples[-2], frame.image)
    again = pickle.loads(pickle.dumps(samples))
    assert np.array_equal(again[3], frame.image)
    for wrong in (5, -6):
        with pytest.raises(IndexError):
            samples[wrong]
    for wrong in (1.0, "1", True):
        with pytest.raises(TypeError):
            samples[wrong]
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert np.array_equal(pool.apply_async(_third, (samples,)).get(timeout=120), frame.image)
    assert len(list(papsynth.IterableDataset(samples))) == 5
    for words in ({"length": 0}, {"seed": -1}, {"length": 1.5}):
        with pytest.raises((ValueError, TypeError)):
            papsynth.Dataset(SMALL, **words)


def _as_image(frame):
    return frame.image


def _third(samples):
    return samples[3]


def _whole(index):
    return papsynth.render(SMALL, seed=7, index=index)


def test_frames_survive_pickling(frame):
    colour = papsynth.render({**SMALL, "light": {"kind": "colour"}, "focus": {"planes": 2}})
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        others = [
            (frame, pool.apply_async(_whole, (3,)).get(timeout=120)),
            (colour, pickle.loads(pickle.dumps(colour))),
        ]
    for one, other in others:
        assert (
            repr(one) == repr(other)
            and one.planes_um == other.planes_um
            and one.rle == other.rle
            and one.visible_rle == other.visible_rle
        )
        for name in ("image", "stack", "noise_free", "layers", "boxes", "defocus_um", "detectability"):
            assert np.array_equal(getattr(one, name), getattr(other, name)), name
        assert all(np.array_equal(one.table[name], other.table[name]) for name in one.table)
        assert list(one.table) == list(other.table)
    restore, state = frame.__reduce__()
    for place, wrong in (
        (0, 2),
        (3, [frame.image[1:], frame.stack, frame.noise_free]),
        (2, (0.25, [0.0, 1.0], 8, [320, 240])),
    ):
        with pytest.raises(ValueError, match="pickled"):
            restore(*(wrong if at == place else value for at, value in enumerate(state)))
    ids, numbers, (amodal, front), seen = state[4][0]
    for damaged in (
        (ids, numbers, (amodal + "1", front), seen),
        ((1, "cell", *ids[2:]), numbers, (amodal, front), seen),
    ):
        with pytest.raises(ValueError, match=f"object {damaged[0][0]}"):
            restore(*state[:4], [damaged])


def test_a_pickle_of_another_version_is_rejected():
    state = papsynth.Dataset(SMALL).__getstate__() | {"_made_by": "0.0.1 (streams of version 0)"}
    with pytest.raises(ValueError, match=r"0\.0\.1"):
        papsynth.Dataset(SMALL).__setstate__(state)


def test_an_interrupt_ends_a_render_without_partial_files(tmp_path):
    # A background shell may have set its children to ignore SIGINT.
    handler = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler)"
    script = handler + "; import papsynth; print('begun', flush=True); papsynth.{}"
    for call in (
        "render({'focus': {'planes': 200}, 'field': {'width_px': 600, 'height_px': 600}})",
        f"generate({SMALL!r}, {str(tmp_path / 'set')!r}, 100000)",
    ):
        child = subprocess.Popen(
            [sys.executable, "-c", script.format(call)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert child.stdout.readline() == "begun\n"
        threading.Event().wait(2)
        child.send_signal(2)
        _, error = child.communicate(timeout=60)
        assert child.returncode != 0 and "KeyboardInterrupt" in error, error
    assert not list(Path(tmp_path).rglob("*.tmp"))
    done = 100000 - len(papsynth.missing(tmp_path / "set", 100000))
    assert papsynth.generate(SMALL, tmp_path / "set", max(done, 1))["present"] >= done


def test_recipes_are_completed_and_have_a_schema():
    whole = papsynth.recipe(SMALL)
    assert whole["field"]["width_px"] == 320 and "optics" in whole and "cells" in whole
    assert np.array_equal(papsynth.render(whole, seed=2).image, papsynth.render(SMALL, seed=2).image)
    assert "field" in papsynth.schema()["properties"]
    assert json.dumps(papsynth.schema())


def test_without_a_parser_of_toml_all_but_recipes_works():
    script = """
import sys
sys.modules["tomllib"] = sys.modules["tomli"] = None
import papsynth
assert papsynth.render({"field": {"width_px": 64, "height_px": 64}})._repr_png_()
assert papsynth.Engine()._repr_html_() is None
try:
    papsynth.recipe()
except ModuleNotFoundError as error:
    assert "tomli" in str(error)
else:
    raise AssertionError("no error")
"""
    subprocess.run([sys.executable, "-c", script], check=True)


def test_a_recipe_is_widened_for_training():
    wide = papsynth.recipe(SMALL, widen=2.0)
    assert papsynth.recipe(SMALL, widen=1.0) == papsynth.recipe(SMALL)
    assert (
        wide["stain"]["field_nucleus"]["log_normal"][1]
        > papsynth.recipe(SMALL)["stain"]["field_nucleus"]["log_normal"][1]
    )
    assert papsynth.render(wide, seed=2).image.shape == (240, 320)
    with pytest.raises(ValueError, match="widen: 0.5 is out of range: expected 1 to 5"):
        papsynth.recipe(SMALL, widen=0.5)


def test_techniques_work_and_reject_invalid_arguments():
    angle = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    circle = np.stack([50 + 40 * np.cos(angle), 50 + 30 * np.sin(angle)], axis=1)
    y, x = np.mgrid[:100, :100]
    mask = ((x - 50) ** 2 / 40**2 + (y - 50) ** 2 / 30**2 < 1).astype(float)
    traced = papsynth.fsd.trace(mask)
    assert traced.shape[1] == 2 and abs(traced.mean(axis=0) - 50).max() < 0.5
    model = papsynth.fsd.ShapeModel([traced * scale for scale in np.linspace(0.8, 1.2, 12)], harmonics=6)
    assert np.array_equal(model.draw(seed=3), model.draw(seed=3)) and model.draw(20.0, points=90).shape == (90, 2)
    layers = papsynth.cloth.crumple(circle, (100, 110), seed=2, vertices=200, excess=1.3)
    assert (
        layers.shape == (100, 110) and layers.dtype == np.float32 and abs(layers.sum() / (1.3 * mask.sum()) - 1) < 0.1
    )
    lines = papsynth.cytoskeleton.grow(circle, (100, 100), seed=2)
    assert 0 < lines.max() <= 1 and lines[0].max() == 0
    noise = papsynth.fields.perlin((64, 80), 16, seed=1)
    field = papsynth.fields.matern((64, 80), length_px=2.0, seed=1)
    assert noise.shape == field.shape == (64, 80) and abs(field.std() - 1) < 0.3
    quilted = papsynth.texture.quilt(field, np.ones((64, 80)), np.ones((40, 30)))
    assert np.isin(quilted, field).all()
    blurred = papsynth.optics.gaussian(mask.T[::2], 2.0)
    assert blurred.shape == (50, 100) and abs(blurred.sum() / mask.T[::2].sum() - 1) < 0.02
    light = papsynth.optics.bright_field(np.full((96, 128), 0.3))
    assert light.shape == (48, 64) and abs(light[24, 32] - 10**-0.3) < 0.01
    psf = papsynth.optics.gibson_lanni([0.0, 0.5], [-1.0, 0.0, 1.0])
    assert psf.shape == (3, 2) and psf[1, 0] >= psf[1, 1]
    counts = papsynth.noise.expose(np.full((40, 50), 9000.0), seed=4)
    assert (
        counts.dtype == np.uint16
        and counts.std() > 1
        and np.array_equal(counts, papsynth.noise.expose(np.full((40, 50), 9000), seed=4))
    )
    colour = papsynth.dyes.transmittance(eosin_y=np.full((4, 5), 0.5))
    assert colour.shape == (4, 5, 3) and colour[0, 0, 0] > colour[0, 0, 1]
    for call in (
        lambda: papsynth.fsd.trace(np.zeros((5, 5))),
        lambda: papsynth.fsd.trace(np.zeros((0, 5))),
        lambda: papsynth.fsd.trace(np.zeros(5)),
        lambda: papsynth.fsd.trace("mask"),
        lambda: papsynth.fsd.ShapeModel([]),
        lambda: papsynth.cloth.crumple(circle, (10**6, 10**6)),
        lambda: papsynth.cloth.crumple(circle, (0, 5)),
        lambda: papsynth.cloth.crumple(circle.T, (100, 100)),
        lambda: papsynth.cloth.crumple(np.full((9, 2), np.nan), (100, 100)),
        lambda: papsynth.cloth.crumple(circle, (100, 100), excess=99),
        lambda: papsynth.fields.perlin((5, 5), 0),
        lambda: papsynth.texture.quilt(field, np.ones((3, 3)), np.ones((4, 4))),
        lambda: papsynth.optics.gaussian(mask, -1),
        lambda: papsynth.optics.bright_field(mask, na=9),
        lambda: papsynth.noise.expose(mask, camera="eye"),
        lambda: papsynth.dyes.transmittance(),
        lambda: papsynth.dyes.transmittance(eosin_y=np.ones((2, 2)), orange_g=np.ones((2, 3))),
    ):
        with pytest.raises((ValueError, TypeError)):
            call()


def test_recipes_are_objects_too_which_know_every_field():
    from papsynth.recipes import CellMix, Field, OpticsBrightField, Recipe, uniform

    recipe = Recipe(
        field=Field(width_px=320, height_px=240),
        optics=OpticsBrightField(na=0.9),
        cells={"intermediate": CellMix(count=uniform(3, 5))},
    )
    plain = recipe.to_dict()
    assert plain["optics"] == {"kind": "bright-field", "na": 0.9}
    assert plain["cells"]["intermediate"]["count"] == {"uniform": [3, 5]}
    assert np.array_equal(papsynth.render(recipe, seed=1).image, papsynth.render(plain, seed=1).image)
    assert np.array_equal(
        pickle.loads(pickle.dumps(papsynth.Dataset(recipe, length=2)))[1].image, papsynth.render(plain, index=1).image
    )
    with pytest.raises(TypeError):
        Field(widht_px=3)
    tool = Path(__file__).parent.parent / "tools/write_recipes.py"
    checked = subprocess.run(
        [sys.executable, tool, "--check"], input=json.dumps(papsynth.schema()), capture_output=True, text=True
    )
    assert checked.returncode == 0, checked.stderr


def test_a_field_that_a_recipe_does_not_have_is_refused_and_recipes_are_copied():
    from papsynth.recipes import Field, Recipe

    recipe = Recipe(field=Field(width_px=64))
    with pytest.raises(AttributeError, match="widht_px"):
        recipe.field.widht_px = 128
    for copied in (copy.deepcopy(recipe), pickle.loads(pickle.dumps(recipe))):
        copied.field.width_px = 128
        assert recipe.to_dict() == {"field": {"width_px": 64}} and copied.to_dict() == {"field": {"width_px": 128}}


@pytest.mark.skipif(not os.path.exists("/proc/meminfo"), reason="the system does not tell what memory there is")
def test_what_does_not_fit_into_memory_is_refused():
    with pytest.raises(MemoryError, match=r"field.width_px.* GiB"):
        papsynth.Dataset(
            {"field": {"width_px": 32768, "height_px": 32768}, "focus": {"planes": 21}, "light": {"kind": "colour"}}
        )


def test_a_class_is_learned_and_rendered():
    nuclei = []
    for index in range(3):
        frame = papsynth.render("sparse", seed=3, index=index)
        chosen = (frame.table["part"] == "nucleus") & (frame.table["area_um2"] > 20) & ~frame.table["truncated"]
        for number in np.flatnonzero(chosen):
            x0, y0, x1, y1 = frame.boxes[number] + [-4, -4, 4, 4]
            if min(x0, y0) >= 0 and x1 <= frame.image.shape[1] and y1 <= frame.image.shape[0]:
                nuclei.append((frame.image[y0:y1, x0:x1], frame.masks[number, y0:y1, x0:x1]))
    model = papsynth.learn("mine", 0.25, nuclei=nuclei, like="intermediate", numbers_only=True, source="this test")
    frame = papsynth.render({**SMALL, "cells": {"mine": {"count": 3}}}, seed=1, model=model)
    assert "mine" in frame.table["class"]
    samples = papsynth.Dataset({**SMALL, "cells": {"mine": {"count": 3}}}, seed=1, model=model)
    assert np.array_equal(pickle.loads(pickle.dumps(samples))[0].image, frame.image)
    for wrong in (
        {"like": "unknown"},
        {"pixel_um": -1.0},
        {"nuclei": nuclei[:1]},
        {"cytoplasm_outlines": [np.zeros((4, 3))]},
        {"nuclei": [(np.ones((3, 3)), np.ones((4, 4)))]},
    ):
        with pytest.raises(ValueError):
            papsynth.learn(**{"name": "mine", "pixel_um": 0.25, "nuclei": nuclei, "like": "intermediate", **wrong})


def test_a_microscope_is_measured():
    y, x = np.mgrid[:96, :96].astype(np.float64)

    def smooth_step(distance, sigma):
        from math import erf

        return 0.5 * (1 + np.vectorize(erf)(distance / (sigma * 2**0.5)))

    edge = 80 + 120 * smooth_step(0.8 * (x - 45.3) + 0.6 * (y - 50.1), 0.9)
    found = papsynth.calibrate_microscope(edge=edge, pixel_um=0.2)
    assert abs(found["edge"]["sigma_px"] - 0.9) < 0.02 and "focus" not in found
    assert abs(found["recipe_gaussian"]["optics"]["sigma_xy_um"] - 0.18) < 0.005
    assert papsynth.recipe(found["recipe"])["optics"]["kind"] == "bright-field"
    # A disc with spots, blurred in proportion to the distance from the fourth plane.
    planes = []
    for plane in range(9):
        sigma = (0.8**2 + (0.6 * (plane - 4)) ** 2) ** 0.5
        image = 200 - 80 * smooth_step(16 - np.hypot(x - 48, y - 48), sigma)
        for u, v in ((40, 44), (55, 50), (47, 57), (52, 40)):
            image -= 60 * np.exp(-((x - u) ** 2 + (y - v) ** 2) / (2 * (sigma**2 + 4))) * 4 / (sigma**2 + 4)
        planes.append(image)
    stack = papsynth.calibrate_microscope(np.array(planes), windows=[(22, 22, 52, 52)])
    assert stack["focus"]["nuclei"][0]["focused"] == 4 and stack["recipe"] is None
    assert stack == papsynth.calibrate_microscope(np.array(planes), windows=[(22, 22, 52, 52)], threads=1)
    for wrong in (
        {},
        {"stack": planes[:2]},
        {"stack": [np.zeros((64, 64))] * 4},
        {"edge": edge, "na": 1.2},
        {"edge": edge, "line": (0, 0, 4, 0)},
        {"stack": [planes[0], planes[1][:50], planes[2]]},
    ):
        with pytest.raises(ValueError):
            papsynth.calibrate_microscope(**wrong)


def test_a_camera_is_measured():
    random = np.random.default_rng(5)

    def frames(electrons, count=2):
        charge = random.poisson(electrons, (count, 128, 128)) + random.normal(0, 9, (count, 128, 128))
        return np.clip(np.rint(100 + 0.25 * charge), 0, 4095).astype(np.uint16)

    flats, darks = [frames(electrons) for electrons in (1000, 4000, 8000, 12000)], frames(0, 8)
    found = papsynth.calibrate_camera(flats, darks, bits=12)
    assert abs(found["camera"]["gain_dn_per_e"] - 0.25) < 0.006 and len(found["camera"]["levels"]) == 5
    assert abs(found["recipe"]["camera"]["offset_dn"] - 100) < 0.2 and found["recipe"]["camera"]["bits"] == 12
    papsynth.recipe(found["recipe"])
    for wrong in (
        (flats, darks, 8),
        (flats, [], 12),
        (flats, darks, 17),
        (flats, darks + 0.5, 12),
        (flats, darks, None),
    ):
        with pytest.raises(ValueError):
            papsynth.calibrate_camera(*wrong[:2], bits=wrong[2])


def test_fields_are_judged():
    recipe = {"field": {"width_px": 640, "height_px": 480}}
    one, other = ([papsynth.render(recipe, seed=seed, index=index).image for index in range(6)] for seed in (1, 2))
    report = papsynth.judge(one, other, 0.25, quick=True)
    assert papsynth.judge(one, other, 0.25, quick=True, features="1")["judge"]["features"] == "1"
    with pytest.raises(ValueError, match="features: expected '1' or '2'"):
        papsynth.judge(one, other, 0.25, features="3")
    assert report["conclusion"] and report == papsynth.judge(one, other, 0.25, quick=True, threads=1)
    for wrong in ((one[:1], other, 0.25), (one, other, -1.0), (one, [np.zeros(3)] * 3, 0.25), ([], other, 0.25)):
        with pytest.raises((ValueError, TypeError)):
            papsynth.judge(*wrong)


def test_a_recipe_is_matched_to_fields():
    start = {"field": {"width_px": 340, "height_px": 260, "pixel_um": 0.5}}
    other = {**start, "background": {"level": 0.8, "texture": 0.004}}
    fields = [
        papsynth.render({**other, "slide": {"fields_per_slide": 1}}, seed=3, index=index).image for index in range(3)
    ]
    found = papsynth.match(fields, 0.5, recipe=start, simulations=60, seed=1)
    level = next(p for p in found["parameters"] if p["parameter"] == "level")
    assert abs(level["value"] - 0.8) < 0.03 and len(level["fields"]) == len(found["recipe"]["conditions"]) == 3
    assert found["toml"].startswith("# Matched to 3 fields") and np.isfinite(found["distance"]["after"])
    assert papsynth.render(found["recipe"], seed=1).image.shape == (260, 340)
    # Pale nuclei are not found in small fields in colour.
    coloured = {**other, "light": {"kind": "colour"}, "stain": {"slide_nucleus": 1.5}}
    fields_in_colour = [papsynth.render(coloured, seed=6, index=index).image for index in range(4)]
    found = papsynth.match(fields_in_colour, 0.5, recipe=start, simulations=60, quick=True)
    assert found["colour"] and papsynth.render(found["recipe"], seed=1).image.shape == (260, 340, 3)
    for wrong in ((fields[:1], 0.5), (fields, -1.0), ([np.full((90, 90), 200, np.uint8)] * 2, 0.5), ([], 0.5)):
        with pytest.raises((ValueError, TypeError)):
            papsynth.match(*wrong)


def test_targets_are_those_of_detectors():
    cells = {"superficial": {"count": 3}, "intermediate": {"count": 3}}
    frame = papsynth.render({**SMALL, "cells": cells}, seed=7)
    target = papsynth.detection_target(frame)
    count = len(target["labels"])
    assert count == (frame.table["part"] == "nucleus").sum() and target["boxes"].shape == (count, 4)
    assert (target["boxes"][:, 2:] > target["boxes"][:, :2]).all()
    assert np.array_equal(target["masks"].sum(axis=(1, 2)), target["area"])
    some = papsynth.detection_target(frame, "cytoplasm", ["superficial", "intermediate"])
    assert set(some["labels"]) <= {1, 2} and len(some["labels"]) > 0
    with pytest.raises(ValueError, match="part"):
        papsynth.detection_target(frame, "cell")


def test_semantic_targets_have_nuclei_mimics_and_ignored_pixels(tmp_path):
    from PIL import Image

    debris = {"leukocytes": {"clusters": 8}, "bare_nuclei": {"count": 3}}
    recipe = {**SMALL, "cells": {"intermediate": {"count": 6}}, "debris": debris}
    frame = papsynth.render(recipe, seed=7)
    names, table = papsynth.SEMANTIC_CLASSES, frame.table
    assert names.index("background") == 0 and set(papsynth.MIMICS) == {"shred", "leukocyte", "bare-nucleus"}
    assert set(table["semantic_class"][table["part"] == "nucleus"]) == {"nucleus"}
    # Without a minimum, each pixel has the largest number of its masks.
    number = np.array([names.index(name) for name in table["semantic_class"]], dtype=np.uint8)
    everything = papsynth.semantic_target(frame, min_detectability=0)
    assert everything.dtype == np.uint8 and everything.shape == (240, 320)
    assert np.array_equal(everything, (number[:, None, None] * frame.masks).max(axis=0))
    two = papsynth.semantic_target(frame, ["nucleus", papsynth.MIMICS], min_detectability=0)
    of_class = np.isin(everything, [names.index(name) for name in papsynth.MIMICS])
    assert np.array_equal(two == 1, everything == names.index("nucleus")) and np.array_equal(two == 2, of_class)
    assert set(np.unique(two)) == {0, 1, 2}
    # Ignored objects: nuclei and mimics whose best plane is below the minimum.
    due = np.isin(table["semantic_class"], ["nucleus", *papsynth.MIMICS])
    for least in (papsynth.MIN_DETECTABILITY, float(np.median(frame.detectability.max(axis=1)[due]))):
        expected = due & (frame.detectability.max(axis=1) < least)
        assert np.array_equal(frame.ignored(least), expected)
        target = papsynth.semantic_target(frame, min_detectability=least)
        assert (frame.masks[expected].any(axis=0) | (target != papsynth.IGNORED)).all()
        assert not (frame.masks[due & ~expected].any(axis=0) & (target == papsynth.IGNORED)).any()
        nuclei = papsynth.detection_target(frame, min_detectability=least)
        assert np.array_equal(nuclei["iscrowd"], expected[table["part"] == "nucleus"])
    assert expected.any() and not frame.ignored(0).any()
    both = papsynth.detection_target(frame, None, ["nucleus", papsynth.MIMICS], by="semantic_class")
    assert len(both["labels"]) == due.sum() and set(both["labels"]) == {1, 2}
    assert np.array_equal(both["iscrowd"] == 1, frame.ignored()[due])
    # A data set of samples, and files with the same values.
    nucleus = functools.partial(papsynth.semantic_target, classes=["nucleus"], min_detectability=0)
    samples = pickle.loads(pickle.dumps(papsynth.Dataset(recipe, 7, 2, transform=nucleus)))
    assert np.array_equal(samples[0] == 1, everything == names.index("nucleus"))
    papsynth.generate(recipe, tmp_path / "set", 1, seed=7, min_detectability=least)
    assert np.array_equal(np.asarray(Image.open(tmp_path / "set/labels/semantic/000000.png")), target)
    papsynth.merge(tmp_path / "set", 1)
    annotations = json.loads((tmp_path / "set/coco.json").read_text())["annotations"]
    assert [one["iscrowd"] for one in annotations] == list(expected)
    assert not papsynth.verify(tmp_path / "set", 1)["findings"]
    for call, message in (
        (
            lambda: papsynth.semantic_target(frame, ["nuclei"]),
            "classes: unknown class `nuclei`; expected some of background, ",
        ),
        (lambda: papsynth.semantic_target(frame, "nucleus"), "classes: 'nucleus'; expected a list of unique names"),
        (lambda: papsynth.semantic_target(frame, ["shred", papsynth.MIMICS]), "expected a list of unique names"),
        (lambda: papsynth.semantic_target(frame, min_detectability=-1), "min_detectability: -1 is out of range"),
        (lambda: papsynth.detection_target(frame, min_detectability=np.inf), "min_detectability: inf is out of range"),
        (lambda: papsynth.detection_target(frame, by="kind"), "by: 'kind'; expected 'class' or 'semantic_class'"),
        (lambda: papsynth.detection_target(frame, None, ["x"], by="semantic_class"), "classes: unknown class 'x'"),
        (lambda: papsynth.generate(recipe, tmp_path / "none", 1, min_detectability=np.nan), "min_detectability: NaN"),
    ):
        with pytest.raises(ValueError) as caught:
            call()
        assert message in str(caught.value)


def test_a_frame_is_saved_as_a_picture(tmp_path):
    from PIL import Image

    for recipe in (SMALL, {**SMALL, "light": {"kind": "colour"}}, {**SMALL, "camera": {"bits": 12}}):
        frame = papsynth.render(recipe, 3, 1)
        frame.save(tmp_path / "field.png")
        picture = np.asarray(Image.open(tmp_path / "field.png"))
        # The lowest of 12 bits are kept.
        assert picture.shape == frame.image.shape and (picture == frame.image).all(), recipe
    with pytest.raises(OSError, match="nowhere"):
        frame.save(tmp_path / "field.png" / "nowhere.png")


def test_a_data_set_is_its_own_wherever_it_is_unpickled(tmp_path, monkeypatch):
    recipe = {"field": {"width_px": 320, "height_px": 240}}
    samples = papsynth.Dataset(recipe, 1, 3)
    recipe["field"]["width_px"] = 64
    assert pickle.loads(pickle.dumps(samples))[1].image.shape == samples[1].image.shape == (240, 320)
    path = tmp_path / "mine.toml"
    path.write_text("[field]\nwidth_px = 320\nheight_px = 240\n")
    monkeypatch.chdir(tmp_path)
    pickled = pickle.dumps(papsynth.Dataset("mine.toml", 1, 3))
    monkeypatch.chdir("/")
    assert pickle.loads(pickled)[0].image.shape == (240, 320)
    path.write_text("[field]\nwidth_px = 300\nheight_px = 240\n")
    with pytest.raises(ValueError, match="has changed"):
        pickle.loads(pickled)
    for words in ({"start": 2**64 - 1}, {"length": 2**63}, {"transform": 5}):
        with pytest.raises((ValueError, TypeError), match=next(iter(words))):
            papsynth.Dataset(SMALL, **{"seed": 1, "length": 3, **words})


def test_a_file_that_a_recipe_names_is_read_again(tmp_path):
    from PIL import Image

    recipe = {**SMALL, "layout": {"kind": "density-map", "path": str(tmp_path / "map.png")}}
    seen = []
    for half in (slice(0, 32), slice(32, 64)):
        grey = np.zeros((64, 64), np.uint8)
        grey[:, half] = 255
        Image.fromarray(grey).save(tmp_path / "map.png")
        seen.append(papsynth.render(recipe, 1).image)
    assert (seen[0] != seen[1]).any()


def test_a_fork_while_threads_are_begun_does_not_hang():
    script = f"""
import os, sys, threading, time
import papsynth
papsynth.render({SMALL!r})
for delay in (0.0005, 0.002, 0.005):
    thread = threading.Thread(target=papsynth.render, args=({SMALL!r},), kwargs={{"threads": 300}})
    thread.start()
    time.sleep(delay)
    child = os.fork()
    if child == 0:
        papsynth.render({SMALL!r}, 1, threads=2)
        os._exit(0)
    thread.join()
    assert os.waitpid(child, 0)[1] == 0
"""
    subprocess.run([sys.executable, "-W", "ignore", "-c", script], check=True, timeout=120)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda a: papsynth.noise.expose(a * np.nan), "electrons[0, 0]: NaN"),
        (lambda a: papsynth.noise.expose(-a), "electrons[0, 0]: -1"),
        (lambda a: papsynth.noise.expose(a + 1j), "electrons: expected booleans, integers or floats, found complex128"),
        (
            lambda a: papsynth.noise.expose(a.astype("U")),
            "electrons: expected booleans, integers or floats, found <U32",
        ),
        (lambda a: papsynth.optics.bright_field(a, np.nan), "defocus_um"),
        (lambda a: papsynth.optics.gaussian(a * 1e300, 2), "image[0, 0]: inf"),
        (lambda a: papsynth.optics.gaussian(a[0], 2), "image: expected two dimensions, found the shape [12]"),
        (lambda a: papsynth.dyes.transmittance(haematein=-a), "haematein[0, 0]: -1"),
        (lambda a: papsynth.texture.quilt(a, a[1:], a), "mask: expected the shape of source, (12, 12), found (11, 12)"),
        (lambda a: papsynth.fsd.trace(a * 255), "mask[0, 0]: 255 is out of range: expected 0 to 1"),
        (lambda a: papsynth.fsd.ShapeModel([a, a, None]), "outlines[0]: expected the shape (n, 2), found (12, 12)"),
        (
            lambda a: papsynth.cloth.crumple(np.ones((70000, 2)), (48, 64)),
            "outline: expected 3 to 65536 points, found 70000",
        ),
        (lambda a: papsynth.render("nonexist"), "recipe: no file or preset `nonexist`"),
        (lambda a: papsynth.render(5), "recipe: expected None, a dictionary, the path of a TOML file or one of lbc"),
        (lambda a: papsynth.render(SMALL, threads=2000), "threads: 2000"),
        (lambda a: papsynth.learn("lsil", 0.25, cytoplasm_outlines=[]), "expected at least one of these"),
        (
            lambda a: papsynth.learn("lsil", 0.25, cytoplasm_outlines=[a[:2, :2]]),
            "cytoplasm_outlines[0]: expected 3 or more points, found 2",
        ),
        (lambda a: papsynth.generate(SMALL, "", 3), "the path of the data set is empty"),
        (lambda a: papsynth.generate(SMALL, "x", 0), "frames: 0"),
        (lambda a: papsynth.missing("x", 2**64 - 1), "frames: 18446744073709551615"),
    ],
)
def test_what_cannot_be_used_is_named(call, named, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((ValueError, TypeError, OSError)) as caught:
        call(np.ones((12, 12)))
    assert named in str(caught.value) and not list(tmp_path.iterdir())


def test_more_frames_than_were_asked_for_are_told(tmp_path):
    papsynth.generate(SMALL, tmp_path / "set", 3)
    with pytest.raises(ValueError, match="frames: 2; the data set has 3"):
        papsynth.merge(tmp_path / "set", 2)
    assert papsynth.merge(tmp_path / "set", 3) == papsynth.verify(tmp_path / "set")["root"]


def test_classes_of_a_target_are_a_list_of_names():
    for classes in ("intermediate", ["a", "a"]):
        with pytest.raises(ValueError, match="classes"):
            papsynth.detection_target(papsynth.render(SMALL), classes=classes)
