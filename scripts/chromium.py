"""Chromium for tests of pages, and the pixels of its pictures. Python 3 without further packages."""

import base64
import json
import os
import struct
import subprocess
import sys
import time
import zlib

BROWSERS = ["chromium", "chromium-browser", "google-chrome"]
FLAGS = ["--headless=new", "--no-sandbox", "--hide-scrollbars"]
# SwiftShader draws without a graphics card.
DRAWS, DRAWS_NOT = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader"], ["--disable-gpu", "--disable-3d-apis"]
WAIT_S = 60


class Browser:
    """Chromium, driven through its DevTools protocol over two pipes."""

    def __init__(self, path, profile, flags=DRAWS):
        ours_in, theirs_out = os.pipe()
        theirs_in, ours_out = os.pipe()

        def place():
            # The protocol wants its pipes as descriptors 3 and 4. Copies first, because one may be at the other's place.
            first, second = os.dup(theirs_in), os.dup(theirs_out)
            os.dup2(first, 3)
            os.dup2(second, 4)

        command = [path, *FLAGS, *flags, f"--user-data-dir={profile}", "--remote-debugging-pipe", "about:blank"]
        self.process = subprocess.Popen(command, preexec_fn=place, close_fds=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        os.close(theirs_in)
        os.close(theirs_out)
        self.to, self.of = os.fdopen(ours_out, "wb", 0), ours_in
        self.rest, self.number, self.events, self.session = b"", 0, [], None
        target = self.call("Target.createTarget", url="about:blank")["targetId"]
        self.session = self.call("Target.attachToTarget", targetId=target, flatten=True)["sessionId"]
        for domain in ["Page", "Runtime", "Network", "Log"]:
            self.call(f"{domain}.enable")

    def message(self):
        while b"\0" not in self.rest:
            part = os.read(self.of, 1 << 16)
            if not part:
                sys.exit("the browser ended")
            self.rest += part
        text, self.rest = self.rest.split(b"\0", 1)
        return json.loads(text)

    def call(self, method, **parameters):
        self.number += 1
        message = {"id": self.number, "method": method, "params": parameters}
        if self.session:
            message["sessionId"] = self.session
        self.to.write(json.dumps(message).encode() + b"\0")
        while True:
            answer = self.message()
            if answer.get("id") == self.number:
                if "error" in answer:
                    sys.exit(f"{method}: {answer['error']['message']}")
                return answer["result"]
            self.events.append(answer)

    def js(self, expression):
        """The value of an expression in the page."""
        answer = self.call("Runtime.evaluate", expression=expression, returnByValue=True, awaitPromise=True)
        if "exceptionDetails" in answer:
            sys.exit(f"{expression}: {answer['exceptionDetails']['exception'].get('description')}")
        return answer["result"].get("value")

    def size(self, width, height, scale):
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=height, deviceScaleFactor=scale, mobile=scale > 1)

    def theme(self, name):
        features = [{"name": "prefers-color-scheme", "value": name}, {"name": "prefers-reduced-motion", "value": "reduce"}]
        self.call("Emulation.setEmulatedMedia", features=features)

    def open(self, page):
        """Opens an address. Returns the seconds until it can be used."""
        self.events.clear()
        began = time.monotonic()
        self.call("Page.navigate", url=page)
        while self.js("document.documentElement?.dataset.ready") != "true":
            if time.monotonic() - began > WAIT_S:
                sys.exit(f"not ready after {WAIT_S} s: {self.js('document.body.innerText')[:300]}")
            time.sleep(0.02)
        return time.monotonic() - began

    def settle(self):
        """Waits until the page has drawn."""
        self.js("new Promise((done) => requestAnimationFrame(() => setTimeout(() => requestAnimationFrame(done), 250)))")

    def picture(self):
        self.settle()
        return base64.b64decode(self.call("Page.captureScreenshot", format="png")["data"])

    def click(self, x, y):
        for kind in ["mousePressed", "mouseReleased"]:
            self.call("Input.dispatchMouseEvent", type=kind, x=x, y=y, button="left", buttons=1, clickCount=1)

    def key(self, name, code=None):
        text = {"text": name} if len(name) == 1 else {"text": "\r"} if name == "Enter" else {}
        for kind in ["keyDown", "keyUp"]:
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=code or name, windowsVirtualKeyCode={"ArrowRight": 39, "ArrowUp": 38, "End": 35, "Tab": 9, "Escape": 27, "Enter": 13}.get(name, 0), **(text if kind == "keyDown" else {}))

    def close(self):
        self.process.terminate()
        self.process.wait()


def pixels(png):
    """Width and rows of red, green, blue of a PNG with 8 bits and no interlace (RFC 2083)."""
    at, data = 8, b""
    while at < len(png):
        length, kind = struct.unpack(">I4s", png[at : at + 8])
        content = png[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, colour = struct.unpack(">IIBB", content[:10])
            step = {2: 3, 6: 4}[colour]
            assert depth == 8
        elif kind == b"IDAT":
            data += content
        at += 12 + length
    data = zlib.decompress(data)
    rows, before = [], bytes(width * step)
    for number in range(height):
        start = number * (width * step + 1)
        way, row = data[start], bytearray(data[start + 1 : start + 1 + width * step])
        for k in range(len(row)):
            left = row[k - step] if k >= step else 0
            up, corner = before[k], before[k - step] if k >= step else 0
            if way == 1:
                row[k] = (row[k] + left) & 255
            elif way == 2:
                row[k] = (row[k] + up) & 255
            elif way == 3:
                row[k] = (row[k] + (left + up) // 2) & 255
            elif way == 4:
                guess = left + up - corner
                ways = [(abs(guess - left), 0, left), (abs(guess - up), 1, up), (abs(guess - corner), 2, corner)]
                row[k] = (row[k] + min(ways)[2]) & 255
        rows.append(row)
        before = bytes(row)
    return lambda x, y: tuple(rows[y][x * step : x * step + 3])
