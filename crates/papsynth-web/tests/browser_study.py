"""Runs the visual study in a real browser, with keyboard and mouse, and checks the results against its answers.

Usage: browser.py PAPSYNTH CHROMIUM REAL SYNTHETIC FOLDER

FOLDER is emptied; results and screenshots go there.
"""

import base64
import csv
import json
import math
import shutil
import struct
import subprocess
import sys
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "xtask/python"))
from chromium import Browser, Served  # noqa: E402

EXPOSURE_MS = 200
LONG_EXPOSURE_MS = 800


def serve_study(program, words):
    """The program, serving one subject."""
    return Served(program, ["study", *words])


class Subject(Browser):
    """A browser with the screens of a study."""

    def screen(self):
        return self.run("document.body?.dataset.screen")

    def wait(self, screen):
        self.until(f"document.body?.dataset.screen === '{screen}'", lambda: f"the screen is {self.screen()}")

    def when(self, screen, script):
        """Runs a script in the page as soon as it shows a screen."""
        self.run(f"""new MutationObserver((_, observer) => {{
            if (document.body.dataset.screen !== '{screen}') return;
            observer.disconnect();
            {script}
        }}).observe(document.body, {{ attributes: true }})""")

    def reload(self):
        self.run("window.old = true")
        self.call("Page.reload")
        self.until("!window.old && document.body?.dataset.screen !== 'loading'")


def chunks(png):
    """Returns the types and lengths of the chunks of a PNG."""
    at, found = 8, []
    while at < len(png):
        (length,) = struct.unpack(">I", png[at : at + 4])
        found.append((png[at + 4 : at + 8], length))
        at += 12 + length
    return found


def check_secrets(browser, address, names):
    """Checks that no reply before the end reveals the labels, and that nothing comes from other servers."""
    urls = browser.requests()
    assert urls and all(url.startswith((address, "data:", "about:")) for url in urls), urls
    kinds = set()
    words = [*names, "truth", "real_field", "sha256", '"side"', '"seed"', "/out/", "session.json"]
    received = browser.received
    patches = [raw for url, _, raw in received if "/patch/" in url and raw.startswith(b"\x89PNG")]
    assert len(patches) >= 12, len(patches)
    assert len({len(raw) for raw in patches}) == 1, "sizes differ"
    for raw in patches:
        kinds.add(tuple(chunks(raw)))
    assert len(kinds) == 1 and {kind for kind, _ in next(iter(kinds))} == {b"IHDR", b"IDAT", b"IEND"}, kinds
    shapes = set()
    for url, mime, raw in received:
        if url.endswith("/result") or "/patch/" in url:
            continue
        text = raw.decode()
        for word in words:
            assert word not in text, f"{url} says {word}"
        if url.endswith(("/state", "/shown", "/answer")) and mime == "application/json":
            shapes.add(tuple(json.loads(text)))
    assert all("patches" in shape or shape == ("error",) for shape in shapes) and len(shapes) <= 2, shapes


def rows_of(folder):
    with open(folder / "trials.csv", newline="") as file:
        return list(csv.DictReader(file))


def wilson(hits, of):
    z, p = 1.959963984540054, hits / of
    centre, half = p + z * z / (2 * of), z * math.sqrt(p * (1 - p) / of + z * z / (4 * of * of))
    return [(centre - half) / (1 + z * z / of), (centre + half) / (1 + z * z / of)]


def check_results(folder, given, keys, showings, exposure_ms):
    rows = rows_of(folder)
    assert [row["answer"] for row in rows] == given, ([row["answer"] for row in rows], given)
    assert [int(row["showings"]) for row in rows] == showings, [row["showings"] for row in rows]
    for row in rows:
        exposure, frames = float(row["exposure_ms"]), int(row["frames"])
        assert exposure_ms - 20 <= exposure <= exposure_ms + 500 and frames >= 2, row
        assert 0 < float(row["response_ms"]) < 1e5 and float(row["pixel_ratio"]) == 1, row
        assert row["correct"] == str(int(row["truth"] == row["answer"]))
    counted = [row for row in rows if row["stage"] == "counted"]
    positive, negative = keys

    def count(truth, answer):
        return sum(row["truth"] == truth and row["answer"] == answer for row in counted)

    counts = {
        "tp": count(positive, positive),
        "fp": count(negative, positive),
        "tn": count(negative, negative),
        "fn": count(positive, negative),
    }
    summary = json.loads((folder / "summary.json").read_text())
    assert summary["finished"] and summary["row"]["counts"] == counts, (summary["row"], counts)
    accuracy = summary["row"]["accuracy"]
    assert accuracy["hits"] == counts["tp"] + counts["tn"] and accuracy["total"] == len(counted)
    for ours, theirs in zip(wilson(accuracy["hits"], accuracy["total"]), accuracy["wilson_95"].values()):
        assert abs(ours - theirs) < 1e-9
    return summary, rows


