"""Makes docs/polytopes.png: two random polytopes that have been in a database, and what they share.

python docs/polytopes.py
"""

import tempfile
from pathlib import Path

from overlapper import Placed, overlap, random_polytope, read_polytopes, write_polytopes
from overlapper.simulation.contacts import Contact
from overlapper.viewer import picture

HERE = Path(__file__).parent
GREY = (0.62, 0.66, 0.72, 1.0)


class Polytopes:
    """Bodies by the ids of their polytopes, where their points are."""

    def __init__(self, url: str) -> None:
        found = dict(read_polytopes(url))
        self.keys = [(int(id), -1, 0) for id in found]
        self.placed = [Placed(hull) for hull in found.values()]
        self.colors = {key[:2]: GREY for key in self.keys}
        self.names = {key[:2]: f"polytope {key[0]}" for key in self.keys}
        self.labels = {key[0]: f"polytope {key[0]}" for key in self.keys}


def main() -> None:
    with tempfile.TemporaryDirectory() as folder:
        url = f"sqlite:///{folder}/polytopes.db"
        write_polytopes(url, ((seed, random_polytope(14, rng=seed)) for seed in (3, 8)))
        bodies = Polytopes(url)
    contact = Contact(*bodies.keys[0], *bodies.keys[1], overlap(*bodies.placed))
    print(picture.save(HERE / "polytopes.png", bodies, [contact]))


if __name__ == "__main__":
    main()
