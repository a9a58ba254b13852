"""Volumetric contact beside textbooks and beside Bullet's own contact."""
