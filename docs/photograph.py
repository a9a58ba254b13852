"""Photographs of pages in Chromium."""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "tests" / "support"))
from browser import CHROMIUM, Browser  # noqa: E402  # which drives it for the tests, too

READ = "document.readyState === 'complete' && !document.querySelector('#unread')"  # the page of a recording, as a whole


@contextmanager
def browser(width: int, height: int, scale: float = 1.0) -> Iterator[Browser]:
    """A window of `width` by `height` pixels of a page, which are `scale` times as many in a photograph."""
    if CHROMIUM is None:
        sys.exit("the pictures of the documentation need Chromium: apt-get install chromium")
    with tempfile.TemporaryDirectory() as profile:
        opened = Browser(Path(profile), (width, height))
        try:
            metrics = {"width": width, "height": height, "deviceScaleFactor": scale, "mobile": False}
            opened("Emulation.setDeviceMetricsOverride", **metrics)
            yield opened
        finally:
            opened.close()


def photograph(link: str, picture: Path, until: str = READ, size: tuple[int, int] = (1200, 750)) -> None:
    """The page at a link once the expression `until` is true in it, with 1.6 pixels for each of `size`."""
    with browser(*size, scale=1.6) as window:
        window.open(link, until)
        save(window, picture)


def save(window: Browser, picture: Path) -> None:
    """Save the contents of a window as a PNG."""
    Image.fromarray(window.picture().astype("uint8")).save(picture, optimize=True)
    print(picture)
