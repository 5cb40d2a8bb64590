"""Data sets in an unreliable object store, written by killed processes: the files must equal those in a folder.

Usage: python cluster_store.py PROGRAM FOLDER

PROGRAM is a papsynth that knows object stores. FOLDER is emptied. The store is one that speaks S3's protocol, on this
machine, behind a server that refuses some requests and loses some answers. Prints a line for each check and ends with
status 1 at the first that fails.
"""

import http.client
import http.server
import itertools
import logging
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import boto3
import papsynth
from moto.server import ThreadedMotoServer

RECIPE = {"field": {"width_px": 320, "height_px": 240}}
FRAMES, SEED = 60, 7
WORDS = {"formats": ["folder", "webdataset"], "frames_per_shard": 1}
BUCKET = "cells"
# Options for a binary with more features than the package.
OWN: list[str] = []


def check(holds, claim):
    if not holds:
        raise SystemExit(f"FAILED: {claim}")
    print(f"ok: {claim}", flush=True)


class UnreliableProxy(http.server.BaseHTTPRequestHandler):
    """Forwards requests. Rejects every 37th, and drops the reply of every 53rd after forwarding it."""

    protocol_version = "HTTP/1.1"
    counter = itertools.count(1)
    store = None
    refused = lost = 0

    def log_message(self, *_):
        pass

    def pass_on(self):
        number = next(self.counter)
        body = self.rfile.read(int(self.headers.get("content-length") or 0))
        if number % 37 == 0:
            UnreliableProxy.refused += 1
            self.send_response(503)
            self.send_header("content-length", "0")
            self.end_headers()
            return
        there = http.client.HTTPConnection(*self.store)
        there.request(self.command, self.path, body, dict(self.headers))
        answer = there.getresponse()
        content = answer.read()
        if number % 53 == 0:
            UnreliableProxy.lost += 1
            self.close_connection = True
            return
        self.send_response(answer.status)
        for name, value in answer.getheaders():
            if name.lower() not in ("content-length", "transfer-encoding", "connection", "date", "server"):
                self.send_header(name, value)
        length = answer.getheader("content-length") if self.command == "HEAD" else str(len(content))
        self.send_header("content-length", length or "0")
        self.end_headers()
        self.wfile.write(content)

    do_GET = do_PUT = do_POST = do_DELETE = do_HEAD = pass_on


class Between(http.server.ThreadingHTTPServer):
    daemon_threads = True

    def handle_error(self, *_):
        """Ignores connections closed by killed processes."""


