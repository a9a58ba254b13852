"""`overlapper.watch(client)` for a script or a notebook; `python -m overlapper.watch` is `overlapper watch`."""

from __future__ import annotations

import sys
from types import ModuleType
from typing import Any


class _Callable(ModuleType):
    """A module that can be called like the function of its name, because `python -m` needs a module of that name."""

    def __call__(self, *args: Any, **kwargs: Any) -> Any:
        from overlapper.scenes.watching import Watch

        return Watch(*args, **kwargs)


if __name__ == "__main__":
    from overlapper.cli import main

    sys.argv.insert(1, "watch")
    main()
else:
    watch = sys.modules[__name__]  # the object that the package returns for the name at first access
    watch.__class__ = _Callable
