"""The part for Bullet. Only this package asks pybullet."""
