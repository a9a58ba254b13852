"""The part for MuJoCo. Only this package asks mujoco."""

from overlapper.install import hint

try:
    import mujoco  # noqa: F401
except ModuleNotFoundError as error:
    raise ImportError(f"overlapper.mujoco needs {hint('mujoco')}") from error
