"""Hypothesis draws the same examples on every run; `--hypothesis-profile=explore` looks further, with new ones."""

from hypothesis import HealthCheck, settings

settings.register_profile("same", deadline=None, derandomize=True, database=None, max_examples=40)
settings.register_profile("explore", deadline=None, max_examples=2000, suppress_health_check=[HealthCheck.too_slow])
settings.load_profile("same")
