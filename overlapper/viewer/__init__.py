"""Views of bodies and overlaps: live in a browser, recorded as a page that needs no network, or in a notebook."""

from typing import TYPE_CHECKING

from overlapper.face import lazily as _lazily

if TYPE_CHECKING:
    from overlapper.viewer.live import Viewer
    from overlapper.viewer.look import Look
    from overlapper.viewer.recording import Recording

__all__ = ["Look", "Recording", "Viewer"]

# Imported on first use, as an overlap in a notebook needs numpy alone.
__getattr__ = _lazily(__name__, {"live": ("Viewer",), "look": ("Look",), "recording": ("Recording",)})
