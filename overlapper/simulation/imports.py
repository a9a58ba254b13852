"""Work that waits until a library is imported."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import find_spec
from types import ModuleType


def when_imported(library: str, then: Callable[[], object]) -> None:
    """Call `then` after the library is imported by any code, or now if it is imported already.

    A script may set variables that a library reads on import, such as MUJOCO_GL. So nothing imports it earlier.
    """
    if library in sys.modules:
        then()
    else:
        sys.meta_path.insert(0, _Finder(library, then))


class _Finder(MetaPathFinder):
    """Finds one library once, by the other finders. Its loader calls `then` at the end."""

    def __init__(self, library: str, then: Callable[[], object]) -> None:
        self._library, self._then = library, then

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        if fullname != self._library:
            return None
        sys.meta_path.remove(self)
        spec = find_spec(fullname)
        if spec and spec.loader:
            spec.loader = _Loader(spec.loader, self._then)
        return spec


class _Loader(Loader):
    def __init__(self, loader: Loader, then: Callable[[], object]) -> None:
        self._loader, self._then = loader, then

    def create_module(self, spec: ModuleSpec) -> ModuleType | None:
        return self._loader.create_module(spec)

    def exec_module(self, module: ModuleType) -> None:
        # The module gets its original loader back, so that it shows no trace of this loader.
        if module.__spec__:
            module.__spec__.loader = self._loader
        module.__loader__ = self._loader
        self._loader.exec_module(module)
        self._then()
