"""Changes a recipe in the workbench with keyboard and mouse, and compares its pixels with those of the command line.

Usage: browser_workbench.py PAPSYNTH CHROMIUM FOLDER [--times]

FOLDER is emptied; screenshots and images go there. With --times, prints the times from a change of the default recipe
to its image in the browser instead.
"""

import hashlib
import json
import shutil
import struct
import subprocess
import sys
import zlib
from pathlib import Path

sys.dont_write_bytecode = True
sys.path.insert(0, str(Path(__file__).resolve().parents[3] / "xtask/python"))
from chromium import Browser, Served  # noqa: E402

SMALL = ["--set", "field.width_px=320", "--set", "field.height_px=240", "--set", "cells.intermediate.count=4"]


class Workbench(Browser):
    """A browser with the page of the workbench."""

    def ready(self):
        self.until(
            "document.body?.dataset.ready === 'true' && document.body.dataset.full === 'true'",
            lambda: self.run("document.body.innerText"),
        )

    def hash(self):
        self.ready()
        self.until(
            "document.body.dataset.hash !== undefined && element('hash').textContent === document.body.dataset.hash"
        )
        return self.run("document.body.dataset.hash")

    def change(self, selector, value):
        """Sets a control as a user does."""
        self.run(f"""(node => {{
            node.value = {json.dumps(value)};
            node.dispatchEvent(new Event("input", {{ bubbles: true }}));
            node.dispatchEvent(new Event("change", {{ bubbles: true }}));
        }})(document.querySelector({json.dumps(selector)}))""")

    def find(self, words):
        self.run(f"element('search').value = {json.dumps(words)}; element('search').dispatchEvent(new Event('input'))")


