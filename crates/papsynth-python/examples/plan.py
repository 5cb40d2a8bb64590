"""Simulates the generation of ten million images on a cluster with slow, failing and late workers.

Usage: python plan.py [IMAGES [WORKERS]]. Needs numpy. Times were measured with `papsynth plan`; see docs/CLUSTERS.md.
"""

import heapq
import sys

import numpy as np

SECONDS_PER_IMAGE = 0.48
"""One thread, default recipe, tar files."""
RELATIVE_SD = 0.35
"""Standard deviation of the time of an image, relative to its mean."""
IMAGES_PER_SHARD = 256
SLOW_FRACTION, SLOWDOWN = 0.03, 3.0
"""Fraction of slow workers, and their slowdown."""
FAILURES_PER_HOUR = 0.02
"""Failures of a worker. Its current shard is lost, and it restarts later."""
RESTART_S = (60.0, 900.0)
START_S = (0.0, 600.0)
"""Range of start times."""


def shards_s(shards, random):
    """Return the time of each shard on a normal worker, seconds."""
    mean = SECONDS_PER_IMAGE * IMAGES_PER_SHARD
    return random.normal(mean, SECONDS_PER_IMAGE * RELATIVE_SD * IMAGES_PER_SHARD**0.5, shards).clip(mean / 2)


def simulate(shards, workers, tasks, seed):
    """Return the total time, the lost time and the ideal work of a run, seconds. Idle workers take the next task.

    A lost task is repeated without its complete shards.
    """
    random = np.random.default_rng(seed)
    work = shards_s(shards, random)
    pace = np.where(random.random(workers) < SLOW_FRACTION, SLOWDOWN, 1.0)
    queue = [list(range(task, shards, tasks)) for task in range(tasks)][::-1]
    free = [(start, worker) for worker, start in enumerate(random.uniform(*START_S, workers))]
    heapq.heapify(free)
    end, done, lost = 0.0, 0, 0.0
    while queue:
        now, worker = heapq.heappop(free)
        left = queue.pop()
        fails_at = now + random.exponential(3600 / FAILURES_PER_HOUR)
        while left:
            needed = work[left[0]] * pace[worker]
            if now + needed > fails_at:
                lost += fails_at - now
                queue.append(left)
                now = fails_at + random.uniform(*RESTART_S)
                break
            now += needed
            left = left[1:]
            done += 1
        else:
            end = max(end, now)
        heapq.heappush(free, (now, worker))
    assert done == shards
    return end, lost, work.sum()


def main(images=10_000_000, workers=1000):
    shards = -(-images // IMAGES_PER_SHARD)
    task = f"{images} images, {shards} shards of {IMAGES_PER_SHARD}"
    print(f"{task}, {workers} workers of one thread; five simulations each")
    print(f"{'tasks':>8} {'hours':>7} {'relative':>9} {'lost core hours':>16}")
    table = {}
    for tasks in (workers, 4 * workers, shards):
        runs = [simulate(shards, workers, min(tasks, shards), seed) for seed in range(5)]
        ends, lost, work = (np.mean(column) for column in zip(*runs))
        ideal = work / workers
        table[min(tasks, shards)] = ends / ideal
        print(f"{min(tasks, shards):8} {ends / 3600:7.2f} {ends / ideal:9.2f} {lost / 3600:16.1f}", flush=True)
    return table


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
