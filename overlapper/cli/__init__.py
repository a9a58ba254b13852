"""The command line."""

import sys

from overlapper.install import hint

# The entry point imports this package before it can call anything in it. The imports take most of a second.
try:
    try:
        import rich  # noqa: F401
        import typer  # noqa: F401
    except ImportError:
        print(f"overlapper: the command line needs {hint('typer', 'rich')}", file=sys.stderr)
        sys.exit(2)
    from overlapper.cli.app import main
except KeyboardInterrupt:
    print("overlapper: interrupted", file=sys.stderr)
    sys.exit(130)

__all__ = ["main"]
