"""Makes the pictures of README and docs again if one of their sources has changed.

python docs/pictures.py [--all | --check]

Beside each picture, docs/pictures.csv has a digest of it, and one of all that it was made from.
"""

from __future__ import annotations

import argparse
import csv
import hashlib
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
TABLE = ROOT / "docs" / "pictures.csv"
PAGE = ("overlapper/viewer/**/*", "docs/photograph.py")  # what a picture of a page is made by


class Maker(NamedTuple):
    """A command, the pictures in docs/ that it makes, and what they are made from, beside its script if it is one."""

    command: str
    pictures: tuple[str, ...]
    sources: tuple[str, ...] = ()


def of_results(command: str, results: str, *pictures: str, by: tuple[str, ...]) -> Maker:
    """Drawn from what was measured; what measures it is no source of the picture."""
    drawn_by = [f"benchmarks/{script}.py" for script in ("harness/charts", *by)]
    return Maker(f"benchmarks {command} --page", pictures, (f"benchmarks/results/{results}", *drawn_by))


MAKERS = (
    Maker("docs/picture.py", ("picture.webp",), (*PAGE, "scenes/franka_grasp.py")),
    Maker("docs/why.py", ("why.png",), ("overlapper/viewer/*.py",)),
    Maker("docs/view.py", ("view.png",), (*PAGE, "scenes/franka_grasp.py")),
    Maker("docs/grip.py", ("grip.png",), (*PAGE, "scenes/franka_grasp.py")),
    Maker("docs/tactile.py", ("tactile.png",), ("examples/tactile_image.py",)),
    Maker(
        "docs/gradients.py",
        ("gradients.png",),
        tuple(f"examples/{name}.py" for name in ("fit_boxes", "pack_a_bin", "gentle_grip")),
    ),
    Maker("docs/concave.py", ("concave.png",), (*PAGE, "examples/chain_links.py")),
    Maker("docs/regression.py", ("regression.png",), (*PAGE, "examples/ci/**/*")),
    Maker("docs/meshes.py", ("meshes.png",), PAGE),
    Maker("docs/extraction.py", ("extraction.png",), ("overlapper/viewer/tessellation.py",)),
    Maker("docs/how.py", ("how.png", "how_frame.png", "how_lenses.png", "how_slices.png", "how_ways.png")),
    Maker("docs/polytopes.py", ("polytopes.png",), ("overlapper/viewer/*.py",)),
    Maker("docs/results.py", ("results.png",), ("scenes/franka_grasp.py",)),
    of_results(
        "physics",
        "forces.csv",
        *("forces_energy.png", "forces_friction.png"),
        by=("forces/page",),
    ),
    of_results("engines", "*/engines.csv", "engines.png", by=("forces/engines_page",)),
    of_results("round", "*/round.csv", "round.png", by=("speed/round_page",)),
    of_results("steps", "*/steps.csv", "steps.png", by=("speed/steps_page",)),
    of_results(
        "chart",
        "*/[gs][rp][oe]*.csv",
        *("speed.png", "speed_sizes.png", "speed_families.png"),
        by=("speed/page", "harness/peers"),
    ),
    of_results(
        "stability",
        "stability.csv",
        *("stability.png", "stability_degeneracy.png", "stability_distances.png"),
        "stability_distances_degeneracy.png",
        by=("stability/page",),
    ),
)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    which = parser.add_mutually_exclusive_group()
    which.add_argument("--all", action="store_true", help="also those of which nothing has changed")
    which.add_argument("--check", action="store_true", help="make none; say which are not as they would be made")
    asked = parser.parse_args()
    if asked.check:
        complaints = list(check())
        print("\n".join(complaints) or "All pictures are as they would be made.")
        sys.exit(bool(complaints))
    known = read()
    for maker in MAKERS:
        if asked.all or any(known.get(each) != digests(maker, each) for each in maker.pictures):
            print(f"python {maker.command}", flush=True)
            subprocess.run([sys.executable, *maker.command.split()], cwd=ROOT, check=True)
            known |= {each: digests(maker, each) for each in maker.pictures}
            write(known)


def check() -> Iterator[str]:
    """A sentence for every picture that is missing, changed or older than its sources."""
    known = read()
    for maker in MAKERS:
        for picture in maker.pictures:
            made, sources = digests(maker, picture)
            if picture not in known:
                yield f"docs/{picture} was never made: make pictures"
            elif known[picture][1] != sources:
                yield f"docs/{picture} is older than what it is made from: make pictures"
            elif known[picture][0] != made:
                yield f"docs/{picture} is not what {maker.command} made: make pictures"


def digests(maker: Maker, picture: str) -> tuple[str, str]:
    """The digest of the picture (empty if the file is missing) and the digest of its sources."""
    path = ROOT / "docs" / picture
    made = hashlib.sha256(path.read_bytes()).hexdigest() if path.is_file() else ""
    return made, _digest(sorted(_sources(maker)))


def _sources(maker: Maker) -> Iterator[Path]:
    script = maker.command.split()[0]
    for pattern in (*[script] * script.endswith(".py"), *maker.sources):
        found = [path for path in ROOT.glob(pattern) if path.is_file() and "__pycache__" not in path.parts]
        if not found:
            raise FileNotFoundError(f"{maker.command} is said to be made from {pattern}, which is not there")
        yield from found


def _digest(paths: list[Path]) -> str:
    """The digest of the names and texts of files. Line ends are read as LF, as in the repository."""
    digest = hashlib.sha256()
    for path in paths:
        text = path.read_bytes().replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(ROOT).as_posix()} {len(text)}\n".encode())
        digest.update(text)
    return digest.hexdigest()


def read() -> dict[str, tuple[str, str]]:
    """By picture: its digest, and that of what it was made from."""
    if not TABLE.is_file():
        return {}
    with TABLE.open(encoding="utf-8", newline="") as file:
        return {row["picture"]: (row["sha256"], row["made_from"]) for row in csv.DictReader(file)}


def write(known: dict[str, tuple[str, str]]) -> None:
    current = [picture for maker in MAKERS for picture in maker.pictures if picture in known]
    with TABLE.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerows([("picture", "sha256", "made_from"), *((each, *known[each]) for each in current)])


if __name__ == "__main__":
    main()
