"""Runs the package in a headless Chromium: browser.py CHROMIUM PACKAGE

Answers must be the bits of expected.txt, and the module must be found beside the script.
"""

import functools
import http.server
import pathlib
import sys
import threading

from playwright.sync_api import sync_playwright

BROWSER, PACKAGE = sys.argv[1], pathlib.Path(sys.argv[2]).resolve()
HERE = pathlib.Path(__file__).resolve().parent
PROGRAM = """async () => {
    const { load } = await import("/antumbra.js");
    const { digest, soup } = await import("/tests/scene.mjs");
    const { positions, origins, directions } = soup(2000, 5000);
    const scene = (await load()).build({ positions });
    const { t, uv, triangle, mesh } = scene.intersect({ origins, directions });
    return digest(scene.occluded({ origins, directions })) + " " + digest(t, uv, triangle, mesh);
}"""


class Files(http.server.SimpleHTTPRequestHandler):
    extensions_map = {**http.server.SimpleHTTPRequestHandler.extensions_map, ".mjs": "text/javascript"}

    def translate_path(self, path):
        if path.startswith("/tests/"):
            return str(HERE / pathlib.PurePosixPath(path).name)
        return super().translate_path(path)

    def do_GET(self):
        if self.path != "/":
            return super().do_GET()
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<!doctype html><title>antumbra</title>")

    def log_message(self, *_):
        pass


def main():
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), functools.partial(Files, directory=PACKAGE))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=BROWSER, args=["--no-sandbox"])
        page = browser.new_page()
        page.goto(f"http://127.0.0.1:{server.server_port}/")
        found = page.evaluate(PROGRAM)
        version = browser.version
        browser.close()
    expected = (HERE / "expected.txt").read_text().strip()
    if found != expected:
        sys.exit(f"Chromium {version} answers {found}, the library {expected}")
    print(f"Chromium {version} answers with the bits of the library")


main()
