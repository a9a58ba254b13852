"""Makes docs/why.png: three cubes, each as deep in a table, and how much they share with it.

python docs/why.py
"""

from pathlib import Path

import numpy as np

from overlapper import Box, Placed, overlap
from overlapper.simulation.contacts import Contact
from overlapper.viewer import picture

HERE = Path(__file__).parent
DEPTH = 0.005  # m
CUBE = Box([0.05, 0.05, 0.05])
ON_EDGE = np.array([0, np.sin(np.pi / 8), 0, np.cos(np.pi / 8)])
# About the line x = -y, until the space diagonal is upright.
TILT = np.arccos(1 / np.sqrt(3)) / 2
ON_CORNER = np.array([np.sin(TILT) / np.sqrt(2), -np.sin(TILT) / np.sqrt(2), 0, np.cos(TILT)])
CUBES = {
    "on its face": ([0, 0, 0, 1.0], 0.05),  # how it is turned, and how far its middle is above its lowest point, m
    "on an edge": (ON_EDGE, 0.05 * np.sqrt(2)),
    "on a corner": (ON_CORNER, 0.05 * np.sqrt(3)),
}


class Bodies:
    """The table, whose top is z = 0, and the cubes on it, side by side."""

    def __init__(self) -> None:
        self.placed = [Placed(Box([0.32, 0.12, 0.02]), (0, 0, -0.02))]
        for k, (turn, height) in enumerate(CUBES.values()):
            self.placed.append(Placed(CUBE, (0.2 * (k - 1), 0, height - DEPTH), turn))
        self.keys = [(k, -1, 0) for k in range(len(self.placed))]
        self.labels = dict(enumerate(["table", *(f"cube {how}" for how in CUBES)]))
        self.names = {(body, -1): label for body, label in self.labels.items()}
        self.colors = {key[:2]: (0.62, 0.66, 0.72, 1.0) for key in self.keys}


def main() -> None:
    bodies = Bodies()
    contacts = [
        Contact(*key, *bodies.keys[0], overlap(bodies.placed[key[0]], bodies.placed[0])) for key in bodies.keys[1:]
    ]
    for contact in contacts:
        print(f"{contact.overlap.depth:.6f} m deep, {1e6 * contact.overlap.volume:.4f} cm³")
    print(picture.save(HERE / "why.png", bodies, contacts))


if __name__ == "__main__":
    main()
