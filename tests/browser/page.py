"""Checks the page of a study in a browser: page.py CHROMIUM REPORT.html FOLDER

It must load without errors and without asking the network for anything, its slider must wipe between the maps, and
nothing may stick out to the side, on a desk, on a phone, in the dark and on paper. Screenshots are left in FOLDER.
"""

import pathlib
import sys

from playwright.sync_api import sync_playwright

BROWSER, PAGE, FOLDER = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
VIEWS = {
    "desktop": {"viewport": {"width": 1280, "height": 900}},
    "dark": {"viewport": {"width": 1280, "height": 900}, "color_scheme": "dark"},
    "phone": {"viewport": {"width": 360, "height": 780}, "device_scale_factor": 2, "is_mobile": True, "has_touch": True},
    "phone-dark": {"viewport": {"width": 360, "height": 780}, "is_mobile": True, "color_scheme": "dark"},
}
mistakes = []


def expect(holds, words):
    if not holds:
        mistakes.append(words)


def shown(page):
    """Share of the first map that is covered by the second one, from what is drawn."""
    return page.evaluate(
        """() => {
            const over = document.querySelector('.wipe .over');
            return getComputedStyle(over).clipPath;
        }"""
    )


def lightness(page):
    """Mean of the background's channels."""
    colour = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    return sum(float(part) for part in colour.strip("rgb()").split(",")[:3]) / 3


def check(page, name):
    page.on("console", lambda message: expect(False, f"{name}: console: {message.text}"))
    page.on("pageerror", lambda error: expect(False, f"{name}: error: {error}"))
    page.on(
        "request",
        lambda request: expect(request.url.startswith(("file:", "data:")), f"{name}: asked for {request.url}"),
    )
    page.goto(PAGE.resolve().as_uri(), wait_until="load")
    width, window = page.evaluate("() => [document.documentElement.scrollWidth, window.innerWidth]")
    expect(width <= window, f"{name}: {width} pixels wide in a window of {window}")
    expect(page.locator("h1").is_visible(), f"{name}: no heading")
    broken = page.evaluate("() => [...document.images].filter(image => !image.naturalWidth).length")
    expect(broken == 0, f"{name}: {broken} pictures cannot be shown")
    plots = page.locator(".chart svg")
    expect(plots.count() > 0, f"{name}: no plots")
    for plot in plots.all():
        box = plot.bounding_box()
        expect(box and box["height"] > 50, f"{name}: a plot without height")
    dark = "dark" in name
    expect((lightness(page) < 80) == dark, f"{name}: the background is {lightness(page):.0f} light")
    wipe = page.locator(".wipe").first
    slider = wipe.locator("input")
    expect(slider.count() == 1, f"{name}: no slider")
    box = wipe.bounding_box()
    for share in (0.25, 0.8):
        wipe.scroll_into_view_if_needed()
        box = wipe.bounding_box()
        page.mouse.click(box["x"] + share * box["width"], box["y"] + box["height"] / 2)
        found = float(slider.input_value()) / 100
        expect(abs(found - share) < 0.05, f"{name}: the slider is at {found}, not {share}")
        expect(f"{slider.input_value()}%" in shown(page), f"{name}: the wipe shows {shown(page)}")
    slider.focus()
    before = slider.input_value()
    page.keyboard.press("ArrowLeft")
    expect(float(slider.input_value()) < float(before), f"{name}: the slider does not know the keyboard")
    page.evaluate("() => scrollTo(0, 0)")
    page.screenshot(path=FOLDER / f"report-{name}.png", full_page=True)


def main():
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        for name, view in VIEWS.items():
            context = browser.new_context(**view, offline=True)
            check(context.new_page(), name)
            context.close()
        page = browser.new_page()
        page.goto(PAGE.resolve().as_uri())
        page.pdf(path=FOLDER / "report.pdf", format="A4", print_background=True)
        browser.close()
    for words in mistakes:
        print(words)
    if mistakes:
        sys.exit(1)
    print(f"the page holds in {len(VIEWS)} views; screenshots in {FOLDER}")


main()
