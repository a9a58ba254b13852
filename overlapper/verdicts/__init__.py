"""Comparison of tables of the same scene: the recorded values, the allowed differences, and what has moved."""
