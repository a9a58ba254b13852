"""Records a hand that reaches into a cup as a page, reads the page, and takes pictures of it in Chromium."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from browser import CHROMIUM, Browser

from overlapper import Box, Placed, overlap
from overlapper.simulation.contacts import Contact
from overlapper.viewer import Recording

looks = pytest.mark.skipif(CHROMIUM is None, reason="Chromium is not to be had here, and the picture is taken with it")

GROUND, CUP, HAND = (0, -1, 0), (1, -1, 0), (2, 3, 0)
GREEN = (0.1, 0.8, 0.1, 1.0)


class GreenBodies:
    """Shapes in the world by (body, link, shape), all green."""

    def __init__(self, shapes: dict[tuple[int, int, int], Placed]) -> None:
        self.keys = sorted(shapes)
        self.placed = [shapes[key] for key in self.keys]
        self.names = {(0, -1): "ground", (1, -1): "cup", (2, 3): "arm/hand", (2, 4): "arm/finger"}
        self.labels = {0: "ground", 1: "cup", 2: "arm"}
        self.colors = dict.fromkeys(self.names, GREEN)

    def contacts(self) -> list[Contact]:
        pairs = [(i, j) for i in range(len(self.keys)) for j in range(i) if self.keys[i][0] != self.keys[j][0]]
        return [Contact(*self.keys[j], *self.keys[i], overlap(self.placed[j], self.placed[i])) for i, j in pairs]


@dataclass
class Scene:
    """Shapes by body, by body and link, or by body, link and shape; all green."""

    shapes: dict
    keys: list = field(init=False)

    def __post_init__(self):
        full = [key if isinstance(key, tuple) else (key,) for key in self.shapes]
        self.keys = [(*key, *(-1, 0)[len(key) - 1 :]) for key in full]

    @property
    def placed(self):
        return list(self.shapes.values())

    @property
    def names(self):
        links = {key[:2] for key in self.keys}
        count = Counter(body for body, _ in links)
        return {(body, link): f"body{body}" + f"/link{link}" * (count[body] > 1) for body, link in links}

    @property
    def labels(self):
        return {body: f"body{body}" for body, _, _ in self.keys}

    @property
    def colors(self):
        return dict.fromkeys(self.names, GREEN)

    def contacts(self):
        pairs = [(i, j) for i in range(len(self.keys)) for j in range(i) if self.keys[i][0] != self.keys[j][0]]
        return [Contact(*self.keys[j], *self.keys[i], overlap(self.placed[j], self.placed[i])) for i, j in pairs]


def hand_at(x: float) -> GreenBodies:
    """A hand that is a box of 20 cm and reaches into a cup that is another when x < 0.2."""
    return GreenBodies({CUP: Placed(Box([0.1, 0.1, 0.1])), HAND: Placed(Box([0.1, 0.1, 0.1]), (x, 0.06, 0.08))})


def recorded(frames: list[GreenBodies], path: Path) -> Path:
    recording = Recording()
    for i, bodies in enumerate(frames):
        recording.add(bodies, bodies.contacts(), time=2.0 + i)
    return recording.save(path)


def unpacked(page: Path, name: str) -> bytes:
    text = re.search(f'id="{name}">([^<]*)<', page.read_text(encoding="utf-8"))[1]
    return gzip.decompress(base64.b64decode(text))


def commands(page: Path) -> list[dict]:
    return json.loads(unpacked(page, "commands"))


def drawings(page: Path) -> dict[str, dict]:
    """A dict from each path of the scene tree to the object drawn there, in the object format of three.js."""
    return {each["path"]: each["object"] for each in commands(page) if each["type"] == "set_object"}


@dataclass
class Film:
    """The frames of a page, put together from its arrays."""

    heading: dict
    arrays: dict[str, np.ndarray]

    @classmethod
    def of(cls, page: Path) -> Film:
        data = unpacked(page, "film")
        length = int.from_bytes(data[:4], "little")
        heading, data = json.loads(data[4 : 4 + length]), data[4 + length :]
        arrays = {}
        for name, (kind, count) in heading["arrays"].items():
            dtype = np.dtype(kind.removesuffix("Array").lower())
            planes, data = data[: count * dtype.itemsize], data[count * dtype.itemsize :]
            shuffled = np.frombuffer(planes, np.uint8).reshape(dtype.itemsize, count)
            arrays[name] = np.ascontiguousarray(shuffled.T).view(dtype).ravel()
        return cls(heading, arrays)

    def poses(self, node: str) -> list[tuple[int, np.ndarray]]:
        """(frame, pose) wherever that of the node changes, about the scene's centre; zeros where it is not there."""
        number = self.heading["nodes"].index(node)
        poses = self.arrays["key_pose"].reshape(7, -1).T
        chosen = self.arrays["key_node"] == number
        return list(zip(self.arrays["key_frame"][chosen].tolist(), poses[chosen]))

    def sightings(self, frame: int) -> dict[tuple[str, str], tuple[int, np.ndarray]]:
        """The polytope, and volume, error, depth, area, centroid about the scene's centre, normal, by pair."""
        start = self.arrays["sighting_start"]
        numbers = self.arrays["numbers"].reshape(10, -1).T
        return {
            tuple(self.heading["pairs"][self.arrays["sighting_pair"][k]]): (
                int(self.arrays["sighting_polytope"][k]),
                numbers[k],
            )
            for k in range(start[frame], start[frame + 1])
        }

    def polytopes(self) -> list[tuple[np.ndarray, list[tuple[int, np.ndarray]]]]:
        """The vertices of each about the scene's centre, and its facets: owner and ring."""
        corners = np.split(self.arrays["vertices"].reshape(-1, 3), np.cumsum(self.arrays["polytope_vertices"])[:-1])
        rings = np.split(self.arrays["rings"], np.cumsum(self.arrays["ring_length"])[:-1])
        facets = list(zip(self.arrays["owners"].tolist(), rings))
        made, grids = [], []
        for k, (*middle, unit) in enumerate(self.arrays["polytope_frame"].reshape(4, -1).T):
            like = self.arrays["polytope_previous"][k]
            grids.append(corners[k] + (grids[like] if like >= 0 else 0))
            count = self.arrays["polytope_facets"][k]
            made.append((middle + unit / 32767 * grids[-1], facets[:count]))
            facets = facets[count:]
        return made


