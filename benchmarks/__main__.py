"""All benchmarks: `python benchmarks NAME [OPTIONS]`, and `python benchmarks --help` lists the names."""

import sys
from pathlib import Path

sys.path.append(str(Path(__file__).resolve().parents[1] / "tests" / "support"))

from harness.command import main

if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
