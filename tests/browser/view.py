"""Checks the page of `antumbra view` in a browser: view.py CHROMIUM ANTUMBRA FOLDER [SCENE [WIDTHxHEIGHT]]

Load, progress, camera, crop, maps, exposure, saving, stopping, two viewers, a server that is gone; no request to
anywhere else, nothing that sticks out to the side. Screenshots are left in FOLDER. Times are printed, not judged.
"""

import pathlib
import re
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

from playwright.sync_api import sync_playwright

BROWSER, PROGRAM, FOLDER = sys.argv[1], sys.argv[2], pathlib.Path(sys.argv[3])
SCENE = sys.argv[4] if len(sys.argv) > 4 else "builtin:city:20000"
SIZE = sys.argv[5] if len(sys.argv) > 5 else "400x300"
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


def start(*more):
    command = [PROGRAM, "view", SCENE, "--resolution", SIZE, *more]
    begun = time.monotonic()
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    address = process.stdout.readline().strip()
    expect(re.fullmatch(r"http://127\.0\.0\.1:\d+/[0-9a-f]{32}/", address), f"the address is {address!r}")
    return process, address, begun


def watch(page, name, address):
    origin = address.split("/", 3)[2]
    page.on("pageerror", lambda error: expect(False, f"{name}: error: {error}"))
    page.on("request", lambda request: expect(
        request.url.startswith(("data:", "blob:")) or request.url.split("/", 3)[2] == origin, f"{name}: asked for {request.url}"))


def data(page, name):
    return page.evaluate(f"() => document.body.dataset[{name!r}]")


def until(page, condition, seconds=120):
    page.wait_for_function(condition, timeout=1000 * seconds, polling=20)


def lit(page):
    """Mean of the canvas, 0 to 255."""
    return page.evaluate(
        """() => {
            const c = document.getElementById('picture');
            const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
            let sum = 0;
            for (let i = 0; i < d.length; i += 4) sum += d[i] + d[i + 1] + d[i + 2];
            return sum / (0.75 * d.length);
        }"""
    )


PICTURE = "() => Number(document.body.dataset.tiles) > 0"
FINISHED = "() => document.body.dataset.phase === 'finished'"


def settle(page):
    """Waits until the wish that was sent last is finished."""
    page.wait_for_timeout(300)
    until(page, FINISHED)


def drag(page, box, way, steps=20, button="left", hold=None):
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    if hold:
        page.keyboard.down(hold)
    page.mouse.move(x, y)
    page.mouse.down(button=button)
    for step in range(1, steps + 1):
        page.mouse.move(x + way[0] * step / steps, y + way[1] * step / steps)
        page.wait_for_timeout(16)
    page.mouse.up(button=button)
    if hold:
        page.keyboard.up(hold)


def first_look(context):
    """Load and first picture, from the start of the program."""
    process, address, begun = start("--spp", "64")
    page = context.new_page()
    watch(page, "first look", address)
    asked = time.monotonic()
    page.goto(address, wait_until="load")
    loaded = time.monotonic()
    until(page, PICTURE)
    shown = time.monotonic()
    print(f"page loaded {loaded - asked:.2f} s after it was asked for, first picture {shown - begun:.2f} s after the start of the program")
    return process, address, page


def moving(page):
    """Updates a second while the camera moves, and just after."""
    box = page.locator("#picture").bounding_box()
    count = """() => { window.draws = 0; const draw = picture.draw.bind(picture);
        picture.draw = (range) => { const drawn = draw(range); if (drawn) window.draws++; return drawn; }; }"""
    page.evaluate(count)
    frames = int(data(page, "frame"))
    begun = time.monotonic()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    page.mouse.move(x, y)
    page.mouse.down()
    step = 0
    while time.monotonic() - begun < 4:
        step += 1
        page.mouse.move(x + 80 * ((step % 100) / 100 - 0.5), y + 10 * ((step % 40) / 40 - 0.5))
        page.wait_for_timeout(8)
    page.mouse.up()
    seconds = time.monotonic() - begun
    draws = page.evaluate("() => window.draws")
    pictures = int(data(page, "frame")) - frames
    print(f"while the camera moved: {draws / seconds:.1f} updates and {pictures / seconds:.1f} new pictures a second, {step / seconds:.0f} moves a second")
    page.evaluate("() => { window.draws = 0; }")
    begun = time.monotonic()
    page.wait_for_timeout(1000)
    print(f"in the second after it: {page.evaluate('() => window.draws') / (time.monotonic() - begun):.1f} updates a second")