def yes_no(program, browser, real, synthetic, folder):
    words = [real, synthetic, "--out", folder / "out", "--subject", "01", "--trials", 10, "--exposure-ms", EXPOSURE_MS]
    study = serve_study(program, words)
    address, given, showings = study.address, [], []
    browser.open(address)
    browser.wait("welcome")
    browser.picture(folder / "welcome.png")
    # A key during the exposure must not count.
    browser.when("patch", "document.dispatchEvent(new KeyboardEvent('keydown', { key: 'ArrowLeft' }))")
    browser.press(" ")
    ways = [
        ("press", "ArrowLeft", "real"),
        ("click", "#second", "synthetic"),
        ("press", "s", "synthetic"),
        ("click", "#first", "real"),
    ]
    for trial in range(12):
        again = 1
        if trial == 3:
            browser.wait("pause")
            browser.run("delete document.hidden")
            browser.picture(folder / "covered.png")
            browser.click("#resume")
            again = 2
        if trial == 5:
            browser.until("['patch', 'question'].includes(document.body.dataset.screen)")
            browser.picture(folder / "patch.png")
        browser.wait("question")
        browser.collect()
        if trial == 1:
            browser.picture(folder / "question.png")
        if trial == 4:
            # Reload during the question: the question stays, and the patch is not shown again.
            browser.run("reported.then(() => true)")
            browser.reload()
            browser.wait("question")
        if trial == 2:
            # Hides the page during the next exposure.
            browser.when(
                "patch",
                """
                Object.defineProperty(document, "hidden", { get: () => true, configurable: true });
                document.dispatchEvent(new Event("visibilitychange"));
            """,
            )
        if trial == 6:
            code, _ = study.interrupt()
            assert code == 130, code
        way, what, answer = ways[trial % 4]
        getattr(browser, way)(what)
        if trial == 6:
            browser.wait("lost")
            browser.picture(folder / "lost.png")
            study = serve_study(program, words)
            assert study.address == address, "the open page reconnects"
        given.append(answer)
        showings.append(again)
        if trial == 1:
            browser.wait("pause")
            browser.picture(folder / "pause.png")
            browser.press(" ")
        if trial == 7:
            # Reload between trials, perhaps while a patch is loading.
            browser.until("state.answered === 8")
            browser.reload()
            browser.wait("pause")
            browser.press(" ")
            showings.append(None)
    browser.wait("result")
    browser.collect()
    browser.run("document.getElementById('more').open = true")
    browser.picture(folder / "result.png")
    subject = folder / "out/01"
    # The patch may have been sent before the reload.
    at = showings.index(None)
    showings[at : at + 2] = [int(rows_of(subject)[at]["showings"])]
    assert showings[at] in (1, 2)
    summary, _ = check_results(subject, given, ("real", "synthetic"), showings, EXPOSURE_MS)
    shown = browser.run(
        "[...document.querySelectorAll('#row tbody tr')].map(r => [...r.cells].map(c => c.firstChild.textContent))"
    )
    counts = summary["row"]["counts"]
    assert shown[0][:5] == ["01", *(str(counts[name]) for name in ("tp", "fp", "tn", "fn"))], shown
    assert shown[1][0] == "x"
    names = [path.name for side in (real, synthetic) for path in Path(side).rglob("*.png")]
    names += [str(real), str(synthetic)]
    check_secrets(browser, address, names)
    code, out = study.interrupt()
    assert code == 0 and "accuracy" in out, (code, out)


def pairs(program, browser, real, synthetic, folder):
    design = ["--design", "2afc", "--trials", 4, "--training", 1, "--exposure-ms", LONG_EXPOSURE_MS]
    words = [real, synthetic, "--out", folder / "pairs", *design]
    study = serve_study(program, words)
    browser.open(study.address)
    browser.wait("welcome")
    browser.picture(folder / "pairs-welcome.png")
    browser.click("#begin")
    given = []
    for trial in range(5):
        if trial == 2:
            # The screen may have changed before the screenshot.
            browser.until("['patch', 'question'].includes(document.body.dataset.screen)")
            browser.picture(folder / "pairs-patch.png")
        browser.wait("question")
        if trial == 2:
            browser.picture(folder / "pairs-question.png")
        what, answer = [("ArrowLeft", "left"), ("ArrowRight", "right")][trial % 2]
        browser.press(what)
        given.append(answer)
        if trial == 0:
            browser.wait("pause")
            browser.press(" ")
    browser.wait("result")
    _, rows = check_results(folder / "pairs/1", given, ("left", "right"), [1] * 5, LONG_EXPOSURE_MS)
    assert all(row["real_field"] and row["synthetic_field"] for row in rows)
    assert study.interrupt()[0] == 0


def montage(browser, folder):
    """Draws four screenshots side by side, for the README."""
    names = ["welcome", "patch", "question", "result"]
    pages = [base64.b64encode((folder / f"{name}.png").read_bytes()).decode() for name in names]
    images = "".join(f'<img src="data:image/png;base64,{page}" width="638">' for page in pages)
    browser.open("about:blank")
    browser.until("location.href === 'about:blank'")
    browser.run(f"""document.body.style = 'margin: 0; background: #555; display: flex; flex-wrap: wrap; gap: 4px';
        document.body.innerHTML = '{images}';
        Promise.all([...document.images].map((image) => image.decode())).then(() => true)""")
    browser.picture(folder / "pages.png")


def main():
    program, chromium, real, synthetic, folder = sys.argv[1:]
    real, synthetic, folder = Path(real), Path(synthetic), Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    browser = Subject(chromium)
    try:
        yes_no(program, browser, real, synthetic, folder)
        pairs(program, browser, real, synthetic, folder)
        montage(browser, folder)
        complaints = browser.complaints()
        assert not complaints, complaints
    finally:
        browser.close()
    pooled = subprocess.run(
        [program, "study", "--results", folder / "out"], check=True, capture_output=True, text=True
    ).stdout
    assert "01" in pooled and "pooled" in pooled and "384 trials" in pooled, pooled
    print(f"the study passed in {Path(chromium).name}; screenshots are in {folder}")


if __name__ == "__main__":
    main()
