"""The command line."""

import sys

from overlapper.install import hint

try:
    import rich  # noqa: F401
    import typer  # noqa: F401
except ImportError:
    # The entry point imports this package before it can call anything in it.
    print(f"overlapper: the command line needs {hint('typer', 'rich')}", file=sys.stderr)
    sys.exit(2)

from overlapper.cli.app import main

__all__ = ["main"]
