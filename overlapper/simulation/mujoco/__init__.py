"""MuJoCo's own half: mujoco is asked here and nowhere else."""

from overlapper.install import hint

try:
    import mujoco  # noqa: F401
except ModuleNotFoundError as error:
    raise ImportError(f"overlapper.mujoco needs {hint('mujoco')}") from error