def check(context, name):
    process, address, begun = start("--spp", "16")
    page = context.new_page()
    watch(page, name, address)
    page.goto(address, wait_until="load")
    until(page, PICTURE)
    # Tiles are painted with the next frame of the browser.
    page.evaluate("() => new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    expect(lit(page) > 5, f"{name}: the first picture is black")
    until(page, FINISHED)
    expect(page.locator("#samples").inner_text() == "16 of 16", f"{name}: {page.locator('#samples').inner_text()}")
    width, window = page.evaluate("() => [document.documentElement.scrollWidth, window.innerWidth]")
    expect(width <= window, f"{name}: {width} pixels wide in a window of {window}")
    page.screenshot(path=FOLDER / f"view-{name}.png", full_page=True)

    # Exposure.
    before = lit(page)
    page.locator("#exposure").fill("2")
    page.wait_for_timeout(200)
    expect(lit(page) > before * 1.1, f"{name}: exposure changes {before:.1f} to {lit(page):.1f}")
    page.locator("#exposure").fill("0")

    # Camera: turned, shifted, nearer, by keys, and home again.
    pose = lambda: page.evaluate("() => JSON.stringify(look)")
    home, box = pose(), page.locator("#picture").bounding_box()
    drag(page, box, [40, 15])
    turned = pose()
    settle(page)
    expect(turned != home, f"{name}: dragging does not turn the camera")
    eye = page.evaluate("() => JSON.stringify(status.look.eye) === JSON.stringify(look.eye)")
    expect(eye, f"{name}: the picture is not that of the camera")
    drag(page, box, [-30, 10], hold="Shift")
    expect(pose() != turned, f"{name}: the camera cannot be shifted")
    if name != "phone":
        # Phones have no wheel.
        shifted = pose()
        page.mouse.move(box["x"] + 20, box["y"] + 20)
        page.mouse.wheel(0, -200)
        page.wait_for_timeout(100)
        expect(pose() != shifted, f"{name}: the wheel does nothing")
    page.keyboard.press("w")
    page.keyboard.press("ArrowLeft")
    page.locator("#home").click()
    settle(page)
    page.wait_for_timeout(300)
    expect(pose() == home, f"{name}: home is {pose()}, not {home}")

    # Crop by mouse, and the whole picture again.
    size = lambda: page.evaluate("() => [picture.frame.columns, picture.frame.rows]")
    whole = size()
    page.keyboard.press("c")
    box = page.locator("#picture").bounding_box()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 0.25 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.75 * box["width"], box["y"] + 0.5 * box["height"], steps=4)
    page.screenshot(path=FOLDER / f"view-{name}-crop.png")
    page.mouse.up()
    settle(page)
    part = size()
    expect(abs(part[0] - whole[0] / 2) < 4 and abs(part[1] - whole[1] / 4) < 4, f"{name}: a crop of {part} of {whole}")
    page.locator("#whole").click()
    settle(page)
    expect(size() == whole, f"{name}: the whole picture has {size()}, not {whole}")

    # Maps before and after learning.
    for mode in ("before", "after"):
        page.locator(f"input[value={mode}]").check(force=True)
        until(page, f"() => status.mode === '{mode}' && status.phase === 'finished' && (status.{mode} !== null)")
        page.wait_for_timeout(300)
        page.screenshot(path=FOLDER / f"view-{name}-{mode}.png", full_page=True)
    expect(page.locator("#tests").is_visible(), f"{name}: no figures of the maps")
    print(f"{name}: {page.locator('#tests').inner_text()}")
    page.locator("input[value=picture]").check(force=True)
    settle(page)

    # Saving.
    for button, start_bytes in (("png", b"\x89PNG"), ("exr", b"\x76\x2f\x31\x01")):
        with page.expect_download() as download:
            page.locator(f"#{button}").click()
        saved = pathlib.Path(download.value.path()).read_bytes()
        expect(saved.startswith(start_bytes), f"{name}: the saved {button} begins with {saved[:8]}")

    # Two viewers see the same, and either can stop.
    other = context.new_page()
    watch(other, f"{name}, second viewer", address)
    other.goto(address, wait_until="load")
    until(other, PICTURE)
    page.bring_to_front()
    drag(page, page.locator("#picture").bounding_box(), [20, 0], steps=3)
    settle(page)
    settle(other)
    same = other.evaluate("() => JSON.stringify(look)") == pose()
    expect(same, f"{name}: the second viewer has another camera")
    other.close()

    # A guess at the address, and a name that leads here.
    origin = "/".join(address.split("/", 3)[:3])
    for url, host in ((origin + "/", None), (origin + "/" + "0" * 32 + "/", None), (address, "evil.example")):
        request = urllib.request.Request(url, headers={"Host": host} if host else {})
        try:
            urllib.request.urlopen(request)
            expect(False, f"{name}: {url} as {host} is answered")
        except urllib.error.HTTPError as error:
            expect(error.code in (403, 404), f"{name}: {url}: {error.code}")

    # The program ends, and the page says so.
    page.on("dialog", lambda dialog: dialog.accept())
    page.locator("#quit").click()
    until(page, "() => document.body.dataset.gone === 'yes'", 20)
    expect(process.wait(20) == 0, f"{name}: the program ended with {process.returncode}")
    expect(page.locator("#gone").is_visible(), f"{name}: the page says nothing of the end")
    expect(lit(page) > 5, f"{name}: the picture has gone with the program")
    page.screenshot(path=FOLDER / f"view-{name}-gone.png", full_page=True)
    page.close()


