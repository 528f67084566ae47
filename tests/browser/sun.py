"""Checks the page of `antumbra view --day` in a browser: sun.py CHROMIUM ANTUMBRA FOLDER [SCENE [WIDTHxHEIGHT]]

Hours in colours with their legend, shadows by a slider, clicks on points, their diagram and table, saving, other cameras and back
to the picture; no request to anywhere else, nothing that sticks out to the side. Screenshots are left in FOLDER. Times are
printed, not judged.
"""

import csv
import json
import pathlib
import subprocess
import sys
import time
import urllib.error
import urllib.request

from playwright.sync_api import sync_playwright

BROWSER, PROGRAM, FOLDER = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
SCENE = sys.argv[4] if len(sys.argv) > 4 else "builtin:city:20000"
SIZE = sys.argv[5] if len(sys.argv) > 5 else "400x300"
DAY = ["--day", "2025-06-21", "--lat", "48.2082", "--lon", "16.3738"]
QUIET = ["--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-background-networking"]
QUIET += ["--disable-component-update", "--disable-sync"]
VIEWS = {
    "light": {"viewport": {"width": 1280, "height": 800}},
    "dark": {"viewport": {"width": 1280, "height": 800}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 360, "height": 780}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True},
}
mistakes = []


def expect(holds, words):
    if not holds:
        mistakes.append(words)
        print("MISTAKE:", words)


def finished(page, mode, more="true"):
    page.wait_for_timeout(150)
    condition = f"() => !sending && status.phase === 'finished' && status.mode === '{mode}' && {more}"
    page.wait_for_function(condition, timeout=120_000, polling=20)
    # Tiles are painted with the next frame of the browser.
    page.wait_for_timeout(250)


def pixels(page):
    """Red, green and blue of the canvas, one after the other."""
    return page.evaluate(
        """() => {
            const c = document.getElementById('picture');
            return Array.from(c.getContext('2d').getImageData(0, 0, c.width, c.height).data).filter((_, i) => i % 4 < 3);
        }"""
    )


def differ(a, b):
    return sum(x != y for x, y in zip(a, b)) / max(1, len(a)) if len(a) == len(b) else 1.0