def enclosed_by_rings(vertices: np.ndarray, facets: list[tuple[int, np.ndarray]]) -> float:
    """Volume inside of facets that are counter-clockwise from outside."""
    fans = [vertices[[ring[0], ring[i], ring[i + 1]]] for _, ring in facets for i in range(1, len(ring) - 1)]
    return np.linalg.det(np.array(fans)).sum() / 6


def numbers(attribute: dict) -> np.ndarray:
    kind = {"Float32Array": np.float32, "Uint32Array": np.uint32}[attribute["type"]]
    return np.frombuffer(base64.b64decode(attribute["array"]), kind).reshape(-1, 3)


def meshes(drawing: dict) -> list[tuple[np.ndarray, np.ndarray, int]]:
    """Vertices, triangles and colour of what is lit in a drawing, as the bodies and overlaps are."""
    geometries = {each["uuid"]: each["data"] for each in drawing["geometries"]}
    materials = {each["uuid"]: each for each in drawing["materials"]}
    found, seen = [drawing["object"]], []
    while found:
        each = found.pop(0)
        found += each.get("children", [])
        if each["type"] == "Mesh" and materials[each["material"]]["type"] == "MeshPhongMaterial":
            data = geometries[each["geometry"]]
            corners = numbers(data["attributes"]["position"]).astype(float)
            seen.append((corners, numbers(data["index"]), materials[each["material"]]["color"]))
    return seen


def enclosed(surfaces: list[tuple[np.ndarray, np.ndarray, int]]) -> float:
    """Volume inside of triangles that are counter-clockwise from outside."""
    return sum(np.linalg.det(vertices[faces]).sum() / 6 for vertices, faces, _ in surfaces)


def coloured(image: np.ndarray, name: str) -> int:
    """How many pixels have a colour, in light or shade: the owners' orange and sky blue, the marks' pink, green."""
    red, green, blue = np.moveaxis(image, -1, 0)
    return int(
        {
            "orange": (red > 130) & (red > 1.3 * green) & (green > 3 * blue),
            "sky blue": (blue > 130) & (blue > 1.15 * green) & (green > 1.5 * red),
            "pink": (red > 200) & (red > 2 * green) & (blue > 1.5 * green),
            "green": (green > red + 20) & (green > blue + 20),
        }[name].sum()
    )


def opened(browser: Browser, page: Path, view: str = "#t=1") -> Browser:
    """The page with a frame shown as it was first, its panels and its legend folded away."""
    if browser.ask("location.href").partition("#")[0] == page.as_uri():
        browser.press("r")
        browser.ask("location.hash = '#'")
    else:
        browser.open(page.as_uri(), until="document.querySelector('#time output').textContent")
    panel(browser, None)
    browser.ask("document.querySelector('#legend').open = false")
    browser.ask(f"location.hash = {view!r}")
    time = float(re.search(r"t=([\d.]+)", view)[1])
    browser.wait(f"document.querySelector('#time output').textContent === '{time:.3f} s'")
    return browser


def panel(browser: Browser, name: str | None) -> None:
    """Unfold this panel of the page, and no other."""
    for each in ("overlaps", "bodies", "look"):
        if browser.ask(f"document.querySelector('#{each}').hidden") is (each == name):
            browser.ask(f"document.querySelector('#show-{each}').click()")


def scene(browser: Browser) -> np.ndarray:
    """The pixels (rows, columns, channels) between the heading, the panels and the time bar."""
    image = browser.picture()
    left, top, right, bottom = sides(browser, "#stage")
    return image[top + 1 : bottom - 50, left:right]  # above the legend


def sides(browser: Browser, selector: str) -> list[int]:
    """Left, top, right and bottom of an element, in pixels, once the page has settled."""
    browser.settle()
    box = f"document.querySelector({selector!r}).getBoundingClientRect()"
    return [round(browser.ask(f"{box}.{side}")) for side in ("left", "top", "right", "bottom")]


def click_in_scene(browser: Browser, column: float, row: float) -> None:
    """A click on a pixel of `scene`."""
    left, top, _, _ = sides(browser, "#stage")
    browser.click(left + column, top + 1 + row)
