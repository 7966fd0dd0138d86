#!/usr/bin/env python3
"""Opens report.html in a real browser and checks what a person sees and does.

    scripts/check_report.py [OUT] [--pictures FOLDER]

Without OUT, the shipped sample is processed first, under a name that would be markup if the page took it for that. It
checks: no message on the console, no request, no error of WebGL; the colours of objects; that a click, a row, a key and
the slider do what they say; sorting, filters and CSV; what is hidden, and the address of an object; that texts are
texts; that the page fits a phone and a sheet of paper, and works without WebGL; that a print is whole and light;
statistics; what is said of the sample; that a street between facades is seen at once; units and warnings of a drive in
feet; a drive without objects; and, if OUT has drive.copc.laz, that `chainage view` streams its points. OUT is left as
it was. What needs several objects is left out where OUT has fewer.
`--pictures` keeps screenshots. Needs the program (target/release/chainage, or CHAINAGE), Chromium (CHAINAGE_BROWSER, or
chromium on the PATH) and Python 3 without further packages. Without a browser it says that it skips.
"""

import argparse
import contextlib
import json
import os
import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

from chromium import BROWSERS, DRAWS_NOT, WAIT_S, Browser, pixels

ROOT = pathlib.Path(__file__).resolve().parent.parent
PROGRAM = os.path.abspath(os.environ.get("CHAINAGE", ROOT / "target/release/chainage"))
SAMPLE = ROOT / "tests/data/tree_road_sweep.laz"
DESK, SMALL_DESK, PHONE = (1440, 900, 1), (1024, 800, 1), (390, 844, 2)
# What is left of a landscape sheet of A4 within margins of 1 cm, at 96 pixels an inch.
SHEET_PX = 1047

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
    error = browser.js("app.scene?.gl.getError() ?? 0")
    check("no error of WebGL", error == 0, error)


