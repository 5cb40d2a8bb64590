"""Tests of the training scripts: a few steps on small fields, from random weights.

PAPSYNTH_TRAINERS names the scripts whose packages are installed, such as "unet,monai"; the others are not run.
"""

import importlib
import os
import re
import sys
from pathlib import Path

import numpy as np
import papsynth
import pytest

PACKAGE = Path(__file__).parent.parent
sys.path.insert(0, str(PACKAGE / "examples"))

STEPS = {
    "unet": 30,
    "monai": 30,
    "segformer": 30,
    "mask_rcnn": 12,
    "torchvision": 30,
    "monai_crops": 30,
    "datasets": 30,
    "cellpose": 40,
    "stardist": 40,
}
INSTALLED = [name for name in os.environ.get("PAPSYNTH_TRAINERS", "").split(",") if name]


def falls(losses):
    """Return whether the last third of the losses is below the first third, on average."""
    third = max(len(losses) // 3, 1)
    return np.isfinite(losses).all() and np.mean(losses[-third:]) < np.mean(losses[:third])


@pytest.mark.parametrize("name", INSTALLED)
def test_the_loss_falls_and_the_network_is_saved(name, tmp_path):
    script = importlib.import_module(f"train_{name}")
    out = tmp_path / "network"
    losses = script.main(["--steps", str(STEPS[name]), "--batch", "2", "--size", "128", "--out", str(out)])
    assert len(losses) > 1 and falls(losses), losses
    assert out.is_file() or any(out.rglob("*"))


@pytest.mark.parametrize("name", [name for name in INSTALLED if name in ("cellpose", "stardist")])
def test_weights_of_a_file_are_fine_tuned(name, tmp_path):
    script = importlib.import_module(f"train_{name}")
    small = ["--batch", "2", "--size", "128"]
    script.main(["--steps", "1", *small, "--out", str(tmp_path)])
    weights = {"cellpose": "models/nuclei", "stardist": "nuclei/weights_last.h5"}[name]
    assert script.main(["--steps", "1", *small, "--weights", str(tmp_path / weights)])


def test_invalid_options_are_rejected(capsys):
    from options import options

    for words, message in (
        (["--steps", "0"], "--steps: '0'; expected an integer of at least 1"),
        (["--size", "100"], "--size: '100'; expected a multiple of 32 of at least 64"),
        (["--batch", "two"], "--batch: 'two'; expected an integer of at least 1"),
        (["--weights", "none.h5"], "--weights: 'none.h5'; expected an existing file"),
    ):
        with pytest.raises(SystemExit):
            options("", words, steps=1, batch=1, weights=True)
        assert message in capsys.readouterr().err


def test_every_training_script_is_in_the_readme_and_is_tested():
    scripts = {path.stem.removeprefix("train_") for path in (PACKAGE / "examples").glob("train_*.py")}
    assert scripts == set(STEPS)
    text = (PACKAGE / "README.md").read_text(encoding="utf-8")
    assert set(re.findall(r"\(examples/train_(\w+)\.py\)", text)) == scripts


@pytest.mark.skipif("unet" not in INSTALLED, reason="torch is not installed")
def test_the_data_loader_of_the_readme_runs():
    text = (PACKAGE / "README.md").read_text(encoding="utf-8")
    (block,) = re.findall(r"^```python torch\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    names = {"papsynth": papsynth}
    exec(compile(block.replace("length=100_000", "length=16"), "README.md", "exec"), names)
    assert names["images"].shape == names["labels"].shape and len(names["images"]) == 8


@pytest.mark.skipif("unet" not in INSTALLED, reason="torch is not installed")
def test_a_data_loader_gives_the_same_samples_with_any_number_of_workers():
    from torch.utils.data import DataLoader
    from train_unet import sample

    fields = papsynth.Dataset({"field": {"width_px": 128, "height_px": 128}}, length=6, transform=sample)
    for one, other in zip(DataLoader(fields, 2), DataLoader(fields, 2, num_workers=2)):
        assert all(np.array_equal(a, b) for a, b in zip(one, other))


@pytest.mark.skipif("datasets" not in INSTALLED, reason="datasets is not installed")
def test_a_data_set_of_hugging_face_has_the_fields_of_its_recipe():
    from train_datasets import data_set

    recipe = papsynth.recipe({"field": {"width_px": 64, "height_px": 64}})
    rows = data_set(recipe, 3, workers=2)
    for index, row in enumerate(rows):
        frame = papsynth.render(recipe, seed=1, index=index)
        assert (row["index"], row["slide"]) == (index, frame.slide)
        assert np.array_equal(np.asarray(row["image"]), frame.image)
    assert data_set(recipe, 3, workers=2).cache_files == rows.cache_files
    other = data_set({**recipe, "camera": {**recipe["camera"], "prnu": 0.01}}, 3, workers=2)
    assert other.cache_files != rows.cache_files
