"""Times the peer's kernels for another program: python kernels.py

Each input line contains the name of a workload and a number of seconds. The workload runs for about this time, at least
once. The output is a line of JSON with the CPU time of each run. Each workload runs once before its first measurement.
"""

import json
import math
import os
import sys
import time

# NumPy, OpenCV and numba read these variables when they are imported.
os.environ["OMP_NUM_THREADS"] = "1"
os.environ["OPENBLAS_NUM_THREADS"] = "1"
os.environ["MKL_NUM_THREADS"] = "1"
os.environ["NUMBA_NUM_THREADS"] = "1"

import cv2
import numpy as np

import papsim

cv2.setNumThreads(1)
F = np.float32
WIDTH, HEIGHT = 1376, 1038
LEAST_S = 2e-3


def outline(points, radius=100.0, waves=3):
    """Returns the same closed curve as the Rust benchmarks."""
    angle = 2 * np.pi * np.arange(points) / points
    r = radius * (1 + 0.1 * np.cos(waves * angle))
    return np.stack([r * np.cos(angle), r * np.sin(angle)], 1)


def image():
    return np.random.default_rng(1).random((HEIGHT, WIDTH), dtype=F)


# Each function creates its inputs and returns the workload, and the number of parts that its time is divided by.


def frame():
    sim = papsim.PapSim(seed=3, accel="numba")
    return sim.frame, 1


def cloth(rim, steps, parts):
    mesh, target = papsim.ClothMesh(rim), outline(rim)
    radius, rng = float(np.hypot(*target.T).max()) * 1.03, np.random.default_rng(1)
    print(f"a sheet of {len(mesh.P)} vertices", file=sys.stderr)
    return lambda: papsim.cloth_numba(rng, mesh, target, radius, steps, 2), parts


def blur(sigma):
    img = image()
    return lambda: papsim.blur(img, sigma), 1


def noise():
    white, rng = np.full((HEIGHT, WIDTH), 17850, F), np.random.default_rng(1)

    def work():
        electrons = rng.poisson(white).astype(F)
        electrons += rng.standard_normal(electrons.shape, dtype=F) * F(70)
        return electrons

    return work, 1


def nucleus():
    rng = np.random.default_rng(1)
    donors = papsim.make_chromatin_samples(rng)
    y, x = (np.mgrid[:40, :40] + 0.5) / 20 - 1
    mask = (x * x + y * y < 1).astype(np.uint8)
    return lambda: papsim.nucleus_texture(rng, mask, donors, accel="numba"), 1


def cytoskeleton():
    rng = np.random.default_rng(7)
    mask, _ = papsim.fill_polygon(outline(420, 88.0))
    return lambda: papsim.cytoskeleton(rng, mask), 1


def perlin():
    from pyfastnoiselite.pyfastnoiselite import FastNoiseLite, FractalType, NoiseType

    octave = FastNoiseLite(7)
    octave.noise_type = NoiseType.NoiseType_Perlin
    octave.fractal_type = FractalType.FractalType_None
    octave.frequency = 1 / 64
    y, x = np.mgrid[:HEIGHT, :WIDTH].astype(F)
    coordinates = np.stack([x.ravel(), y.ravel()])
    return lambda: octave.gen_from_coords(coordinates), 1


def gibson_lanni():
    from psfmodels import scalar_psf

    z = 0.2 * (np.arange(21) - 10.0)
    return lambda: scalar_psf(z, nx=127, dxy=0.05, pz=0.0, wvl=0.6), 1


WORKS = {
    "frame": frame,
    "cloth-538": lambda: cloth(75, 60, 1),
    "cloth-10000": lambda: cloth(328, 60, 60),
    "blur-0.9": lambda: blur(0.9),
    "blur-3.6": lambda: blur(3.6),
    "blur-20": lambda: blur(20.0),
    "noise": noise,
    "nucleus": nucleus,
    "cytoskeleton": cytoskeleton,
    "perlin": perlin,
    "gibson-lanni": gibson_lanni,
}


def warm(name):
    work, parts = WORKS[name]()
    work()
    start = time.process_time()
    work()
    return work, parts, math.ceil(LEAST_S / max(time.process_time() - start, 1e-9))


def measure(work, parts, at_once, seconds):
    begin, figures = time.process_time(), []
    while not figures or time.process_time() - begin < seconds:
        start = time.process_time()
        for _ in range(at_once):
            work()
        figures.append((time.process_time() - start) / (at_once * parts))
    return figures


known = {}
for line in sys.stdin:
    name, seconds = line.split()
    try:
        if name not in known:
            known[name] = warm(name)
        print(json.dumps({"work": name, "cpu_s": measure(*known[name], float(seconds))}), flush=True)
    except ImportError as error:
        print(json.dumps({"work": name, "missing": str(error)}), flush=True)
