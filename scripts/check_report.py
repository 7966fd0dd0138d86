#!/usr/bin/env python3
"""Opens report.html in a real browser and checks what a person sees and does.

    scripts/check_report.py [OUT] [--pictures FOLDER]

Without OUT, the shipped sample is processed first, under a name that would be markup if the page took it for that. It
checks: no message on the console, no request, no error of WebGL; the colours of objects; that a click, a row, a key and
the slider do what they say; sorting, filters and CSV; that texts are texts; that the page fits a phone; and, if OUT has
drive.copc.laz, that `chainage view` streams its points. OUT is left as it was.
`--pictures` keeps screenshots. Needs the program (target/release/chainage, or CHAINAGE), Chromium (CHAINAGE_BROWSER, or
chromium on the PATH) and Python 3 without further packages. Without a browser it says that it skips.
"""

import argparse
import base64
import contextlib
import json
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import time
import zlib

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.path.abspath(os.environ.get("CHAINAGE", ROOT / "target/release/chainage"))
SAMPLE = ROOT / "tests/data/tree_road_sweep.laz"
BROWSERS = ["chromium", "chromium-browser", "google-chrome"]
# SwiftShader draws without a graphics card.
FLAGS = ["--headless=new", "--no-sandbox", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--hide-scrollbars"]
DESK, PHONE = (1440, 900, 1), (390, 844, 2)
WAIT_S = 60


class Browser:
    """Chromium, driven through its DevTools protocol over two pipes."""

    def __init__(self, path, profile):
        ours_in, theirs_out = os.pipe()
        theirs_in, ours_out = os.pipe()

        def place():
            # The protocol wants its pipes as descriptors 3 and 4. Copies first, because one may be at the other's place.
            first, second = os.dup(theirs_in), os.dup(theirs_out)
            os.dup2(first, 3)
            os.dup2(second, 4)

        command = [path, *FLAGS, f"--user-data-dir={profile}", "--remote-debugging-pipe", "about:blank"]
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
        text = {"text": name} if len(name) == 1 else {}
        for kind in ["keyDown", "keyUp"]:
            self.call("Input.dispatchKeyEvent", type=kind, key=name, code=code or name, windowsVirtualKeyCode={"ArrowRight": 39, "ArrowUp": 38, "End": 35, "Tab": 9}.get(name, 0), **(text if kind == "keyDown" else {}))

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


FAILED = []


def check(what, holds, found=""):
    print(f"{'ok    ' if holds else 'FAILED'} {what}{'' if holds or found == '' else f': {found}'}")
    if not holds:
        FAILED.append(what)


def quiet(browser, page, allowed=()):
    """No message, no dialog, and nothing was asked for but the page itself and addresses that begin as allowed."""
    browser.js("0")
    kinds = ("Runtime.consoleAPICalled", "Runtime.exceptionThrown", "Log.entryAdded", "Page.javascriptDialogOpening")
    messages = [event["params"] for event in browser.events if event["method"] in kinds]
    check("no message on the console", not messages, json.dumps(messages[:1])[:300])
    urls = {event["params"]["request"]["url"] for event in browser.events if event["method"] == "Network.requestWillBeSent"}
    other = [url for url in urls if url != page and not url.startswith(("data:", "blob:", *allowed))]
    check("no other request" if allowed else "no request", not other, other[:5])
    error = browser.js("app.scene.gl.getError()")
    check("no error of WebGL", error == 0, error)


# Looks at each of the objects from a row on, until a pixel shows a point of one: its row, and the pixel.
SEEN_OBJECT = """((first) => {
  const canvas = document.getElementById("scene"), box = canvas.getBoundingClientRect();
  document.getElementById("mode-object").click();
  for (let row = first; row < app.table.count; row++) {
    if (!app.boxes[row]) continue;
    app.camera.take(app.poseOf(app.boxes[row]));
    const middle = [0, 1, 2].map((axis) => (app.boxes[row][axis] + app.boxes[row][axis + 3]) / 2);
    const [x, y] = app.camera.project(middle, canvas.clientWidth, canvas.clientHeight);
    if (app.scene.pick(app.camera, x, y) !== app.table.id(row) + 1) continue;
    app.render();
    return { row, x, y, left: box.left, top: box.top, colour: hueColour(app.table.id(row) + 1) };
  }
  return null;
})"""


def alike(pixel, colour):
    """Whether a pixel has a colour, up to the light on it."""
    length = lambda parts: sum(part * part for part in parts) ** 0.5
    return sum(a * b for a, b in zip(pixel, colour)) > 0.99 * length(pixel) * length(colour) > 0


def check_objects(browser):
    # Several, because one colour may be the same with its parts mixed up.
    row, x, y = 0, 0, 0
    for number in range(4):
        seen = browser.js(f"{SEEN_OBJECT}({row})")
        check(f"object {number + 1} is seen", seen is not None)
        if seen is None:
            return
        row, x, y = seen["row"] + 1, seen["left"] + seen["x"], seen["top"] + seen["y"]
        at = pixels(browser.picture())
        colour = [int(seen["colour"][k : k + 2], 16) for k in (1, 3, 5)]
        around = [at(round(x) + dx, round(y) + dy) for dx in range(-8, 9) for dy in range(-8, 9)]
        share = sum(alike(pixel, colour) for pixel in around) / len(around)
        check("its pixels have its colour", share > 0.1, f"{share:.2f} of {colour}, for instance {around[144]}")
    browser.click(x, y)
    check("a click chooses it", browser.js("app.chosen") == seen["row"], browser.js("app.chosen"))
    number = browser.js(f"String(app.table.id({seen['row']}))")
    check("its card is shown", browser.js("!document.getElementById('card').hidden && document.querySelector('#card h2').textContent").endswith(f" {number}"))
    check("its row is marked", browser.js("document.querySelector('tr[aria-selected=true]').dataset.row") == str(seen["row"]))
    browser.js("document.querySelector('#table tbody tr:nth-child(4)').click()")
    browser.settle()
    apart = browser.js("(() => { const box = app.boxes[app.chosen]; return Math.hypot(...[0, 1, 2].map((axis) => app.camera.target[axis] - (box[axis] + box[axis + 3]) / 2)); })()")
    check("a row flies to its object", apart < 0.01, apart)


def check_table(browser, out):
    # By its own number first, so that the order is that of the file.
    csv = browser.js("app.table.csv()")
    file = (out / "objects.csv").read_text()
    lines, all_lines = csv.splitlines(), file.splitlines()
    # A page with a limit may have the rows with most points only, in the order of the file.
    left_out = "objects.csv has all" in browser.js("document.body.textContent")
    kept = set(lines)
    check("the CSV is objects.csv", lines == [line for line in all_lines if line in kept] if left_out else csv == file)
    column = browser.js("app.table.columns.findIndex((column) => column.name === 'points')")
    button = f"[...document.querySelectorAll('#table th button')].find((button) => button.title.startsWith('points:'))"
    texts = f"[...document.querySelectorAll('#table tbody tr')].map((row) => Number(row.cells[app.table.order.indexOf({column})].textContent))"
    for direction, reverse in [("ascending", False), ("descending", True)]:
        browser.js(f"{button}.click()")
        values = browser.js(texts)
        check(f"sorted, {direction}", values == sorted(values, reverse=reverse) and (left_out or len(set(values)) > 3), values[:5])
        check("and said so", browser.js(f"{button}.parentElement.getAttribute('aria-sort')") == direction)
    browser.js("document.querySelector('#table th button').click()")
    middle = browser.js("(app.axis.from + app.axis.to) / 2")
    browser.js(f"(() => {{ const input = document.getElementById('filter-from'); input.value = {middle}; input.dispatchEvent(new Event('input')); }})()")
    station = browser.js("app.table.rows.map((row) => app.table.values[app.table.chainageColumn][row])")
    expected = sum(1 for line in browser.js("app.table.values[app.table.chainageColumn]") if line >= middle)
    check("filtered by chainage", len(station) == expected and all(s >= middle for s in station), (len(station), expected))
    check("others are hidden in the view", browser.js("app.isShown(app.table.values[app.table.chainageColumn].findIndex((s) => s < " + str(middle) + "))") is False)
    browser.js("(() => { const input = document.getElementById('filter-from'); input.value = ''; input.dispatchEvent(new Event('input')); })()")


def check_keys(browser):
    browser.js("document.getElementById('chainage').focus()")
    browser.key("End")
    browser.settle()
    apart = browser.js("(() => { const { x, y } = app.axis.at(app.axis.to), eye = app.camera.eye(); return Math.hypot(eye[0] - x, eye[1] - y); })()")
    check("the slider drives to the end of the street", apart < 12, apart)
    check("and says where it is", browser.js("document.getElementById('station').textContent === document.getElementById('chainage').getAttribute('aria-valuetext')"))
    browser.js("document.getElementById('scene').focus(), app.choose(-1)")
    browser.key("n")
    first = browser.js("app.chosen")
    browser.key("n")
    check("n chooses one object after the other", first >= 0 and browser.js("app.chosen") not in (-1, first))
    reached = set()
    browser.js("document.querySelector('.skip').focus()")
    for _ in range(40):
        browser.key("Tab")
        reached.add(browser.js("document.activeElement.id || document.activeElement.tagName"))
    for name in ["theme", "scene", "whole", "play", "chainage", "plan", "tab-table", "filter-from", "csv", "table-scroll"]:
        check(f"the tab key reaches {name}", name in reached)


def check_texts(browser, name):
    check("the name is text", browser.js("document.getElementById('title').textContent") == name)
    check("and no element", browser.js("document.scripts.length") == 5 and browser.js("document.querySelectorAll('#title *').length") == 0)
    names = browser.js("[...document.querySelectorAll('button, input, select, canvas')].filter((node) => !(node.textContent.trim() || node.getAttribute('aria-label') || node.title || node.labels?.length)).map((node) => node.id)")
    check("every control has a name", names == [], names)


def examine(browser, out, name, pictures):
    file = out / "report.html"
    page = file.resolve().as_uri()
    keep = lambda what: pictures and (pictures / f"{what}.png").write_bytes(browser.picture())
    browser.theme("light")
    browser.size(*DESK)
    seconds = browser.open(page)
    print(f"       {file.stat().st_size:,} bytes, {browser.js('app.points.count'):,} points, ready after {seconds:.2f} s")
    keep("desk-light")
    quiet(browser, page)
    check_texts(browser, name)
    check_table(browser, out)
    check_objects(browser)
    keep("desk-chosen")
    check_keys(browser)
    for panel in ["classes", "run"]:
        browser.js(f"document.getElementById('tab-{panel}').click()")
        check(f"the panel {panel} is filled", browser.js(f"document.getElementById('{panel}-panel').innerText.length") > 40)
        keep(f"desk-{panel}")
    quiet(browser, page)
    browser.theme("dark")
    browser.open(page)
    check("dark where the system is", browser.js("document.documentElement.dataset.theme") == "dark")
    keep("desk-dark")
    for theme in ["light", "dark"]:
        browser.theme(theme)
        browser.size(*PHONE)
        browser.open(page)
        wide = browser.js("document.documentElement.scrollWidth")
        check(f"fits a phone, {theme}", wide <= PHONE[0], wide)
        keep(f"phone-{theme}")
    quiet(browser, page)


@contextlib.contextmanager
def served(out):
    """The address at which `chainage view` serves OUT."""
    server = subprocess.Popen([PROGRAM, "view", out, "--no-open"], stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        yield server.stdout.readline().strip()
    finally:
        server.terminate()
        server.wait()


def wait_for(browser, what, expression):
    """Whether an expression becomes true."""
    began = time.monotonic()
    while not browser.js(expression):
        if time.monotonic() - began > WAIT_S:
            check(what, False, browser.js("document.getElementById('detail').textContent"))
            return False
        time.sleep(0.05)
    check(what, True)
    return True


DETAIL = "document.documentElement.dataset.detail === 'true'"
# A streamed point of an object that is seen: row, pixel, number. The sample is left out of the picture.
STREAMED_POINT = """(() => {
  const { scene, camera } = app, canvas = scene.canvas, box = canvas.getBoundingClientRect(), sample = scene.sample;
  scene.sample = { ...sample, count: 0, draw() {} };
  try {
    for (const { cloud } of scene.nodes) for (let at = 0; cloud && at < cloud.count; at += 97) {
      const key = cloud.points.keys[at], row = app.rowOf.get(key - 1);
      if (row === undefined) continue;
      const [x, y] = camera.project(cloud.points.places.slice(3 * at, 3 * at + 3), canvas.clientWidth, canvas.clientHeight) ?? [0, 0];
      if (x < 300 || y < 100 || x > canvas.clientWidth - 300 || y > canvas.clientHeight - 120 || scene.pick(camera, x, y) !== key) continue;
      return { row, id: key - 1, x: box.left + x, y: box.top + y };
    }
    return null;
  } finally { scene.sample = sample; }
})()"""


def examine_streamed(browser, out, pictures):
    """The page from `chainage view`: points are streamed, picked and coloured, and a damaged file is reported."""
    keep = lambda what: pictures and (pictures / f"{what}.png").write_bytes(browser.picture())
    cloud = out / "drive.copc.laz"
    with served(out) as address:
        browser.theme("light")
        browser.size(*DESK)
        browser.open(address)
        if not wait_for(browser, "points are streamed", DETAIL):
            return
        keep("view-whole")
        whole = browser.js("app.stream.drawn.nodes.length")
        browser.js("app.choose(0, true)")
        browser.js("document.documentElement.dataset.detail = ''; app.choose(-1); app.render()")
        wait_for(browser, "a near object gets its detail", DETAIL)
        nearest = browser.js("Math.max(...app.stream.drawn.nodes.map((node) => node.level))")
        count = browser.js("app.stream.loaded")
        print(f"       {whole} nodes of the whole, {count:,} points loaded, to level {nearest}")
        check("the budget is kept", count <= browser.js("MOST_POINTS"), count)
        seen = browser.js(STREAMED_POINT)
        check("a streamed point is seen", seen is not None)
        if seen:
            browser.js("app.choose(-1)")
            browser.click(seen["x"], seen["y"])
            check("a click on it picks its object", browser.js("app.chosen") == seen["row"], (browser.js("app.chosen"), seen))
            keep("view-near")
            # What is hidden is hidden among streamed points, too.
            code = browser.js("app.choose(-1), app.classOf(%d)" % seen["row"])
            browser.js(f"app.hidden.add({code}); app.paint()")
            wait_for(browser, "streamed points are painted again", "app.scene.nodes.every(({ cloud }) => !cloud || cloud.version === app.painted)")
            shown_keys = browser.js("(() => { let shown = 0; for (const { cloud } of app.scene.nodes) for (let at = 0; cloud && at < cloud.count; at++) if (cloud.points.keys[cloud.order[at]] === %d && cloud.look[4 * at + 3] !== 0) shown++; return shown; })()" % (seen["id"] + 1))
            check("a hidden class is hidden", shown_keys == 0, shown_keys)
            browser.js(f"app.hidden.delete({code}); app.paint()")
        quiet(browser, address, (f"{address}drive.copc.laz?",))
    whole_file = cloud.read_bytes()
    try:
        # The file ends in the middle.
        cloud.write_bytes(whole_file[: len(whole_file) // 2])
        with served(out) as address:
            browser.open(address)
            wait_for(browser, "a damaged file is reported", "document.getElementById('detail').textContent.includes('drive.copc.laz')")
            print(f"       {browser.js('document.getElementById(`detail`).textContent')}")
            check("the sample is shown all the same", browser.js("app.scene.count") > 100)
    finally:
        cloud.write_bytes(whole_file)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=pathlib.Path, nargs="?")
    parser.add_argument("--pictures", type=pathlib.Path)
    arguments = parser.parse_args()
    path = os.environ.get("CHAINAGE_BROWSER") or next(filter(None, map(shutil.which, BROWSERS)), None)
    if not path:
        print("skipped: report.html in a browser (Chromium is not installed)")
        return
    with contextlib.ExitStack() as stack:
        scratch = pathlib.Path(stack.enter_context(tempfile.TemporaryDirectory(ignore_cleanup_errors=True)))
        out = arguments.out
        if not out:
            source = scratch / '<script>alert(1)<img src=x onerror=alert(2)> "sweep" & \'more\'.laz'
            shutil.copy(SAMPLE, source)
            out = scratch / "out"
            subprocess.run([PROGRAM, "run", source, "-o", out, "--progress", "none", "--method", "euclidean", "--ground", "voxel-column", "--set", "euclidean.min_points=30", "--copc"], check=True, stdout=subprocess.DEVNULL)
        if arguments.pictures:
            arguments.pictures.mkdir(parents=True, exist_ok=True)
        report = json.loads((out / "report.json").read_text())
        names = [file["name"] for file in report["input"]]
        browser = Browser(path, scratch / "profile")
        stack.callback(browser.close)
        examine(browser, out, names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}", arguments.pictures)
        if (out / "drive.copc.laz").exists():
            examine_streamed(browser, out, arguments.pictures)
    if FAILED:
        sys.exit(f"{len(FAILED)} checks failed")
    print("all checks passed")


if __name__ == "__main__":
    main()
