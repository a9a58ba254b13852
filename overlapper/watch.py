"""`overlapper.watch(client)` in a script or a notebook; `python -m overlapper.watch` is `overlapper watch`."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """A module that is called like what it is named after, as `python -m` wants a module of that name."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        from overlapper.scenes.watching import Watch

        return Watch(*args, **kwargs)


if __name__ == "__main__":
    from overlapper.cli import main

    sys.argv.insert(1, "watch")
    main()
else:
    watch = sys.modules[__name__]  # as whoever asks the package for it first gets it
    watch.__class__ = _Callable
