"""The costs of single features of the package, and the kills that sweeps survive."""
