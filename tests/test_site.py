"""The reference has every public name with an example, and every member has a docstring."""

import ast
import inspect
import re
import runpy
from importlib import import_module
from pathlib import Path
from typing import get_args

import pytest

import overlapper
import overlapper.simulation
import overlapper.viewer
from overlapper import _core
from overlapper.proof import claims
from overlapper.scenes import pytest_plugin

DOCS = Path(__file__).parents[1] / "docs"
PAGES = {page.stem: page.read_text(encoding="utf-8") for page in sorted((DOCS / "reference").glob("*.md"))}
ENTRY = re.compile(r"^\.\. (?:auto|py:)\w+:: ([\w.]+)", re.MULTILINE)
ENTRIES = {name for page in PAGES.values() for name in ENTRY.findall(page)}
CLASSES = re.findall(r"^\.\. autoclass:: ([\w.]+)", "\n".join(PAGES.values()), re.MULTILINE)


def offered(package):
    """The names in `__all__` and the names imported lazily, which stand under TYPE_CHECKING."""
    tree = ast.parse(Path(package.__file__).read_text(encoding="utf-8"))
    lazy = [line for node in tree.body if isinstance(node, ast.If) for line in node.body]
    names = {alias.name for line in lazy if isinstance(line, ast.ImportFrom) for alias in line.names}
    assert names
    return (names | set(package.__all__)) - {"Watch", "__version__"}  # `Watch` is offered as `watch`


@pytest.mark.parametrize("package", [overlapper, overlapper.simulation, overlapper.viewer], ids=lambda p: p.__name__)
def test_every_public_name_has_an_entry(package):
    missing = {name for name in offered(package) if f"{package.__name__}.{name}" not in ENTRIES}
    # The one table is described where it is at home.
    assert missing <= ({"Log"} if package is overlapper.simulation else set())


def test_every_certificate_has_an_entry():
    assert {f"overlapper.proof.claims.{kind.__name__}" for kind in get_args(claims.Certificate)} <= ENTRIES


def test_every_option_of_pytest_has_an_entry():
    source = Path(pytest_plugin.__file__).read_text(encoding="utf-8")
    options = set(re.findall(r'"(--overlapper-\w+)"', source))
    assert options == set(re.findall(r"^\.\. option:: (--[\w-]+)", PAGES["scenes"], re.MULTILINE))


def test_signatures_say_shape_in_place_of_all_kinds_of_shapes():
    short = runpy.run_path(str(DOCS / "conf.py"))["process_signature"]
    told = str(inspect.signature(overlapper.distance)).replace("'", "")
    assert "Hull | " in told
    assert short(None, None, None, None, None, told, "Hull | Box") == (
        "(a: Shape | ArrayLike | trimesh.Trimesh | Placed, b: Shape | ArrayLike | trimesh.Trimesh | Placed) -> float",
        "Hull | Box",
    )


@pytest.mark.parametrize("page", PAGES)
def test_every_entry_is_used_in_an_example_of_its_page(page):
    """That these run is shown with those of all other pages."""
    code = "\n".join(re.findall(r"^```python\n(.*?)^```", PAGES[page], re.MULTILINE | re.DOTALL))
    names = [entry.rpartition(".")[2] for entry in ENTRY.findall(PAGES[page])]
    assert [name for name in names if not re.search(rf"\b{name}\b", code)] == ["Watch"] * (page == "scenes")


@pytest.mark.parametrize("name", CLASSES)
def test_every_member_has_a_docstring(name):
    """Its own, or, as a field or a constant, in those of its class or of another member."""
    module, _, name = name.rpartition(".")
    found = getattr(import_module(module), name)
    members = {member for member in {*dir(found), *getattr(found, "__annotations__", ())} if not member.startswith("_")}
    values = {member: inspect.getattr_static(found, member, None) for member in members}
    kinds = (property, classmethod, staticmethod, type(_core.overlap))  # the last are static methods of the core
    own = {
        member: value.__doc__ for member, value in values.items() if inspect.isroutine(value) or type(value) in kinds
    }
    assert [member for member, words in own.items() if not words] == []
    said = "\n".join([inspect.getdoc(found), *own.values()])
    assert [member for member in members - own.keys() if not re.search(rf"\b{member}\b", said)] == []