# Looks at each of the objects from a row on, until a pixel shows a point of one: its row, and the pixel.
SEEN_OBJECT = """((first) => {
  const canvas = document.getElementById("scene"), box = canvas.getBoundingClientRect();
  document.getElementById("mode-object").click();
  for (let row = first; row < app.table.count; row++) {
    // A surface of a few points is smaller than what is looked at around the pixel.
    if (!app.boxes[row] || app.sampled.get(app.table.id(row) + 1) < 40) continue;
    app.camera.take(app.poses.of(app.boxes[row], app.table.id(row) + 1, document.getElementById("card"), () => true));
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


def check_objects(browser, count):
    # Several, because one colour may be the same with its parts mixed up.
    row, x, y = 0, 0, 0
    for number in range(max(1, min(4, count // 2))):
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
    browser.js(f"document.querySelector('#table tbody tr:nth-child({min(4, count)})').click()")
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
        check(f"sorted, {direction}", values == sorted(values, reverse=reverse) and (left_out or len(values) < 8 or len(set(values)) > 3), values[:5])
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


def find(browser, text):
    """The ids of the rows in which a text is found."""
    browser.js(f"app.table.find({json.dumps(text)})")
    return browser.js("app.table.rows.map((row) => app.table.id(row))")


def check_find(browser):
    count, file = browser.js("app.table.count"), browser.js("app.run.input[0].name")
    row = min(4, count - 1)
    number = browser.js(f"app.table.id({row})")
    check("find: an id finds its object", find(browser, str(number)) == [number])
    check("find: a uid finds its object", find(browser, browser.js(f"linkName(app.table, {row})")) == [number])
    name = browser.js(f"app.table.nameOf({row})")
    check("find: the name on the card finds its object", find(browser, name) == [number] == find(browser, name.upper().replace(" ", "  ")), name)
    check("find: part of the name of a file finds all", len(find(browser, file[1:-2])) == count)
    check("find: true is no word of the table", find(browser, "true") == [])
    if browser.js("app.classified"):
        kind = browser.js("className(app.classes, app.classOf(0))")
        check("find: the name of a class finds its objects", browser.js("app.classOf(0)") == browser.js(f"(() => {{ const rows = {json.dumps(find(browser, kind))}; return new Set(rows.map((id) => app.classOf(app.rowOf.get(id)))).values().next().value; }})()"))
    find(browser, "no such word")
    middle = browser.js("(() => { const box = document.querySelector('.empty div').getBoundingClientRect(), frame = document.getElementById('table-scroll').getBoundingClientRect(); return (box.left + box.right - frame.left - frame.right) / 2; })()")
    check("find: that there is nothing is said in the middle of what is seen", abs(middle) < 12, middle)
    check("find: without a text there are all", len(find(browser, "")) == count)


def check_hidden(browser):
    """Filters and the legend: what is hidden is hidden everywhere, is said, can be shown again, and is not chosen."""
    browser.js("app.choose(0)")
    browser.js("(() => { const field = document.getElementById('filter-from'); field.value = 1e6; field.dispatchEvent(new Event('input')); })()")
    check("what a filter hides is not chosen", browser.js("app.chosen === -1 && document.getElementById('card').hidden && location.hash === ''"))
    browser.js("app.table.clearFilters()")
    first = "document.querySelector('#legend [aria-pressed]')"
    browser.js(f"{first}.focus()")
    browser.key("Enter")
    check("a switch of the legend keeps the keyboard", browser.js(f"document.activeElement === {first} && {first}.getAttribute('aria-pressed') === 'false'"))
    for mode in browser.js("[...document.querySelectorAll('#modes input')].map((input) => input.value)"):
        browser.js(f"document.getElementById('mode-{mode}').click()")
        check(f"what is hidden can be shown again, {mode}", browser.js(f"!document.getElementById('show-all').hidden && {first}.getAttribute('aria-pressed') === 'false'"))
        if mode in ("height", "intensity"):
            check(f"no colour that is not in the view, {mode}", browser.js("document.querySelectorAll('#legend .dot').length") == 0)
    if browser.js("app.classified"):
        code = browser.js("Math.min(...app.table.values[app.table.classColumn])")
        left = browser.js(f"app.table.values[app.table.classColumn].filter((code) => code !== {code}).length")
        check("the table leaves out what the legend hides", browser.js("app.table.rows.length") == left)
        check("and says so", "hidden in the legend" in browser.js("document.getElementById('pager').textContent"))
    browser.js("document.getElementById('show-all').click()")
    check("all is shown again", browser.js("app.table.rows.length === app.table.count && document.getElementById('show-all').hidden"))


def check_escape(browser):
    for place in ["scene", "chainage", "table-scroll", "filter-text"]:
        browser.js(f"app.choose(0), document.getElementById('{place}').focus()")
        browser.key("Escape")
        check(f"Escape chooses nothing, in {place}", browser.js("app.chosen") == -1)
    browser.js("app.choose(0), app.table.find('l'), app.choose(app.table.rows[0] ?? 0), document.getElementById('filter-text').focus()")
    browser.key("Escape")
    check("Escape first empties the field to find", browser.js("app.chosen >= 0 && app.table.filter.text.value === ''"))
    browser.js("app.choose(0), document.getElementById('keys').click()")
    browser.key("Escape")
    check("Escape only closes the help", browser.js("app.chosen === 0 && !document.getElementById('help').open"))


def check_link(browser, page, count):
    row, other = min(2, count - 1), min(3, count - 1)
    browser.js(f"app.choose({row})")
    link = browser.js("location.hash")
    check("the address names what is chosen", link == "#object=" + browser.js(f"encodeURIComponent(linkName(app.table, {row}))"), link)
    browser.js("app.choose(-1)")
    check("and nothing where nothing is chosen", browser.js("location.hash") == "")
    browser.js(f"location.hash = {json.dumps(link)}")
    browser.settle()
    check("a change of the address chooses", browser.js("app.chosen") == row)
    # The same address again: the page is loaded anew.
    browser.call("Page.navigate", url="about:blank")
    browser.open(page + link)
    check("an address with an object opens with it", browser.js("app.chosen") == row)
    browser.js(f"location.hash = '#object=' + app.table.id({other})")
    browser.settle()
    check("an address may have an id", browser.js("app.chosen") == other)
    browser.js("location.hash = '#object=none'")
    browser.settle()
    check("an object that is not there is reported", "none" in browser.js("document.getElementById('notices').textContent"))


def check_words(browser):
    """What is said of shares, sections and coordinate systems."""
    words = browser.js("[percent(4, 10000), percent(0, 9), percent(1, 3), percent(163, 100000), sectionWords({ section: { from_m: 40, to_m: 80, length_m: 136.3 } }), crsWords({ description: 'a (EPSG:1)', epsg: 1 }), crsWords({ description: 'a', epsg: 1 })]")
    check("words", words == ["0.04 %", "0 %", "33.3 %", "0.16 %", "40 to 80 m of 136 m", "a (EPSG:1)", "a (EPSG:1)"], words)
    heads = browser.js("[...document.querySelectorAll('#table th button')].map((button) => button.textContent)")
    plan, height = browser.js("UNITS")
    check("coordinates have their unit", f"base x ({plan})" in heads and f"centroid z ({height})" in heads, heads)
    head, slider = browser.js("[document.getElementById('figures').innerText, document.getElementById('station').textContent]")
    length = slider.rsplit(" of ", 1)[-1]
    # From a kilometre on, the head has kilometres.
    check("the drive has one length", " of " not in slider or f"{length}" in head or " km" in head, (head, slider))
    titles = browser.js("[...document.querySelectorAll('[title], #classes-panel .note')].map((node) => node.title || node.textContent)")
    check("no marks of code in a text", not any("`" in title for title in titles), [title for title in titles if "`" in title][:2])
    passes = browser.js("[...document.querySelectorAll('#run-panel .bars .name')].map((node) => node.textContent)")
    check("passes have names of their own", len(set(passes)) == len(passes), passes)


def check_sample(browser):
    """What is said of the shown points is true."""
    sentence, count, counts = browser.js("[app.page.sample.sentence, app.points.count, app.run.result.counts]")
    eligible, noise = counts["ground"] + counts["object"], counts["low_noise"] + counts["high_noise"]
    check("not more points are shown than there are", count <= eligible, (count, eligible))
    said = f"all {eligible:,} point" if count == eligible else f"{count:,} of {eligible + noise:,} point"
    check("the sentence has the numbers of shown points", said in sentence, sentence)
    check("the sentence names noise that is left out", (f"{noise:,} point" in sentence and "of noise" in sentence) == (noise > 0), sentence)


# Objects of which the view shows 6 pixels or more, and all of them.
SEEN_OBJECTS = """(() => {
  const { scene } = app, { gl } = scene;
  scene.resize();
  scene.drawPoints(app.camera, true, 1);
  const { width, height } = scene.targets, seen = new Uint8Array(4 * width * height), counts = new Map();
  gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, seen);
  for (let at = 0; at < seen.length; at += 4) {
    const key = (seen[at] | (seen[at + 1] << 8) | (seen[at + 2] << 16) | (seen[at + 3] << 24)) >>> 0;
    if (key > 1) counts.set(key, (counts.get(key) ?? 0) + 1);
  }
  app.render();
  const name = (row) => className(app.classes, app.classOf(row));
  const tally = (rows) => rows.reduce((sum, row) => ({ ...sum, [name(row)]: (sum[name(row)] ?? 0) + 1 }), {});
  const rows = [...counts].filter(([, pixels]) => pixels >= 6).map(([key]) => app.rowOf.get(key - 1)).filter((row) => row !== undefined);
  return [tally(rows), tally(app.table.values[0].map((_, row) => row))];
})()"""


def examine_facades(browser, out, pictures):
    """The opening view of a street between high facades shows the street, and not the backs of the buildings."""
    browser.theme("light")
    for name, size in [("desk", DESK), ("phone", PHONE)]:
        browser.size(*size)
        browser.open((out / "report.html").resolve().as_uri())
        if pictures:
            (pictures / f"facades-{name}.png").write_bytes(browser.picture())
        seen, all_of = browser.js(SEEN_OBJECTS)
        for kind in ["tree", "vehicle", "pole"]:
            share = seen.get(kind, 0) / max(1, all_of.get(kind, 0))
            check(f"between facades, the opening view shows each {kind}, {name}", share >= 0.9, (seen, all_of))


def examine_empty(browser, out):
    """A drive without objects offers nothing about objects."""
    browser.theme("light")
    browser.size(*PHONE)
    browser.open((out / "report.html").resolve().as_uri())
    legend = browser.js("document.getElementById('legend').innerText")
    check("without objects, the legend names none", "object" not in legend, legend)
    check_sample(browser)


def check_statistics(browser):
    found = browser.js("[median([1, 2, 3]), median([1, 2, 3, 10]), upperEnd([1, 2, 9.5]), upperEnd([2.9, 3.001]), upperEnd([...Array(99).fill(1), 70]), upperEnd([...Array(199).fill(1), 70]), upperEnd([...Array(98).fill(1), 70])]")
    check("medians, and ends of axes", found == [2, 2.5, 10, 4, 1, 1, 80], found)
    overlaps = "(() => { for (const svg of document.querySelectorAll('#classes-panel figure svg')) { const boxes = [...svg.querySelectorAll('text')].slice(1).map((node) => node.getBoundingClientRect()).sort((a, b) => a.left - b.left); if (boxes.some((box, at) => at > 0 && box.left < boxes[at - 1].right)) return svg.textContent; } return ''; })()"
    browser.js("document.getElementById('tab-classes').click()")
    for option in browser.js("[...document.querySelectorAll('#measure option')].map((option) => option.value)"):
        browser.js(f"(() => {{ const select = document.getElementById('measure'); select.value = {option}; select.dispatchEvent(new Event('change')); }})()")
        found = browser.js(overlaps)
        check(f"labels of histograms do not touch, column {option}", found == "", found)
        wrong = browser.js("[...document.querySelectorAll('#classes-panel figure')].filter((figure) => Boolean(figure.querySelector('.beyond')) !== Boolean(figure.querySelector('.more'))).length")
        check(f"what is beyond an axis is said in words, column {option}", wrong == 0, wrong)
    titles = browser.js("document.getElementById('classes-panel').innerText")
    check("statistics by class only where there are classes", ("by class" in titles) == browser.js("app.classified") and (browser.js("app.classified") or "no class" not in titles), titles[:200])


def check_print(browser, page):
    """A print from dark mode is light, and has all rows and settings; afterwards all is as before."""
    browser.theme("dark")
    browser.open(page)
    browser.settle()
    state = "[document.querySelectorAll('#table tbody tr[data-row]').length, document.querySelectorAll('details[open]').length, document.documentElement.dataset.theme]"
    before = browser.js(state)
    browser.js("window.dispatchEvent(new Event('beforeprint'))")
    rows, opened, theme = browser.js(state)
    check("a print has all rows", rows == browser.js("app.table.rows.length"), rows)
    check("a print has all settings", opened == browser.js("document.querySelectorAll('details').length"), opened)
    # The upper left corner is sky.
    corner = browser.js("(() => { const { gl, canvas } = app.scene, pixel = new Uint8Array(4); gl.bindFramebuffer(gl.FRAMEBUFFER, null); gl.readPixels(2, canvas.height - 3, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); return [...pixel]; })()")
    check("a print from dark mode is light", theme == "light" and min(corner[:3]) > 180, (theme, corner))
    browser.call("Emulation.setEmulatedMedia", media="print")
    words = browser.js("document.querySelector('.printed')?.checkVisibility() ? document.querySelector('.printed').textContent : ''")
    check("a print says which columns it leaves out", "uid" in words and "objects.csv" in words, words)
    browser.call("Emulation.setEmulatedMedia", media="")
    browser.theme("dark")
    browser.js("window.dispatchEvent(new Event('afterprint'))")
    check("after a print all is as before", browser.js(state) == before, (browser.js(state), before))


def check_sheet(browser):
    """The table fits a printed page."""
    browser.size(SHEET_PX, 760, 1)
    browser.call("Emulation.setEmulatedMedia", media="print")
    wide = browser.js("document.documentElement.scrollWidth")
    check("fits a sheet", wide <= SHEET_PX, wide)
    browser.call("Emulation.setEmulatedMedia", media="")


def check_phone(browser, count):
    # Where an outline or the axis is drawn below the buttons of the plan.
    covered = browser.js("(() => { const { plan } = app, at = plan.canvas.getBoundingClientRect(), box = document.querySelector('.plan .buttons').getBoundingClientRect(); const places = [...plan.axis.stretches.flatMap(({ x, y }) => x.map((value, k) => [value, y[k]])), ...plan.outlines.flatMap((outline) => outline.filter((_, k) => k % 2 === 0).map((x, k) => [x, outline[2 * k + 1]]))]; return places.map(([x, y]) => plan.place(x, y)).filter(([x, y]) => x + at.left > box.left && y + at.top > box.top && y + at.top < box.bottom && x < plan.width - plan.margins.right && y < plan.height - plan.margins.below).length; })()")
    check("the buttons of the plan are beside it", covered == 0, covered)
    tall = browser.js("document.querySelector('.stage').offsetHeight")
    check("the view leaves half of a phone", tall <= PHONE[1] / 2, tall)
    check("the plan can be enlarged", browser.js("document.getElementById('plan-in').checkVisibility()"))
    wide, tall, shape, bar = browser.js("[app.plan.along * app.plan.scale / app.plan.width, app.plan.across * app.plan.scale / app.plan.height, app.plan.along / app.plan.across, app.plan.bar / app.plan.along]")
    # What is hardly longer than wide fills the height.
    check("the plan fills most of the width", wide > 0.5 or (shape < 1.5 and tall > 0.7), (wide, tall, shape))
    check("the scale bar is shorter than the street", bar <= 0.5, bar)
    if not count:
        return
    row = "document.querySelector('#table tbody tr')"
    check("two numbers are in sight", browser.js(f"[...{row}.cells].filter((cell) => !cell.className && cell.getBoundingClientRect().right <= {PHONE[0]}).length") >= 3)
    browser.js("document.getElementById('table-scroll').scrollIntoView({ block: 'end' }), document.getElementById('table-scroll').scrollTop = 200")
    browser.settle()
    top = browser.js("document.querySelector('#table th').getBoundingClientRect().top - document.querySelector('.stage').getBoundingClientRect().bottom")
    check("the head of the table stays below the view", count < 20 or -1 <= top < 60, top)
    for row in range(min(6, count)):
        browser.js(f"app.choose({row}, true)")
        browser.settle()
        overlap = browser.js("(() => { const tag = document.getElementById('tag'), box = (id) => document.getElementById(id).getBoundingClientRect(); return tag.hidden ? 0 : Math.max(box('controls').bottom - box('tag').top, -box('tag').left, box('tag').right - innerWidth); })()")
        check(f"the tag of row {row} is beside the controls", overlap <= 0, overlap)
    lines = browser.js("(() => { const card = document.getElementById('card').getBoundingClientRect(); return new Set([...document.querySelectorAll('#card dt')].map((node) => node.getBoundingClientRect()).filter((box) => box.bottom <= card.bottom).map((box) => box.top)).size; })()")
    check("the card has five lines or more", lines >= 5, lines)
    browser.js("app.choose(-1)")
    browser.js("document.getElementById('fold').click()")
    check("the view can be folded", browser.js("document.querySelector('.stage').offsetHeight") < 80)


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
    count = browser.js("app.table.count")
    check_texts(browser, name)
    check_sample(browser)
    if count > 0:
        check_table(browser, out)
        check_words(browser)
        check_find(browser)
        check_hidden(browser)
        check_objects(browser, count)
        keep("desk-chosen")
    if count > 1:
        check_keys(browser)
    if count > 0:
        check_escape(browser)
        check_statistics(browser)
    for panel in ["classes", "run"]:
        browser.js(f"document.getElementById('tab-{panel}').click()")
        check(f"the panel {panel} is filled", browser.js(f"document.getElementById('{panel}-panel').innerText.length") > (40 if count else 10))
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
        check_phone(browser, count)
        keep(f"phone-{theme}-folded")
    quiet(browser, page)
    browser.size(*DESK)
    check_print(browser, page)
    browser.theme("light")
    browser.open(page)
    if count > 0:
        check_link(browser, page, count)
    check_sheet(browser)
    return count


def examine_without_webgl(browser, out, pictures, count):
    """Everything that needs no 3D view works without one, and nothing else is offered."""
    page = (out / "report.html").resolve().as_uri()
    browser.theme("light")
    browser.size(*DESK)
    browser.open(page)
    if pictures:
        (pictures / "without-webgl.png").write_bytes(browser.picture())
    check("without WebGL: it is said", "WebGL 2" in browser.js("document.getElementById('scene-message').textContent"))
    seen = browser.js("['scene', 'modes', 'whole', 'above'].filter((id) => document.getElementById(id).checkVisibility())")
    check("without WebGL: no control of the view", seen == [], seen)
    browser.js("document.querySelector('#table tbody tr button')?.click()")
    check("without WebGL: a row is chosen and its card seen", count == 0 or browser.js("app.chosen >= 0 && document.getElementById('card').checkVisibility()"))
    browser.js("(() => { const slider = document.getElementById('chainage'); slider.value = slider.max; slider.dispatchEvent(new Event('input')); })()")
    check("without WebGL: the slider moves the mark on the plan", browser.js("Math.hypot(app.plan.eye.x - app.axis.at(app.axis.to).x, app.plan.eye.y - app.axis.at(app.axis.to).y) < 1"))
    browser.js("document.getElementById('plan').focus()")
    before = browser.js("app.chosen")
    browser.key("n")
    check("without WebGL: n chooses the next object", count < 2 or browser.js("app.chosen") != before)
    browser.js("document.getElementById('keys').click()")
    check("without WebGL: the help opens", browser.js("document.getElementById('help').open"))
    quiet(browser, page)


def examine_surfaces(browser, out, pictures):
    """A drive in feet with a long name, divided into surfaces."""
    page = (out / "report.html").resolve().as_uri()
    browser.theme("light")
    browser.size(*SMALL_DESK)
    browser.open(page)
    head = browser.js("document.querySelector('header').innerText")
    check("the head has the unit", "coordinates in US survey ft" in head, head)
    check("surfaces are called so", "Surfaces" in head and browser.js("document.getElementById('tab-table').textContent") == "Surfaces")
    check("objects are not mentioned", "object" not in browser.js("document.querySelector('main').innerText").lower().replace("objects.csv", ""))
    heads = browser.js("[...document.querySelectorAll('#table th button')].map((button) => button.textContent)")
    check("coordinates are in feet, lengths in metres", {"base x (US survey ft)", "length (m)"} <= set(heads), heads)
    warnings = browser.js("app.run.result.warnings.length")
    check("warnings are announced", warnings > 0 and browser.js("document.getElementById('notices').innerText").startswith(f"{warnings} warning"))
    browser.js("document.querySelector('#notices .what').click()")
    check("and lead to the run", browser.js("document.getElementById('run-panel').checkVisibility()"))
    wide = browser.js("Math.min(...[...document.querySelectorAll('#run-panel section > .settings dd')].map((node) => node.offsetWidth))")
    check("a long name leaves room for its figures", wide >= 90, wide)
    if pictures:
        (pictures / "surfaces-run.png").write_bytes(browser.picture())
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
      if (x < 60 || y < 100 || x > canvas.clientWidth - 300 || y > canvas.clientHeight - 120 || scene.pick(camera, x, y) !== key) continue;
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
            browser.js(f"app.legend.hidden.add({code}); app.paint()")
            wait_for(browser, "streamed points are painted again", "app.scene.nodes.every(({ cloud }) => !cloud || cloud.version === app.painted)")
            shown_keys = browser.js("(() => { let shown = 0; for (const { cloud } of app.scene.nodes) for (let at = 0; cloud && at < cloud.count; at++) if (cloud.points.keys[cloud.order[at]] === %d && cloud.look[4 * at + 3] !== 0) shown++; return shown; })()" % (seen["id"] + 1))
            check("a hidden class is hidden", shown_keys == 0, shown_keys)
            browser.js(f"app.legend.hidden.delete({code}); app.paint()")
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
        count = examine(browser, out, names[0] if len(names) == 1 else f"{names[0]} to {names[-1]}", arguments.pictures)
        if count and (out / "drive.copc.laz").exists():
            examine_streamed(browser, out, arguments.pictures)
        long_name, feet = scratch / f"{'n' * 200}.laz", scratch / "feet"
        shutil.copy(SAMPLE, long_name)
        subprocess.run([PROGRAM, "run", long_name, "-o", feet, "--progress", "none", "--threads", "1", "--method", "p-linkage", "--set", "input.unit=us-survey-foot"], check=True, stdout=subprocess.DEVNULL)
        examine_surfaces(browser, feet, arguments.pictures)
        quietly = ["--progress", "none", "--threads", "1"]
        empty, street, facades = scratch / "empty", scratch / "street", scratch / "facades"
        subprocess.run([PROGRAM, "run", SAMPLE, "-o", empty, *quietly, "--outputs", "csv,report", "--method", "euclidean", "--set", "euclidean.min_points=100000"], check=True, stdout=subprocess.DEVNULL)
        examine_empty(browser, empty)
        subprocess.run([PROGRAM, "synth", "mixed", "-o", street, "--length", "60m", "--las", "-q"], check=True, stdout=subprocess.DEVNULL)
        subprocess.run([PROGRAM, "run", street, "-o", facades, *quietly, "--outputs", "csv,report"], check=True, stdout=subprocess.DEVNULL)
        examine_facades(browser, facades, arguments.pictures)
        blind = Browser(path, scratch / "profile-without-webgl", DRAWS_NOT)
        stack.callback(blind.close)
        examine_without_webgl(blind, out, arguments.pictures, count)
    if FAILED:
        sys.exit(f"{len(FAILED)} checks failed")
    print("all checks passed")


if __name__ == "__main__":
    main()
