"""What bodies share, drawn: live in a browser, or recorded as a page that needs no network."""

from overlapper.viewer.live import Viewer
from overlapper.viewer.look import Look
from overlapper.viewer.recording import Recording

__all__ = ["Look", "Recording", "Viewer"]
