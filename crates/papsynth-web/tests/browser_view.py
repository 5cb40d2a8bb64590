"""Views a data set with a focus stack in a real browser, with keyboard and mouse, and compares the page with the files.

Usage: browser.py PAPSYNTH CHROMIUM DATASET FOLDER

FOLDER is emptied; screenshots go there.
"""

import csv
import shutil
import sys
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "xtask/python"))
from chromium import Browser, Served  # noqa: E402


class Viewer(Browser):
    """A browser with the page of the viewer."""

    def ready(self):
        self.until(
            "document.body?.dataset.ready === 'true'",
            lambda: self.run("document.getElementById('message').textContent"),
        )

    def text(self, name):
        return self.run(f"document.getElementById('{name}').textContent")

    def view(self):
        return self.run("({...view})")

    def middle(self):
        """Returns the centre of the canvas on the page."""
        return self.run("(r => [r.x + r.width / 2, r.y + r.height / 2])(canvas.getBoundingClientRect())")

    def pixel(self, x, y):
        """Returns the canvas pixel at a point of the page."""
        return self.run(f"""(r => {{
            const own = new OffscreenCanvas(1, 1).getContext("2d");
            own.drawImage(canvas, Math.floor({x} - r.x), Math.floor({y} - r.y), 1, 1, 0, 0, 1, 1);
            return [...own.getImageData(0, 0, 1, 1).data];
        }})(canvas.getBoundingClientRect())""")

    def tile_pixel(self, layer, x, y):
        """Returns the pixel of the finest tile of a layer."""
        return self.run(f"""(async () => {{
            const side = image.tile;
            const response = await fetch(`{layer}/0/${{Math.floor({y} / side)}}-${{Math.floor({x} / side)}}.png`);
            const tile = await createImageBitmap(await response.blob());
            const own = new OffscreenCanvas(tile.width, tile.height).getContext("2d");
            own.drawImage(tile, 0, 0);
            return [...own.getImageData({x} % side, {y} % side, 1, 1).data];
        }})()""")

    def look_at(self, x, y, zoom, plane=2, labels=""):
        self.run(f"location.hash = 'n=0&p={plane}&x={x}&y={y}&z={zoom}&l={labels}'")
        self.until(f"view.zoom === {zoom} && view.x === {x} && view.y === {y} && view.plane === {plane}")
        self.ready()


def near(a, b, most):
    return all(abs(one - other) <= most for one, other in zip(a, b, strict=True))


def check_moves(browser):
    whole = browser.view()
    middle = browser.middle()
    # Events have integer coordinates.
    at = [int(middle[0]) + 120, int(middle[1]) - 70]
    under = f"(p => [p.px, p.py])(placeOf({{ clientX: {at[0]}, clientY: {at[1]} }}))"
    before = browser.run(under)
    for _ in range(4):
        browser.wheel(*at, -125)
    browser.until(f"view.zoom > {whole['zoom']} * 3.9")
    assert near(browser.run(under), before, 1e-6), "the wheel zooms about the pointer"
    old = browser.view()
    browser.drag(middle, [middle[0] + 60, middle[1] + 40])
    new = browser.view()
    assert near([old["x"] - new["x"], old["y"] - new["y"]], [60 / new["zoom"], 40 / new["zoom"]], 1e-6), (old, new)
    browser.press("ArrowRight")
    browser.until(f"view.x > {new['x']}")
    browser.press("0")
    browser.until(f"view.zoom === {whole['zoom']}")
    browser.ready()


def check_pixels(browser):
    """Compares the canvas with the image files, pixel by pixel."""
    browser.look_at(200.5, 150.5, 16)
    (x, y), wrong = browser.middle(), 0
    for dx, dy in [(0, 0), (-7, 3), (9, -4), (12, 8), (-11, -6), (5, 9)]:
        shown = browser.pixel(x + 16 * dx, y + 16 * dy)
        wrong += shown != browser.tile_pixel("tile/0/2", 200 + dx, 150 + dy)
    assert wrong == 0, f"{wrong} pixels differ"


