"""The command line."""

import sys

try:
    import rich  # noqa: F401
    import typer  # noqa: F401
except ImportError:
    # The entry point imports this package before it can call anything in it.
    print("overlapper: the command line needs typer and rich: pip install 'overlapper[cli]'", file=sys.stderr)
    sys.exit(2)

from overlapper.cli.app import main

__all__ = ["main"]
