"""Bullet's own half: pybullet is asked here and nowhere else."""
