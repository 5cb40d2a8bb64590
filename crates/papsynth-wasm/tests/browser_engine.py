"""Opens the workbench of the site over a server of plain files, and compares its pixels with those of the command line.

Usage: browser_engine.py PAPSYNTH CHROMIUM SITE FOLDER

SITE is the folder that `cargo xtask site` writes; screenshots go to FOLDER.
"""

import base64
import hashlib
import re
import subprocess
import sys
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "papsynth-web/tests"))
from browser_workbench import Workbench  # noqa: E402


class Files(SimpleHTTPRequestHandler):
    def log_message(self, *_):
        pass


def load(browser):
    browser.until("document.readyState === 'complete' && element('start') && !element('load').disabled")
    assert browser.run("element('start').querySelector('img').naturalWidth > 0"), "a picture is shown first"
    browser.click("#load")
    browser.until("!element('start')", lambda: browser.run("element('loading').textContent"))
    browser.ready()


def own_hash(browser):
    """Returns the SHA-256 of the samples that the page has, which must be the one that it shows."""
    found = browser.hash()
    samples = browser.run("btoa(Array.from(new Uint8Array(shown.raw), (byte) => String.fromCharCode(byte)).join(''))")
    assert hashlib.sha256(base64.b64decode(samples)).hexdigest() == found
    return found


def printed(program, browser, folder):
    """Runs the command that the page shows, and returns the SHA-256 that it prints."""
    command = browser.run("checkLine()").replace("papsynth", f"'{program}'", 1)
    out = subprocess.run(
        ["sh", "-c", f"{command} --out '{folder / 'look.png'}'"], check=True, stdout=subprocess.PIPE, text=True
    ).stdout
    return re.search(r"SHA-256 of the grey levels: ([0-9a-f]{64})", out)[1]


def main():
    program, chromium, site, folder = sys.argv[1:]
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(Files, directory=site))
    Thread(target=server.serve_forever, daemon=True).start()
    origin = f"http://127.0.0.1:{server.server_port}/"
    browser = Workbench(chromium)
    try:
        browser.open(f"{origin}workbench/index.html")
        browser.until("document.readyState === 'complete' && element('load') !== null")
        browser.picture(folder / "start.png")
        assert not any(url.endswith((".zlib", "worker.js")) for url in browser.requests()), "the engine waits for the button"
        load(browser)
        browser.until("document.body.dataset.strip !== undefined")
        browser.picture(folder / "loaded.png")
        first = own_hash(browser)
        assert printed(program, browser, folder) == first, "the default field"
        browser.find("read noise e")
        browser.change("[data-path='camera.read_noise_e'] input[type=range]", "30")
        browser.until(f"document.body.dataset.hash !== '{first}'")
        second = own_hash(browser)
        assert browser.run("shown.head.made.phantoms === 0 && shown.head.made.planes === 0"), "only the camera is computed"
        assert printed(program, browser, folder) == second, "another read noise"
        # Outlines and objects come from the same instance.
        browser.run("setLayer('nucleus', true)")
        browser.ready()
        assert browser.run("layers.get('nucleus').bitmap.width === shown.head.width")
        browser.run("look(10, 10)")
        browser.until("element('objects').textContent !== ''")
        browser.click("#tab-text")
        browser.until("element('text').value.includes('read_noise_e = 30')")
        browser.click("#tab-form")
        # An outdated image is given up, and another instance makes the next one.
        assert browser.run("shown.head.id < IMAGES")
        browser.run("""(async () => {
            edit(["optics", "condenser_na"], 0.5);
            while (!instances.full.isBusy) await new Promise((resolve) => setTimeout(resolve));
            edit(["camera", "bits"], 12);
            instances.full.giveUp(0);
        })()""")
        browser.until("shown.head.bits === 12 && shown.head.factor === 1")
        assert browser.run("shown.head.id > IMAGES"), "the instance is another one"
        third = own_hash(browser)
        assert printed(program, browser, folder) == third, "12 bits"
        # The link opens the same field.
        link = browser.run("(keepNow(), location.href)")
        browser.open("about:blank")
        browser.open(link)
        load(browser)
        browser.until("document.body.dataset.hash !== undefined")
        assert own_hash(browser) == third
        assert browser.run("layers.get('nucleus').on && state.recipe.camera.bits === 12")
        browser.picture(folder / "link.png")
        browser.check(origin)
    finally:
        browser.close()
        server.shutdown()
    print(f"the workbench without a server passed; screenshots are in {folder}")


if __name__ == "__main__":
    main()