def check(context, name):
    command = [PROGRAM, "view", SCENE, "--resolution", SIZE, "--spp", "4", *DAY]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    address = process.stdout.readline().strip()
    origin = address.split("/", 3)[2]
    page = context.new_page()
    page.on("pageerror", lambda error: expect(False, f"{name}: error: {error}"))
    page.on("request", lambda request: expect(
        request.url.startswith(("data:", "blob:")) or request.url.split("/", 3)[2] == origin, f"{name}: asked for {request.url}"))
    page.goto(address, wait_until="load")
    finished(page, "hours", "day !== null")
    hours = pixels(page)
    expect(page.locator("#legend").is_visible() and page.locator("#high").inner_text() == "16 h",
           f"{name}: the legend ends at {page.locator('#high').inner_text()!r}")
    expect("21 June 2025" in page.locator("#day").inner_text(), f"{name}: the day is {page.locator('#day').inner_text()!r}")
    expect(not page.locator("input[value=before]").is_visible(), f"{name}: maps of tests are offered")
    width, window = page.evaluate("() => [document.documentElement.scrollWidth, window.innerWidth]")
    expect(width <= window, f"{name}: {width} pixels wide in a window of {window}")

    # Points: the diagram agrees with the sum, and the same answer comes from the server alone.
    box = page.locator("#picture").bounding_box()
    for share in ((0.5, 0.8), (0.35, 0.9)):
        page.mouse.click(box["x"] + share[0] * box["width"], box["y"] + share[1] * box["height"])
        page.wait_for_timeout(300)
    expect(page.evaluate("() => points.length") == 2, f"{name}: {page.evaluate('() => points.length')} points of two clicks")
    expect(page.evaluate("() => JSON.stringify(look) === JSON.stringify(status.look)"), f"{name}: a click turns the camera")
    point = page.evaluate("() => points[0]")
    expect(abs(sum(point["seen"]) / 12 - point["hours"]) < 1e-6, f"{name}: {sum(point['seen'])} steps of {point['hours']} hours")
    expect("Point 2" in page.locator("#pointhours").inner_text(), f"{name}: {page.locator('#pointhours').inner_text()!r}")
    bright = page.evaluate("() => document.querySelectorAll('#diagram rect[fill=\"#e8a917\"]').length")
    expect(bright == sum(page.evaluate("() => points[1].seen")), f"{name}: the diagram has {bright} bright steps")
    marks = page.locator("#marks span")
    expect(marks.count() == 2, f"{name}: {marks.count()} marks of two points")
    mark = marks.nth(0).bounding_box()
    apart = [mark["x"] + mark["width"] / 2 - box["x"] - 0.5 * box["width"], mark["y"] + mark["height"] / 2 - box["y"] - 0.8 * box["height"]]
    expect(max(map(abs, apart)) < 2.5, f"{name}: the mark is {apart} pixels beside the click")
    page.screenshot(path=FOLDER / f"sun-{name}-hours.png", full_page=True)

    # The table has the points, and can be saved.
    with page.expect_download() as download:
        page.locator("#csv").click()
    rows = list(csv.DictReader(pathlib.Path(download.value.path()).read_text().splitlines()))
    expect(len(rows) == 2 and float(rows[0]["hours"]) == round(point["hours"], 4), f"{name}: the table is {rows}")
    expect(sum(int(rows[0][key]) for key in rows[0] if ":" in key) == sum(point["seen"]), f"{name}: steps of the table")
    with page.expect_download() as download:
        page.locator("#png").click()
    saved = pathlib.Path(download.value.path()).read_bytes()
    expect(saved.startswith(b"\x89PNG"), f"{name}: the saved picture begins with {saved[:8]}")

    # Shadows follow the slider.
    seen = {}
    for hour in ("7", "12", "17"):
        page.locator("#hour").fill(hour)
        page.locator("#hour").dispatch_event("input")
        finished(page, "shadows", f"Math.abs(status.hour - {hour}) < 0.01")
        seen[hour] = pixels(page)
        expect(page.locator("#clock").inner_text() == f"{int(hour):02d}:00", f"{name}: the clock says {page.locator('#clock').inner_text()}")
    page.screenshot(path=FOLDER / f"sun-{name}-shadows.png", full_page=True)
    for a, b in (("7", "12"), ("12", "17"), ("7", "17")):
        expect(differ(seen[a], seen[b]) > 0.02, f"{name}: shadows at {a} and {b} are alike")
    begun, steps = time.monotonic(), 30
    for step in range(steps):
        page.locator("#hour").evaluate(f"(slider) => {{ slider.value = {8 + step / 4}; slider.dispatchEvent(new Event('input')); }}")
        page.wait_for_timeout(20)
    finished(page, "shadows", f"Math.abs(status.hour - {8 + (steps - 1) / 4}) < 0.1")
    print(f"{name}: {steps} times of the slider took {time.monotonic() - begun:.2f} s")

    # Another camera and back: the same hours. A phone has scrolled to the slider.
    page.locator("#picture").scroll_into_view_if_needed()
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    page.mouse.move(box["x"] + box["width"] / 2 + 60, box["y"] + box["height"] / 2 + 10, steps=6)
    page.mouse.up()
    page.locator("input[value=hours]").check(force=True)
    finished(page, "hours")
    expect(differ(hours, pixels(page)) > 0.1, f"{name}: dragging does not turn the camera")
    page.locator("#home").click()
    finished(page, "hours", "JSON.stringify(look) === JSON.stringify(status.look)")
    expect(differ(hours, pixels(page)) == 0.0, f"{name}: home again, {differ(hours, pixels(page)):.3f} of the picture has changed")
    page.locator("input[value=picture]").check(force=True)
    finished(page, "picture")
    expect(differ(hours, pixels(page)) > 0.1, f"{name}: the picture looks as the hours")
    expect(not page.locator("#legend").is_visible(), f"{name}: the picture has a legend")

    # What makes no sense is refused.
    def status_of(path, body=None):
        try:
            return urllib.request.urlopen(urllib.request.Request(address + path, data=body)).status
        except urllib.error.HTTPError as error:
            return error.code

    expect(status_of("point?x=0.5") == 400, f"{name}: half a point is answered")
    expect(status_of("wish", json.dumps({"hour": 25}).encode()) == 400, f"{name}: 25 o'clock is taken")
    page.locator("#forget").click()
    expect(not page.locator("#point").is_visible(), f"{name}: cleared points stay")
    process.send_signal(2)
    expect(process.wait(20) == 0, f"{name}: the program ended with {process.returncode}")
    page.close()


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=QUIET, headless=True)
        for name, view in VIEWS.items():
            context = browser.new_context(**view, accept_downloads=True)
            check(context, name)
            context.close()
        browser.close()
    if mistakes:
        sys.exit(1)
    print(f"the page of the sun holds in {len(VIEWS)} views; screenshots in {FOLDER}")


main()
