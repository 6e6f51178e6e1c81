"""Take the pictures of the tools for the book: python docs/tool_pictures.py (needs Chromium)."""

import io
import sys
from pathlib import Path
from shutil import which
from tempfile import TemporaryDirectory

from PIL import Image
from playwright.sync_api import sync_playwright

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "docs" / "_static" / "tools"
LONG = 200_000


def main() -> None:
    sys.path.insert(0, str(ROOT))
    from tests.browser.conftest import served

    explore = ROOT / "notebooks" / "explore"
    FOLDER.mkdir(exist_ok=True)
    with TemporaryDirectory() as root, sync_playwright() as player:
        browser = player.chromium.launch(executable_path=which("chromium"), args=["--no-sandbox"])
        with served(explore, Path(root), "--preheat_kernel=False") as address:
            for notebook in sorted(explore.glob("*.ipynb")):
                page = browser.new_page(viewport={"width": 1200, "height": 760})
                page.goto(address, timeout=LONG)
                page.locator(f"a[href$='/{notebook.name}']").click(timeout=LONG)
                page.locator(".shipnet-verdict").wait_for(timeout=LONG)
                page.locator(".shipnet-page").first.scroll_into_view_if_needed()
                page.wait_for_timeout(2000)
                picture = Image.open(io.BytesIO(page.screenshot())).convert("RGB")
                picture = picture.resize((900, 570)).quantize(64)
                picture.save(FOLDER / f"{notebook.stem}.png", optimize=True)
                print(notebook.stem, flush=True)
                page.close()


if __name__ == "__main__":
    main()
