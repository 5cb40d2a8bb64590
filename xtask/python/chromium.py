"""A browser, and a program that serves a page, for tests with keyboard and mouse.

Controls Chromium through a pipe (--remote-debugging-pipe), which only needs the standard library.
"""

import base64
import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
import time

PATIENCE_S = 30
FLAGS = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--disable-extensions",
    "--disable-dev-shm-usage",
    "--hide-scrollbars",
    "--no-default-browser-check",
    "--window-size=1280,800",
    "--remote-debugging-pipe",
]


class Served:
    """The program that serves a page."""

    def __init__(self, program, words):
        self.process = subprocess.Popen(
            [program, *map(str, words)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self.address = None
        for line in self.process.stdout:
            if found := re.search(r"http://127\.0\.0\.1:\d+/", line):
                self.address = found[0]
                return
        raise SystemExit(f"the program ended: {self.process.stderr.read()}")

    def interrupt(self):
        """End it like Ctrl-C. Return its exit code and output."""
        self.process.send_signal(signal.SIGINT)
        out, _ = self.process.communicate(timeout=PATIENCE_S)
        return self.process.returncode, out


def is_harmless(entry):
    """Return whether an entry of the log says that the program was restarting, or a compared image was replaced."""
    text, url = entry["text"], entry.get("url", "")
    is_replaced = "404 (Not Found)" in text and url.endswith("/compare")
    return "ERR_CONNECTION" in text or "ERR_EMPTY_RESPONSE" in text or is_replaced


class Browser:
    """Chromium with one page."""

    def __init__(self, chromium):
        self.profile = tempfile.mkdtemp()
        theirs_in, ours_out = os.pipe()
        ours_in, theirs_out = os.pipe()
        # Chromium reads commands from descriptor 3 and writes to 4.
        shell = f'exec "$@" 3<&{theirs_in} 4>&{theirs_out}'
        self.process = subprocess.Popen(
            ["sh", "-c", shell, "sh", chromium, *FLAGS, f"--user-data-dir={self.profile}", "about:blank"],
            pass_fds=(theirs_in, theirs_out),
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        os.close(theirs_in)
        os.close(theirs_out)
        self.out, self.into = os.fdopen(ours_out, "wb", 0), os.fdopen(ours_in, "rb")
        self.count, self.buffer, self.events, self.session = 0, b"", [], None
        self.collected, self.received = set(), []
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ("Page", "Runtime", "Network", "Log"):
            self.call(f"{domain}.enable")

    def read(self):
        while b"\0" not in self.buffer:
            more = self.into.read1(1 << 16)
            if not more:
                raise SystemExit("the browser ended")
            self.buffer += more
        message, self.buffer = self.buffer.split(b"\0", 1)
        return json.loads(message)

    def call(self, method, **params):
        self.count += 1
        message = {"id": self.count, "method": method, "params": params}
        if self.session:
            message["sessionId"] = self.session
        self.out.write(json.dumps(message).encode() + b"\0")
        while True:
            message = self.read()
            if message.get("id") == self.count:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]
            if "method" in message:
                self.events.append(message)

    def run(self, script):
        try:
            outcome = self.call("Runtime.evaluate", expression=script, returnByValue=True, awaitPromise=True)
        except RuntimeError:
            return None  # The page is loading.
        assert "exceptionDetails" not in outcome, outcome
        return outcome["result"].get("value")

    def until(self, condition, status=lambda: ""):
        """Waits until the condition is true; gives up when `status` has not changed for PATIENCE_S seconds."""
        last, end = "", time.monotonic() + PATIENCE_S
        while not self.run(condition):
            if time.monotonic() > end:
                now = status()
                if now == last:
                    raise SystemExit(f"waited for {condition}; {now}")
                last, end = now, time.monotonic() + PATIENCE_S
            time.sleep(0.01)

    def press(self, key):
        codes = {
            " ": ("Space", 32),
            "Tab": ("Tab", 9),
            "ArrowLeft": ("ArrowLeft", 37),
            "ArrowRight": ("ArrowRight", 39),
        }
        code, number = codes.get(key, (f"Key{key.upper()}", ord(key.upper()[0])))
        fields = {"key": key, "code": code, "windowsVirtualKeyCode": number}
        text = {"text": key} if len(key) == 1 else {}
        self.call("Input.dispatchKeyEvent", type="keyDown", **fields, **text)
        self.call("Input.dispatchKeyEvent", type="keyUp", **fields)

    def click(self, selector):
        node = f"document.querySelector('{selector}')"
        self.run(f"{node}.scrollIntoView({{ block: 'nearest' }})")
        box = self.run(f"(r => [r.x + r.width / 2, r.y + r.height / 2])({node}.getBoundingClientRect())")
        for kind in ("mousePressed", "mouseReleased"):
            self.call("Input.dispatchMouseEvent", type=kind, x=box[0], y=box[1], button="left", clickCount=1)

    def wheel(self, x, y, turn, shift=False):
        self.call(
            "Input.dispatchMouseEvent", type="mouseWheel", x=x, y=y, deltaX=0, deltaY=turn, modifiers=8 if shift else 0
        )

    def drag(self, start, end):
        """Drag with the left button from a point of the page to another."""
        self.call("Input.dispatchMouseEvent", type="mousePressed", x=start[0], y=start[1], button="left", clickCount=1)
        for part in (0.25, 0.5, 0.75, 1):
            x, y = (a + part * (b - a) for a, b in zip(start, end))
            self.call("Input.dispatchMouseEvent", type="mouseMoved", x=x, y=y, button="left", buttons=1)
        self.call("Input.dispatchMouseEvent", type="mouseReleased", x=end[0], y=end[1], button="left", clickCount=1)

    def picture(self, path):
        path.write_bytes(base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"]))

    def open(self, address):
        self.call("Page.navigate", url=address)

    def collect(self):
        """Collect the responses since the last call, because a reloaded page discards them."""
        events = {e["method"]: [] for e in self.events}
        for event in self.events:
            events[event["method"]].append(event["params"])
        done = {e["requestId"] for e in events.get("Network.loadingFinished", [])} - self.collected
        for event in events.get("Network.responseReceived", []):
            if event["requestId"] not in done:
                continue
            self.collected.add(event["requestId"])
            try:
                body = self.call("Network.getResponseBody", requestId=event["requestId"])
            except RuntimeError:
                continue  # Already discarded.
            raw = base64.b64decode(body["body"]) if body["base64Encoded"] else body["body"].encode()
            self.received.append((event["response"]["url"], event["response"]["mimeType"], raw))

    def requests(self):
        return [e["params"]["request"]["url"] for e in self.events if e["method"] == "Network.requestWillBeSent"]

    def complaints(self):
        errors = [e["params"] for e in self.events if e["method"] == "Runtime.exceptionThrown"]
        entries = [e["params"]["entry"] for e in self.events if e["method"] == "Log.entryAdded"]
        return errors + [entry for entry in entries if not is_harmless(entry)]

    def check(self, *origins):
        """Check that pages asked for nothing but addresses that begin so, or data of their own, without an error."""
        urls = self.requests()
        assert urls and all(url.startswith((*origins, "data:", "about:", "blob:")) for url in urls), urls
        complaints = self.complaints()
        assert not complaints, json.dumps(complaints)

    def close(self):
        self.session = None
        self.call("Browser.close")
        self.process.wait(timeout=PATIENCE_S)
        shutil.rmtree(self.profile, ignore_errors=True)