def pixels(path):
    """Returns the samples of a grey PNG of 8 bits."""
    data, at, parts = path.read_bytes(), 8, []
    width = height = 0
    while at < len(data):
        (length,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", body[:10])
            assert (depth, colour) == (8, 0), "a grey image of 8 bits"
        elif kind == b"IDAT":
            parts.append(body)
        at += 12 + length
    raw, rows, above = zlib.decompress(b"".join(parts)), [], bytes(width)
    for y in range(height):
        kind, row = raw[y * (width + 1)], bytearray(raw[y * (width + 1) + 1 : (y + 1) * (width + 1)])
        for x in range(width):
            left, up = (row[x - 1] if x else 0), above[x]
            corner = above[x - 1] if x else 0
            guess = left + up - corner
            paeth = min((left, up, corner), key=lambda c: abs(guess - c))
            row[x] = (row[x] + [0, left, up, (left + up) // 2, paeth][kind]) & 255
        rows.append(bytes(row))
        above = row
    return b"".join(rows)


def generated(program, command, folder, name):
    """Runs the command line that the page shows, and returns the SHA-256 of the pixels of its image."""
    out = folder / name
    command = command.replace("--out field", f"--quiet --out '{out}'").replace("papsynth", f"'{program}'", 1)
    subprocess.run(["sh", "-c", command], check=True, stdout=subprocess.DEVNULL)
    (image,) = (out / "images").glob("*.png")
    return hashlib.sha256(pixels(image)).hexdigest()


def check_slider(browser):
    first = browser.hash()
    browser.find("read noise e")
    slider = "[data-path='camera.read_noise_e'] input[type=range]"
    browser.change(slider, "30")
    browser.until(f"document.body.dataset.hash !== '{first}'")
    second = browser.hash()
    assert browser.run("state.recipe.camera.read_noise_e") == 30
    assert browser.run("shown.head.made.phantoms === 0 && shown.head.made.planes === 0"), "only the camera is computed"
    assert browser.run("document.querySelector('[data-path=\"camera.read_noise_e\"]').classList.contains('changed')")
    browser.click("#undo")
    browser.until(f"document.body.dataset.hash === '{first}'")
    browser.ready()
    browser.click("#redo")
    browser.until(f"document.body.dataset.hash === '{second}'")
    browser.ready()
    browser.find("")
    return second


def check_text(browser, second):
    browser.click("#tab-text")
    browser.until("element('text').value.includes('read_noise_e = 30')")
    text = browser.run("element('text').value")
    wrong = text.replace("read_noise_e = 30", "read_noise = 30")
    line = wrong[: wrong.index("read_noise = 30")].count("\n") + 1
    browser.change("#text", wrong)
    browser.until("document.querySelectorAll('#lines .wrong').length === 1")
    assert browser.run("document.querySelector('#lines .wrong').textContent") == str(line)
    assert "read_noise_e" in browser.run("element('text-errors').textContent"), "the error suggests the field"
    assert browser.run("document.body.dataset.hash") == second, "the last image stays"
    browser.change("#text", text.replace("read_noise_e = 30", "read_noise_e = 31"))
    browser.until("state.recipe.camera.read_noise_e === 31 && document.querySelectorAll('#lines .wrong').length === 0")
    browser.ready()
    browser.click("#tab-form")
    browser.run("element('undo').focus()")
    browser.click("#undo")
    browser.until(f"document.body.dataset.hash === '{second}'")


def check_objects(browser):
    browser.ready()
    browser.run("setLayer('nucleus', true); setLayer('cytoplasm', true)")
    browser.ready()
    assert browser.run("layers.get('nucleus').bitmap.width") == 320
    centre = browser.run("""(async () => {
        const own = new OffscreenCanvas(320, 240).getContext("2d");
        own.drawImage(layers.get("nucleus").bitmap, 0, 0);
        const { data } = own.getImageData(0, 0, 320, 240);
        const k = data.findIndex((value, i) => i % 4 === 3 && value > 0) >> 2;
        await look(k % 320, Math.floor(k / 320));
        return element("objects").textContent;
    })()""")
    assert "nucleus" in centre, centre


def check_focus(browser, second):
    browser.press("]")
    browser.until("focus === 0.5")
    assert browser.hash() != second, "another focus, another image"
    browser.click("#focus-reset")
    browser.until(f"document.body.dataset.hash === '{second}'")
    browser.ready()


def check_preset(browser):
    """Changes the preset, and compares an image of the user, which is the image itself."""
    before = browser.run("state.preset + element('changed').textContent")
    browser.change("#preset", "high-grade")
    browser.until("state.preset === 'high-grade' && state.recipe === state.base")
    browser.click("#undo")
    assert browser.run("state.preset + element('changed').textContent") == before
    browser.click("#redo")
    browser.change("[data-path='field.width_px'] input[type=number]", "300")
    browser.change("[data-path='field.height_px'] input[type=number]", "260")
    browser.until("shown.head.width === 300 && shown.head.height === 260")
    browser.ready()
    browser.run("""(async () => {
        const blob = await (await fetch(`image.png/${shown.head.id}`)).blob();
        await useReal(new File([blob], "own.png"));
    })()""")
    text = "document.body.innerText"
    browser.until("document.querySelectorAll('#distances meter').length > 5", lambda: browser.run(text))
    assert browser.run("[...document.querySelectorAll('#distances meter')].every((meter) => meter.value === 0)")
    browser.click("#real-remove")
    browser.until("element('real-shown').hidden")


# Large pixels: many cells in a small field.
MATCHED = """(async () => {
    const wait = async () => {
        do await new Promise((resolve) => setTimeout(resolve, 10)); while (running || dirty || shown.head.factor > 1);
    };
    settle();
    setPreset(info.presets.find(({ name }) => name === "lbc"));
    const cells = Object.entries(state.recipe.cells).map(([name, mix]) => [name, { ...mix, count: 4 }]);
    const field = { ...state.recipe.field, width_px: 340, height_px: 260, pixel_um: 0.5 };
    setRecipe({ ...state.recipe, field, cells: Object.fromEntries(cells) });
    await wait();
    const files = [];
    for (const index of [0, 1]) {
        go(index);
        await wait();
        const blob = await (await fetch(`image.png/${shown.head.id}`)).blob();
        files.push(new File([blob], `field-${index}.png`));
    }
    await useReals(files);
    element("real-um").value = 0.5;
    element("real-um").dispatchEvent(new Event("input"));
    setPreset(info.presets.find(({ name }) => name === "lbc"));
})()"""


def check_match(browser, program, folder):
    """Matches the recipe to two images: cancels a match, runs another one, compares its field with the command line."""
    browser.run(MATCHED)
    assert browser.run("reals.length") == 2
    # The plots above the match move it.
    browser.ready()
    browser.until("document.querySelectorAll('#distances meter').length > 5")
    browser.click("#match-quick")
    browser.until(
        "element('match-quick').checked && /simulated fields, about [0-9]+ /.test(element('match-plan').textContent)"
    )
    browser.click("#match-start")
    browser.until("element('match-progress').value > 0 && !element('match-cancel').hidden")
    browser.picture(folder / "matching.png")
    browser.click("#match-cancel")
    browser.until("element('match-status').textContent === 'Match cancelled.' && !element('match-start').hidden")
    assert browser.run("state.recipe === state.base"), "a cancelled match changes nothing"
    browser.click("#match-start")
    shown = lambda: browser.run("element('match-status').textContent")  # noqa: E731
    browser.until("document.querySelectorAll('#match-found li').length > 5", shown)
    assert browser.run("state.recipe.conditions.length") == 2
    assert browser.run("state.recipe.field.width_px") == 340
    matched = browser.hash()
    browser.picture(folder / "matched.png")
    command = browser.run("commandLine()")
    assert generated(program, command, folder, "matched") == matched, command
    # A number of the form replaces those of the conditions.
    path = "background.level"
    assert browser.run(f"conditionsAt('{path}'.split('.')).length") == 2
    browser.find(path.replace(".", " "))
    browser.change(f"[data-path='{path}'] input[type=range]", "0.7")
    assert browser.run(f"conditionsAt('{path}'.split('.')).length") == 0
    browser.find("")
    browser.click("#undo")
    browser.click("#undo")
    assert browser.run("state.recipe === state.base"), "undo restores the recipe before the match"
    browser.click("#real-remove")
    browser.click("#real-remove")


# Roles of controls and of graphics in the accessibility tree.
NAMED = {
    "button",
    "checkbox",
    "combobox",
    "DisclosureTriangle",
    "image",
    "link",
    "meter",
    "progressbar",
    "searchbox",
    "slider",
    "spinbutton",
    "tab",
    "textbox",
}

# What the browser focuses with the Tab key, in the order of the document.
FOCUSABLE = """[...document.querySelectorAll("a[href], button, input, select, textarea, summary, [tabindex]")]
    .filter((node) => !node.disabled && node.tabIndex >= 0 && node.checkVisibility())"""

# Opens all sections of the page; those of the form are filled when they are opened.
OPEN_ALL = """(async () => {
    for (;;) {
        const closed = [...document.querySelectorAll("details:not([open])")];
        if (closed.length === 0) return;
        closed.forEach((node) => { node.open = true; });
        await new Promise((resolve) => setTimeout(resolve, 20));
    }
})()"""


def check_access(browser):
    """Checks names of controls, the order of the focus, its visibility, and the layout at 1024 pixels."""
    browser.run(OPEN_ALL)
    browser.call("Accessibility.enable")
    nodes = browser.call("Accessibility.getFullAXTree")["nodes"]
    named = [node for node in nodes if not node["ignored"] and node["role"]["value"] in NAMED]
    unnamed = [node for node in named if not node.get("name", {}).get("value", "").strip()]
    assert len(named) > 300 and not unnamed, unnamed[:5]
    browser.call("Accessibility.disable")
    browser.run("open.clear(); open.add('camera'); built = ''; showForm()")
    for width, scheme in ((1024, "light"), (1024, "dark"), (1280, "light")):
        browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        browser.call("Emulation.setDeviceMetricsOverride", width=width, height=768, deviceScaleFactor=1, mobile=False)
        outside = browser.run(f"""{FOCUSABLE}.filter((node) => {{
            const {{ left, right }} = node.getBoundingClientRect();
            return left < 0 || right > innerWidth;
        }}).map((node) => node.outerHTML)""")
        assert not outside, (width, outside)
    browser.call("Emulation.clearDeviceMetricsOverride")
    browser.call("Emulation.setEmulatedMedia", features=[])
    count = browser.run(f"(window.order = {FOCUSABLE}).length")
    browser.run("order[0].focus({ focusVisible: true })")
    for k in range(count):
        if k > 0:
            browser.press("Tab")
        focused = "document.activeElement"
        assert browser.run(f"{focused} === order[{k}]"), browser.run(f"[order[{k}].outerHTML, {focused}.outerHTML]")
        outlined = f"{focused}.closest('.file') ?? {focused}"
        style = browser.run(
            f"(({{ outlineStyle, boxShadow }}) => [outlineStyle, boxShadow])(getComputedStyle({outlined}))"
        )
        assert style != ["none", "none"], browser.run(f"{focused}.outerHTML")
    browser.press("Tab")
    assert not browser.run("order.slice(1).includes(document.activeElement)"), "the focus leaves the page"
    browser.run("document.activeElement.blur()")


TIMES = """(async () => {
    const wait = () => new Promise((resolve) => setTimeout(resolve));
    const own = show;
    let [first, start] = [null, 0];
    show = (reply) => { own(reply); first ??= performance.now() - start; };
    const until = async () => { while (running || dirty || shown.head.factor > 1) await wait(); };
    const base = state.recipe;
    const CHANGES = {
        camera: (k) => edit(["camera", "read_noise_e"], 100 + k, "camera"),
        focus: (k) => setFocus(0.7 * (k + 1)),
        optics: (k) => edit(["optics", "condenser_na"], 0.3 + 0.01 * k, "optics"),
        debris: (k) => edit(["debris", "speckles", "count"], 20 + 5 * k, "debris"),
        cells: (k) => edit(["cells", "intermediate", "count"], { per_mm2: 110 + 10 * k }, "cells"),
        stain: (k) => edit(["stain", "slide_cytoplasm"], 0.6 + 0.05 * k, "stain"),
    };
    const median = (values) => Math.round(values.sort((a, b) => a - b)[values.length >> 1]);
    const rows = [];
    for (const [name, change] of Object.entries(CHANGES)) {
        const [firsts, wholes] = [[], []];
        for (let k = 0; k < 9; k += 1) {
            setFocus(null);
            setRecipe(base);
            await until();
            [first, start] = [null, performance.now()];
            change(k);
            await until();
            firsts.push(first);
            wholes.push(performance.now() - start);
        }
        const least = (values) => Math.round(Math.min(...values));
        rows.push([name, median(firsts), median(wholes), least(firsts), least(wholes)]);
    }
    return rows;
})()"""


def print_times(program, chromium):
    """Prints the median time until the first image and until the image of full resolution of each change, ms."""
    served = Served(program, ["workbench"])
    browser = Workbench(chromium)
    try:
        browser.open(served.address)
        browser.ready()
        print(browser.run("`${shown.head.width} x ${shown.head.height} pixels, ${shown.head.objects} objects`"))
        print("change    first  whole  (least: first  whole), ms")
        for name, *times in browser.run(TIMES):
            print("{:8} {:6} {:6} {:14} {:6}".format(name, *times))
    finally:
        browser.close()
    served.interrupt()


def main():
    if sys.argv[4:] == ["--times"]:
        print_times(*sys.argv[1:3])
        return
    program, chromium, folder = sys.argv[1:]
    folder = Path(folder)
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    served = Served(program, ["workbench", "--preset", "lbc", "--seed", 3, *SMALL])
    browser = Workbench(chromium)
    try:
        browser.open(served.address)
        browser.ready()
        browser.picture(folder / "whole.png")
        second = check_slider(browser)
        check_text(browser, second)
        check_objects(browser)
        check_focus(browser, second)
        browser.run("go(2)")
        browser.until("state.index === 2 && shown.head.factor === 1")
        third = browser.hash()
        assert third != second
        command = browser.run("commandLine()")
        assert generated(program, command, folder, "third") == third, command
        # A focus of the view is part of the command line.
        browser.run("setFocus(1.5)")
        browser.until("element('focus-text').textContent === '1.5 µm' && !running && !dirty")
        fourth = browser.hash()
        assert generated(program, browser.run("commandLine()"), folder, "fourth") == fourth
        # The link opens the same field.
        link = browser.run("(keepNow(), location.href)")
        browser.open("about:blank")
        browser.open(link)
        browser.until("document.body?.dataset.hash !== undefined")
        assert browser.hash() == fourth
        assert browser.run("layers.get('nucleus').on && focus === 1.5 && state.index === 2")
        browser.picture(folder / "link.png")
        check_preset(browser)
        check_match(browser, program, folder)
        check_access(browser)
        browser.check(served.address)
    finally:
        browser.close()
    code, _ = served.interrupt()
    assert code == 0, code
    print(f"the workbench passed in {Path(chromium).name}; screenshots are in {folder}")


if __name__ == "__main__":
    main()
