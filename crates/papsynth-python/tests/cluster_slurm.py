"""Runs a job array on a local Slurm with requeued tasks and a killed daemon.

The root hash must equal that of one process.

Usage: python cluster_slurm.py PAPSYNTH FOLDER ROOT

FOLDER is emptied. Needs Debian's slurm-wlm and munge, and root. Nothing of the system's own Slurm is touched: all files
lie in a new folder below /tmp. ROOT is a file with the root hash that one process gives.
"""

import os
import re
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FRAMES, SEED, TASKS = 60, 7, 20
WORDS = [
    "--frames",
    str(FRAMES),
    "--seed",
    str(SEED),
    "--format",
    "folder,webdataset",
    "--frames-per-shard",
    "1",
    "--set",
    "field.width_px=320",
    "--set",
    "field.height_px=240",
]


def check(holds, claim):
    if not holds:
        raise SystemExit(f"FAILED: {claim}")
    print(f"ok: {claim}", flush=True)


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


class Slurm:
    """The daemons munged, slurmctld and slurmd of this test."""

    def __init__(self, folder):
        self.folder = folder
        self.processes = {}
        host = socket.gethostname().split(".")[0]
        for name in ("state", "spool", "munge"):
            (folder / name).mkdir()
        key = folder / "munge/key"
        key.write_bytes(os.urandom(1024))
        key.chmod(0o400)
        self.socket = folder / "munge/socket"
        cores = os.cpu_count()
        (folder / "slurm.conf").write_text(f"""
ClusterName=papsynth
SlurmctldHost={host}(127.0.0.1)
SlurmctldPort={free_port()}
SlurmdPort={free_port()}
AuthType=auth/munge
AuthInfo=socket={self.socket}
CredType=cred/munge
SlurmUser=root
SlurmdUser=root
StateSaveLocation={folder}/state
SlurmdSpoolDir={folder}/spool
SlurmctldPidFile={folder}/slurmctld.pid
SlurmdPidFile={folder}/slurmd.pid
SlurmctldLogFile={folder}/slurmctld.log
SlurmdLogFile={folder}/slurmd.log
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SchedulerParameters=requeue_delay=0
JobRequeue=1
ReturnToService=2
SlurmdTimeout=30
MpiDefault=none
NodeName={host} NodeAddr=127.0.0.1 CPUs={cores} State=UNKNOWN
PartitionName=main Nodes={host} Default=YES MaxTime=INFINITE State=UP
""")
        self.host = host
        self.environment = {**os.environ, "SLURM_CONF": str(folder / "slurm.conf")}
        self.start(
            "munged",
            [
                "munged",
                "--foreground",
                "--force",
                f"--key-file={key}",
                f"--socket={self.socket}",
                f"--pid-file={folder}/munge/pid",
                f"--log-file={folder}/munge/log",
                f"--seed-file={folder}/munge/seed",
            ],
        )
        self.until(self.socket.exists, "munged listens")
        self.start("slurmctld", ["slurmctld", "-D", "-i"])
        self.until(lambda: self.run("scontrol", "ping", check=False).returncode == 0, "slurmctld answers")
        self.start("slurmd", ["slurmd", "-D", "-N", host])
        self.until(lambda: "idle" in self.run("sinfo", "-h", "-o", "%t").stdout, "the node is idle")

    def start(self, name, words):
        with (self.folder / f"{name}.out").open("ab") as out:
            self.processes[name] = subprocess.Popen(
                words, env=self.environment, stdout=out, stderr=out, start_new_session=True
            )

    def run(self, *words, check=True):
        return subprocess.run(words, env=self.environment, capture_output=True, text=True, check=check)

    def until(self, holds, claim, patience_s=60):
        end = time.monotonic() + patience_s
        while not holds():
            if time.monotonic() > end:
                for log in ("slurmctld.log", "slurmd.log", "munged.out"):
                    path = self.folder / log
                    print(log, path.read_text()[-2000:] if path.exists() else "is not there")
                raise SystemExit(f"FAILED: {claim}")
            time.sleep(0.2)

    def states(self):
        return self.run("squeue", "-h", "-r", "-o", "%i %t %r").stdout.split("\n")[:-1]

    def end(self):
        for name in ("slurmd", "slurmctld", "munged"):
            if name in self.processes:
                self.processes[name].terminate()
        for process in self.processes.values():
            try:
                process.wait(20)
            except subprocess.TimeoutExpired:
                process.kill()


def main(program, folder, root):
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    out = folder / "set"
    script = folder / "job.sh"
    # The package is built without Parquet.
    told = subprocess.run([program, "generate", "--help"], capture_output=True, text=True, check=True).stdout
    own_words = [*WORDS, "--no-parquet"] if "--no-parquet" in told else WORDS
    options = ["--tasks", str(TASKS), "--threads", "1", "--", "--out", str(out), "--quiet"]
    words = [program, "submit", "slurm", *options, *own_words]
    text = subprocess.run(words, capture_output=True, text=True, check=True).stdout
    script.write_text(text.replace("papsynth generate", f"{program} generate", 1))
    # munge requires a socket folder that only its owner can write.
    own = Path(tempfile.mkdtemp(prefix="papsynth-slurm-"))
    own.chmod(0o755)
    slurm = None
    try:
        slurm = Slurm(own)
        submitted = slurm.run("sbatch", "--chdir", str(folder), str(script)).stdout
        job = re.search(r"\d+", submitted)[0]
        requeued = killed = 0
        end = time.monotonic() + 600
        while states := slurm.states():
            check_time(end, states)
            running = [state.split()[0] for state in states if state.split()[1] == "R"]
            if requeued < 12 and running:
                requeued += slurm.run("scontrol", "requeue", running[0], check=False).returncode == 0
            elif requeued >= 6 and not killed:
                slurm.processes["slurmd"].send_signal(signal.SIGKILL)
                slurm.processes["slurmd"].wait()
                killed += 1
                time.sleep(1)
                slurm.start("slurmd", ["slurmd", "-D", "-N", slurm.host])
            # Releases tasks whose launch failed, and resumes the node.
            for state in states:
                if "held" in state:
                    slurm.run("scontrol", "release", state.split()[0], check=False)
            if any(word in slurm.run("sinfo", "-h", "-o", "%t").stdout for word in ("down", "drain")):
                slurm.run("scontrol", "update", f"NodeName={slurm.host}", "State=RESUME", check=False)
            time.sleep(0.3)
        check(
            requeued >= 6 and killed == 1,
            f"Slurm: job {job}, {requeued} tasks requeued, the daemon killed {killed} times",
        )
    finally:
        if slurm is not None:
            slurm.end()
        shutil.rmtree(own, ignore_errors=True)
    left = subprocess.run(
        [program, "status", out, "--frames", str(FRAMES), "--missing"], capture_output=True, text=True, check=True
    )
    check(left.stdout.strip() == "", f"Slurm: missing shards: {left.stdout.strip()}")
    subprocess.run([program, "merge", out, "--frames", str(FRAMES)], check=True, stdout=subprocess.DEVNULL)
    told = subprocess.run(
        [program, "verify", out, "--frames", str(FRAMES)], capture_output=True, text=True, check=True
    ).stdout
    check(root in told, f"Slurm: the same root hash {root}")


def check_time(end, states):
    if time.monotonic() > end:
        raise SystemExit(f"FAILED: Slurm has not ended: {states[:5]}")


if __name__ == "__main__":
    main(str(Path(sys.argv[1]).absolute()), Path(sys.argv[2]).absolute(), Path(sys.argv[3]).read_text())
