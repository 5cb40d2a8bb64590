"""Tests of the example scripts and of the code in README.md.

PAPSYNTH_REFERENCE is an optional folder of real fields.
"""

import os
import re
import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent.parent / "examples"))

REFERENCE = os.environ.get("PAPSYNTH_REFERENCE")


def test_a_sweep_shows_where_a_segmenter_breaks():
    import sweep

    table = sweep.main()
    assert table["debris.leukocytes.clusters", 30] < table["debris.leukocytes.clusters", 0] - 0.1
    # Up to 12 µm, blur hides more wrong objects than nuclei.
    assert table["focus.centre_um", 16.0] < table["focus.centre_um", 4.0] - 0.1


def test_two_segmenters_are_told_apart():
    import benchmark

    table = benchmark.main()
    assert len(table) == 8 and all(0 <= value <= 1 for value in table.values())
    for name in benchmark.SEGMENTERS:
        # Both take leukocytes for nuclei.
        assert table["inflamed", name] < table["lbc", name] - 0.3


def test_what_was_trained_on_synthetic_fields_finds_nuclei_in_others_and_in_real_ones():
    import train

    folder = None if REFERENCE is None else Path(REFERENCE, "cervix93")
    synthetic, real = train.main(folder)
    assert synthetic > 0.4
    if real is None:
        pytest.skip("PAPSYNTH_REFERENCE is not set: no real fields were tried")
    assert real > 0.5


def test_small_tasks_lose_least_to_slow_workers():
    import plan

    table = plan.main(200_000, 50)
    tasks = sorted(table)
    assert table[tasks[-1]] < table[tasks[0]] and 1 <= table[tasks[-1]] < 1.5


def test_the_code_of_the_readme_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = (Path(__file__).parent.parent / "README.md").read_text(encoding="utf-8")
    # `python torch` runs in test_training.py; `python cluster` needs a cluster.
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.DOTALL | re.MULTILINE)
    names = {}
    for block in blocks:
        exec(compile(block, "README.md", "exec"), names)
    assert len(blocks) == 3 and (tmp_path / "moved.png").exists()
    assert set(names["detections"][0]) == {"boxes", "labels", "masks", "area", "iscrowd", "image_id"}
