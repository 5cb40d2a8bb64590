"""Opens every page of the site on a phone and on a wide screen, and searches with the keyboard.

Arguments: Chromium, the folder of the site, and a folder for pictures of some pages.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "xtask/python"))
from chromium import Browser  # noqa: E402

SHOWN = [
    "index",
    "start",
    "gallery/presets",
    "gallery/debris",
    "physics/optics",
    "recipe/optics",
    "recipe/index",
    "how-to/microscope",
    "properties/performance",
]


def main(chromium, site, pictures):
    pictures.mkdir(parents=True, exist_ok=True)
    pages = sorted(site.rglob("*.html"))
    assert pages, f"no pages in {site}"
    browser = Browser(chromium)

    def show(page, width, height):
        browser.call(
            "Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=1, mobile=width < 600
        )
        address = page.as_uri()
        browser.open(address)
        browser.until(f"location.href === '{address}' && document.readyState === 'complete'")

    too_wide = []
    for width, height in ((390, 844), (1280, 800)):
        for page in pages:
            show(page, width, height)
            got = browser.run("document.documentElement.scrollWidth")
            if got > width:
                too_wide.append(f"{page.relative_to(site)}: {got} px on a screen of {width} px")
    assert not too_wide, too_wide

    for scheme in ("light", "dark"):
        browser.call("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": scheme}])
        for width, height in ((390, 844), (1280, 800)):
            for name in SHOWN:
                show(site / f"{name}.html", width, height)
                browser.picture(pictures / f"{name.replace('/', '-')}-{width}-{scheme}.png")

    show(site / "index.html", 1280, 800)
    browser.press("/")
    browser.until("document.activeElement.id === 'search'")
    browser.call("Input.insertText", text="condenser")
    browser.until("document.querySelectorAll('#found a').length > 0")
    browser.picture(pictures / "search.png")
    browser.run("document.querySelector('#found a').click()")
    browser.until(
        "location.href.endsWith('recipe/optics.html#optics.condenser_na')", lambda: browser.run("location.href")
    )

    browser.check("file:")
    browser.close()
    print(f"{len(pages)} pages fit a phone; pictures in {pictures}")


main(sys.argv[1], Path(sys.argv[2]).resolve(), Path(sys.argv[3]))