def run(program, *words, kill_after=None):
    """Run the program, optionally kill it, and return its exit code and output."""
    process = subprocess.Popen([program, *words], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        out, err = process.communicate(timeout=kill_after)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.communicate()
        return None, ""
    return process.returncode, out + err


def generating(out, *more):
    sets = itertools.chain.from_iterable(("--set", f"field.{name}={value}") for name, value in RECIPE["field"].items())
    formats, frames = ",".join(WORDS["formats"]), str(WORDS["frames_per_shard"])
    words = ["--format", formats, "--frames-per-shard", frames, "--seed", str(SEED), "--frames", str(FRAMES)]
    return ["generate", *sets, *words, *OWN, "--out", out, *more]


def main(program, folder):
    if "--no-parquet" in run(program, "generate", "--help")[1]:
        OWN.append("--no-parquet")
    logging.getLogger("werkzeug").setLevel(logging.ERROR)
    shutil.rmtree(folder, ignore_errors=True)
    temporary = folder / "tmp"
    temporary.mkdir(parents=True)
    papsynth.generate(RECIPE, folder / "alone", FRAMES, SEED, **WORDS)
    expected = papsynth.merge(folder / "alone", FRAMES)
    files = {
        str(path.relative_to(folder / "alone")): path.read_bytes()
        for path in (folder / "alone").rglob("*")
        if path.is_file()
    }

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    UnreliableProxy.store = server.get_host_and_port()
    between = Between(("127.0.0.1", 0), UnreliableProxy)
    threading.Thread(target=between.serve_forever, daemon=True).start()
    os.environ.update(
        AWS_ACCESS_KEY_ID="papsynth",
        AWS_SECRET_ACCESS_KEY="papsynth",
        AWS_REGION="us-east-1",
        AWS_ENDPOINT_URL=f"http://127.0.0.1:{between.server_port}",
        AWS_ALLOW_HTTP="true",
        TMPDIR=str(temporary),
    )
    host, port = UnreliableProxy.store
    store = boto3.client("s3", endpoint_url=f"http://{host}:{port}", region_name="us-east-1")
    store.create_bucket(Bucket=BUCKET)

    def objects(prefix):
        pages = store.get_paginator("list_objects_v2").paginate(Bucket=BUCKET, Prefix=prefix + "/")
        keys = [found["Key"] for page in pages for found in page.get("Contents", [])]
        return {key[len(prefix) + 1 :]: store.get_object(Bucket=BUCKET, Key=key)["Body"].read() for key in keys}

    out = f"s3://{BUCKET}/killed"
    deaths = 0
    for share in ("0/2", "1/2"):
        for seconds in (0.6, 0.9, 1.3, 1.1, 0.7, 1.6):
            code, _ = run(program, *generating(out, "--task", share), kill_after=seconds)
            deaths += code is None
        code, told = run(program, *generating(out, "--task", share))
        check(code == 0, f"share {share} is completed {told if code else ''}")
    check(deaths >= 8, f"the program was killed {deaths} times")
    code, told = run(program, "status", out, "--frames", str(FRAMES))
    check(code == 0 and f"{FRAMES} of {FRAMES} shards" in told, "status reports a complete data set")
    check(run(program, "merge", out, "--frames", str(FRAMES))[0] == 0, "merge closes it")
    code, told = run(program, "verify", out, "--frames", str(FRAMES))
    check(code == 0 and expected in told, f"object store: the same root hash with the program killed: {expected}")
    check(objects("killed") == files, f"its {len(files)} objects are the files of a folder")
    check(
        UnreliableProxy.refused > 10 and UnreliableProxy.lost > 10,
        f"{UnreliableProxy.refused} requests were rejected, {UnreliableProxy.lost} replies lost",
    )

    out = f"s3://{BUCKET}/some/where"
    papsynth.generate(RECIPE, out, FRAMES, SEED, task=(1, 2), **WORDS)
    check(papsynth.missing(out, FRAMES) == list(range(0, FRAMES, 2)), "Python knows what is missing in a store")
    papsynth.generate(RECIPE, out, FRAMES, SEED, task=(0, 2), **WORDS)
    check(papsynth.merge(out, FRAMES) == expected, "Python: the same root hash in an object store")

    lost = (
        "killed/images/000007.png"
        if "images/000007.png" in files
        else f"killed/{sorted(name for name in files if '000007' in name)[0]}"
    )
    store.delete_object(Bucket=BUCKET, Key=lost)
    store.put_object(Bucket=BUCKET, Key="killed/notes.txt", Body=b"mine")
    code, told = run(program, "verify", f"s3://{BUCKET}/killed")
    check(
        code == 2 and ": missing" in told and "notes.txt" in told, "verify finds a missing object and an untracked one"
    )
    check(run(program, *generating(f"s3://{BUCKET}/killed"))[0] == 0, "the same command makes what is lost")
    code, told = run(program, "clean", f"s3://{BUCKET}/killed", "--untracked")
    check(code == 0 and objects("killed") == files, "clean removes the untracked file")

    code, told = run(program, *generating("s3://nobodys/set"))
    check(code == 74 and "s3://nobodys/set" in told, "a bucket that is not there is named")
    code, told = run(program, "rerender", f"s3://{BUCKET}/killed", "--out", str(folder / "x"), "--set", "optics.na=0.5")
    check(code == 2 and "folder" in told, "what works on folders alone says so")
    time.sleep(0.1)
    left = [path for path in temporary.iterdir() if path.name.startswith("papsynth-")]
    check(len(left) <= deaths, f"only killed programs left temporary files behind ({len(left)} folders)")
    between.shutdown()
    server.stop()


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]).absolute())
