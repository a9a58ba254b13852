"""The command line."""

from overlapper.cli.app import main

__all__ = ["main"]
