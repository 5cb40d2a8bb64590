"""Ray and Dask with killed workers and drivers: the root hash must equal that of one process.

Usage: python cluster.py ray|dask FOLDER

FOLDER is emptied. Prints a line for each check and ends with status 1 at the first that fails.
"""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import papsynth

RECIPE = {"field": {"width_px": 320, "height_px": 240}}
FRAMES, SEED, TASKS = 60, 7, 20
WORDS = {"formats": ["folder", "webdataset"], "frames_per_shard": 1}


def check(holds, claim):
    if not holds:
        raise SystemExit(f"FAILED: {claim}")
    print(f"ok: {claim}", flush=True)


def dying(deaths, after):
    """Return a task function whose first `deaths` calls kill their worker, before the end or after the write."""
    usual = papsynth._sets.generate

    def task_of(recipe, out, frames, seed, task, options):
        marks = Path(out).parent / "deaths"
        marks.mkdir(exist_ok=True)

        def die(*_):
            # The process that creates the file kills itself.
            for number in range(deaths):
                try:
                    (marks / str(number)).touch(exist_ok=False)
                except FileExistsError:
                    continue
                os.kill(os.getpid(), signal.SIGKILL)

        usual(recipe, out, frames, seed, task=task, progress=None if after else die, **options)
        if after:
            die()

    return task_of


def deaths_in(folder):
    return len(list((folder / "deaths").iterdir()))


def is_progress(reports):
    whole = [count for count, _ in reports]
    return (
        len(whole) > 2
        and whole == sorted(set(whole))
        and whole[-1] == FRAMES
        and {total for _, total in reports} == {FRAMES}
    )


def with_ray(folder, expected):
    import papsynth.ray
    import ray

    # Workers import packages from here and receive tasks by value.
    ray.init(num_cpus=2, include_dashboard=False, logging_level="error")
    papsynth.ray._task = dying(12, after=False)
    told = []
    root = papsynth.ray.generate(
        RECIPE, folder / "set", FRAMES, SEED, tasks=TASKS, progress=lambda *counts: told.append(counts), **WORDS
    )
    check(deaths_in(folder) == 12 and root == expected, f"Ray: the same root hash with 12 workers killed: {root}")
    check(is_progress(told), "Ray: progress is reported from commit records")
    samples = list(papsynth.ray.dataset(RECIPE, SEED, 5, transform=lambda frame: frame.image))
    same = all((papsynth.render(RECIPE, SEED, index).image == image).all() for index, image in enumerate(samples))
    check(same and len(samples) == 5, "Ray: samples come in the order of their indices")
    ray.shutdown()
    killed_driver("ray", folder, expected)


def with_dask(folder, expected):
    # Allow tasks to kill several workers.
    import dask
    import papsynth.dask
    from dask.distributed import Client, LocalCluster

    dask.config.set({"distributed.scheduler.allowed-failures": 20})
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster, Client(cluster) as client:
        papsynth.dask._task = dying(8, after=True)
        told = []
        root = papsynth.dask.generate(
            RECIPE,
            folder / "set",
            FRAMES,
            SEED,
            client=client,
            tasks=TASKS,
            progress=lambda *counts: told.append(counts),
            **WORDS,
        )
    check(
        deaths_in(folder) == 8 and root == expected,
        f"Dask: the same root hash with 8 workers killed after the write: {root}",
    )
    check(is_progress(told), "Dask: progress is reported from commit records")
    killed_driver("dask", folder, expected)


def killed_driver(engine, folder, expected):
    out = folder / "resumed"
    script = f"""
import papsynth.{engine} as engine
if __name__ == "__main__":
    print(engine.generate({RECIPE!r}, {str(out)!r}, {FRAMES}, {SEED}, shards={TASKS}, **{WORDS!r}))
"""
    (folder / "driver.py").write_text(script)
    words = [sys.executable, str(folder / "driver.py")]
    driver = subprocess.Popen(
        words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True, start_new_session=True
    )
    while driver.poll() is None and len(list(out.glob("shards/*.json"))) < FRAMES // 4:
        time.sleep(0.05)
    check(driver.poll() is None, f"{engine}: the driver is killed during the run")
    os.killpg(driver.pid, signal.SIGKILL)
    driver.wait()
    told = subprocess.run(words, capture_output=True, text=True, check=True).stdout.strip().splitlines()[-1]
    check(told == expected, f"{engine}: the same root hash with the driver killed and restarted")


def main(engine, folder):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    papsynth.generate(RECIPE, folder / "alone", FRAMES, SEED, **WORDS)
    expected = papsynth.merge(folder / "alone", FRAMES)
    (folder / "root.txt").write_text(expected)
    {"ray": with_ray, "dask": with_dask}[engine](folder, expected)


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]).absolute())
