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

try:
    from overlapper.cli.app import main
except KeyboardInterrupt:
    # The imports of all commands take most of a second.
    print("overlapper: interrupted", file=sys.stderr)
    sys.exit(130)

__all__ = ["main"]
