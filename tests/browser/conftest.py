"""A browser, the built book, and a page that nothing outside this machine may serve."""

import shutil
import socket
import subprocess
import sys
import threading
import time
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

from docs import app
from tests.support import require

SITE = Path(__file__).resolve().parents[2] / "build" / "site"
#: How long a page may take on a busy machine [ms]; no test asserts it.
PATIENCE = 120_000
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
FLAGS = (
    "--headless --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-sync "
    "--disable-background-networking --disable-component-update"
)
ARGUMENTS = [*FLAGS.split(), "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1"]


@contextmanager
def served(folder: Path, root: Path, *options: str) -> Iterator[str]:
    """Serve the tools of a folder, with template and log in `root`; yield their address."""
    app.build(folder, root)
    port = free_port()
    command, environment = app.voila(folder, root, f"--port={port}", *options)
    with answering(command, environment, f"http://127.0.0.1:{port}", root / "log") as address:
        yield address


def free_port() -> int:
    """Return the number of a port that nothing uses."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        port: int = free.getsockname()[1]
    return port


@contextmanager
def answering(
    command: list[str], environment: dict[str, str], address: str, log: Path
) -> Iterator[str]:
    """Run a server; yield its address once it answers there."""
    with (
        log.open("wb") as out,
        subprocess.Popen(command, env=environment, stdout=out, stderr=out) as server,
    ):
        try:
            for _ in range(480):
                assert server.poll() is None, log.read_text()
                try:
                    urllib.request.urlopen(address, timeout=5).close()
                    break
                except OSError:
                    time.sleep(0.25)
            else:
                pytest.fail(f"the server does not answer: {log.read_text()}")
            yield address
        finally:
            server.terminate()
            print(log.read_text())


@pytest.fixture(scope="session")
def browser() -> Iterator[object]:
    program = next(filter(None, map(shutil.which, BROWSERS)), None)
    require("browser", program is not None, "Chromium is not installed")
    from playwright.sync_api import expect, sync_playwright

    expect.set_options(timeout=PATIENCE)
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=program, args=ARGUMENTS)
        yield chromium
        chromium.close()


@pytest.fixture(scope="session")
def site() -> Path:
    if not (SITE / "index.html").is_file():
        pytest.fail("the book is not built: run make site first", pytrace=False)
    return SITE


class _Handler(SimpleHTTPRequestHandler):
    def do_GET(self) -> None:
        # A browser asks for an icon that no page names.
        if self.path == "/favicon.ico":
            self.send_response(204)
            self.end_headers()
        else:
            super().do_GET()

    def log_message(self, format: str, *args: object) -> None:
        pass


class _Server(ThreadingHTTPServer):
    def handle_error(self, request: object, client_address: object) -> None:
        # A page that is closed while it loads hangs up.
        if not isinstance(sys.exception(), ConnectionError):
            super().handle_error(request, client_address)


@pytest.fixture(scope="session")
def url(site: Path) -> Iterator[str]:
    server = _Server(("127.0.0.1", 0), partial(_Handler, directory=site))
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
    thread.join()


@pytest.fixture
def page(browser) -> Iterator[object]:
    """Yield a page; afterwards it must have asked nobody else for anything, and met no error."""
    context = browser.new_context(viewport={"width": 1400, "height": 1000})
    context.set_default_timeout(PATIENCE)
    page = context.new_page()
    requests: list[str] = []
    errors: list[str] = []
    page.on("request", lambda request: requests.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on(
        "console", lambda message: errors.append(message.text) if message.type == "error" else None
    )
    yield page
    context.close()
    here = ("http://127.0.0.1:", "file://", "data:", "blob:")
    assert [request for request in requests if not request.startswith(here)] == []
    assert errors == []
