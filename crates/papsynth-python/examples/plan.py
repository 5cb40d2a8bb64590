"""How long do ten million images take on a cluster, if machines are slow, fail, and start late? A simulation of shards on workers.

Usage: python plan.py [IMAGES [WORKERS]]. Needs numpy. Costs are those that `papsynth plan` measured; see docs/CLUSTERS.md.
"""

import heapq
import sys

import numpy as np

SECONDS_AN_IMAGE = 0.48
"""One thread, default recipe, tar files."""
SPREAD = 0.35
"""Standard deviation of one image's time over its mean."""
IMAGES_A_SHARD = 256
SLOW, SLOWNESS = 0.03, 3.0
"""Share of workers that are slow, and how slow."""
FAILURES_AN_HOUR = 0.02
"""Of each worker: what it has at work is lost, and it comes back later."""
BACK_AFTER_S = (60.0, 900.0)
START_S = (0.0, 600.0)
"""When workers start."""


def shards_s(shards, random):
    """Seconds of each shard on a usual worker."""
    mean = SECONDS_AN_IMAGE * IMAGES_A_SHARD
    return random.normal(mean, SECONDS_AN_IMAGE * SPREAD * IMAGES_A_SHARD**0.5, shards).clip(mean / 2)


def simulate(shards, workers, shares, seed):
    """Seconds until all is done, where each of `shares` tasks makes every so-manieth shard, and free workers take the next task.

    A task that is lost is begun anew and finds the shards that were whole; a shard that was at work is made again.
    """
    random = np.random.default_rng(seed)
    work = shards_s(shards, random)
    pace = np.where(random.random(workers) < SLOW, SLOWNESS, 1.0)
    tasks = [list(range(share, shards, shares)) for share in range(shares)][::-1]
    free = [(start, worker) for worker, start in enumerate(random.uniform(*START_S, workers))]
    heapq.heapify(free)
    end, made, lost = 0.0, 0, 0.0
    while tasks:
        now, worker = heapq.heappop(free)
        left = tasks.pop()
        fails_at = now + random.exponential(3600 / FAILURES_AN_HOUR)
        while left:
            needed = work[left[0]] * pace[worker]
            if now + needed > fails_at:
                lost += fails_at - now
                tasks.append(left)
                now = fails_at + random.uniform(*BACK_AFTER_S)
                break
            now += needed
            left = left[1:]
            made += 1
        else:
            end = max(end, now)
        heapq.heappush(free, (now, worker))
    assert made == shards
    return end, lost, work.sum()


def main(images=10_000_000, workers=1000):
    shards = -(-images // IMAGES_A_SHARD)
    print(f"{images} images, {shards} shards of {IMAGES_A_SHARD}, {workers} workers of one thread; five simulations each")
    print(f"{'tasks':>8} {'hours':>7} {'of ideal':>9} {'lost core hours':>16}")
    table = {}
    for shares in (workers, 4 * workers, shards):
        runs = [simulate(shards, workers, min(shares, shards), seed) for seed in range(5)]
        ends, lost, work = (np.mean(column) for column in zip(*runs))
        ideal = work / workers
        table[min(shares, shards)] = ends / ideal
        print(f"{min(shares, shards):8} {ends / 3600:7.2f} {ends / ideal:9.2f} {lost / 3600:16.1f}", flush=True)
    return table


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:3]))
