"""The tests of the cone are for a core that has it: the sanitized one."""

from overlapper import _core

collect_ignore = [] if hasattr(_core, "Cone") else ["test_cone_in_core.py"]
