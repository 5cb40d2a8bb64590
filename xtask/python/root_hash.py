"""Generates the two fields of xtask/src/release/machines.rs in FOLDER, and prints the root hash.

Usage: python root_hash.py FOLDER
"""

import sys

import papsynth

out = sys.argv[1]
papsynth.generate({"field": {"width_px": 320, "height_px": 240}}, out, 2, 7)
print("root", papsynth.merge(out, 2))