def check_planes(browser):
    place = browser.middle()
    assert browser.text("plane-text").endswith("3 of 5")
    shown = [browser.pixel(place[0] + 16 * k, place[1]) for k in range(-9, 9)]
    browser.press("]")
    browser.until("view.plane === 3")
    browser.ready()
    browser.wheel(*place, -100, shift=True)
    browser.until("view.plane === 4")
    browser.ready()
    assert browser.text("plane-text").endswith("5 of 5") and browser.run("element('plane').value") == "4"
    other = [browser.pixel(place[0] + 16 * k, place[1]) for k in range(-9, 9)]
    assert other != shown, "another plane differs"
    browser.press("[")
    browser.until("view.plane === 3")
    browser.ready()


def check_labels(browser, nucleus, folder):
    """Shows the label of a nucleus from the table, clicks it, and hides the labels again."""
    x, y = (round(float(nucleus[f"centroid_{axis}_px"])) for axis in "xy")
    browser.look_at(x + 0.5, y + 0.5, 8)
    place = browser.middle()
    plain = browser.pixel(*place)
    browser.click("#group-nucleus")
    browser.until("groups.get('nucleus').on && document.body.dataset.ready === 'true'")
    label = browser.tile_pixel("label/0/nucleus", x, y)
    assert label[3] > 0, "the nucleus has a colour"
    tinted = browser.pixel(*place)
    share = label[3] / 255
    assert near(tinted[:3], [p + share * (c - p) for p, c in zip(plain[:3], label[:3])], 4), (plain, tinted, label)
    for key in "13":
        browser.press(key)
    browser.until("[...groups.values()].every((group) => group.on)")
    browser.ready()
    browser.click("#canvas")
    browser.until("document.querySelectorAll('#objects article').length > 0")
    cards = browser.run("[...document.querySelectorAll('#objects article')].map((card) => card.textContent)")
    own = [card for card in cards if f"nucleus {nucleus['id']}" in card]
    assert len(own) == 1 and own[0].startswith(nucleus["class"]), cards
    assert f"{nucleus['class']}cytoplasm {nucleus['id']}" in " ".join(cards), cards
    browser.picture(folder / "near.png")
    browser.press("0")
    browser.ready()
    browser.picture(folder / "labels.png")


def check_reload(browser):
    browser.look_at(100.5, 120.5, 4, plane=1, labels="debris:50")
    browser.press("n")
    browser.until("image.name === 'frame 1' && view.number === 1")
    browser.until("location.hash.includes('n=1')")
    before = browser.view()
    assert before["x"] == 100.5 and before["plane"] == 1, "the next image is shown at the same position"
    browser.run("window.old = true")
    browser.call("Page.reload")
    browser.until("!window.old && document.body?.dataset.ready === 'true'")
    after = browser.view()
    assert after == before, (before, after)
    assert browser.run("groups.get('debris').on && groups.get('debris').opacity") == 0.5
    assert browser.run("element('next').disabled") and not browser.run("element('previous').disabled")
    browser.press("p")
    browser.until("image.name === 'frame 0'")


def main():
    program, chromium, dataset, folder = sys.argv[1:]
    dataset, folder = Path(dataset), Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    with open(dataset / "objects.csv", newline="") as file:
        rows = list(csv.DictReader(file))
    nuclei = [row for row in rows if row["part"] == "nucleus" and row["image"] == "0" and row["truncated"] == "false"]
    served = Served(program, ["view", dataset])
    browser = Viewer(chromium)
    try:
        browser.open(served.address)
        browser.ready()
        assert browser.text("title") == dataset.name and browser.text("count") == "2"
        browser.picture(folder / "whole.png")
        check_moves(browser)
        check_pixels(browser)
        check_planes(browser)
        check_labels(browser, min(nuclei, key=lambda row: -float(row["depth_um"])), folder)
        check_reload(browser)
        browser.check(served.address)
    finally:
        browser.close()
    code, _ = served.interrupt()
    assert code == 0, code
    print(f"the viewer passed in {Path(chromium).name}; screenshots are in {folder}")


if __name__ == "__main__":
    main()