def stopping(context):
    process, address, _ = start("--spp", "100000")
    page = context.new_page()
    watch(page, "stopping", address)
    page.goto(address)
    until(page, "() => Number(document.body.dataset.samples) > 0")
    page.locator("#stop").click()
    until(page, "() => document.body.dataset.phase === 'stopped'")
    tiles = data(page, "tiles")
    page.wait_for_timeout(500)
    expect(data(page, "tiles") == tiles, "tiles come after the stop")
    page.locator("#stop").click()
    until(page, "() => document.body.dataset.phase === 'rendering'")
    # Ctrl-C in the terminal.
    process.send_signal(2)
    until(page, "() => document.body.dataset.gone === 'yes'", 20)
    expect(process.wait(20) == 0, f"after Ctrl-C the program ended with {process.returncode}")
    page.close()


def main():
    FOLDER.mkdir(parents=True, exist_ok=True)
    with sync_playwright() as playwright, tempfile.TemporaryDirectory() as profile:
        options = {"executable_path": BROWSER, "args": QUIET, "headless": True}
        context = playwright.chromium.launch_persistent_context(profile, **options, **VIEWS["light"])
        process, address, page = first_look(context)
        moving(page)
        process.send_signal(2)
        process.wait(20)
        page.close()
        stopping(context)
        context.close()
        browser = playwright.chromium.launch(**options)
        for name, view in VIEWS.items():
            context = browser.new_context(**view, accept_downloads=True)
            check(context, name)
            context.close()
        browser.close()
    if mistakes:
        sys.exit(1)
    print(f"the page of view holds in {len(VIEWS)} views; screenshots in {FOLDER}")


main()
