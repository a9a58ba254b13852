"""`python -m overlapper` is `overlapper`."""

from overlapper.cli import main

main()
