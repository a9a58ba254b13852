"""Meshes with changed bytes or false counts are read or refused quickly, in one sentence."""

import contextlib
import io
import json
import os
import re
import struct
import time
import zipfile
from datetime import timedelta

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from mutation import mutated, said_by

from overlapper import Hull, read_hull
from overlapper.jobs.confined import Confined
from overlapper.polytopes import mesh_file, mesh_parser
from overlapper.polytopes.mesh_file import read_parts

CORNERS = np.random.default_rng(0).normal(size=(12, 3))
FORMATS = ("stl", "stl_ascii", "ply", "ply_ascii", "obj", "off", "glb")


@pytest.fixture(scope="module")
def written():
    """The bytes of a hull in each format."""
    hull = Hull(CORNERS)
    mesh = trimesh.Trimesh(hull.vertices, [ring.tolist()[:3] for ring in hull.facets], process=False)
    texts = {name: mesh.export(file_type=name) for name in FORMATS if name != "ply_ascii"}
    with contextlib.suppress(ImportError):  # without networkx
        texts["3mf"] = mesh.export(file_type="3mf")
    texts["ply_ascii"] = mesh.export(file_type="ply", encoding="ascii")
    return {name: text.encode() if isinstance(text, str) else text for name, text in texts.items()}


def refusal(path):
    """The reason for which a mesh is refused."""
    with pytest.raises(ValueError, match="is not a mesh with a hull: ") as refused:
        read_hull(path)
    said = str(refused.value)
    assert said.startswith(str(path)) and "\n" not in said
    return said.partition("hull: ")[2]


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.filterwarnings("ignore::overlapper.polytopes.mesh_file.NotConvexWarning")
@given(data=st.data())
@settings(max_examples=150, deadline=timedelta(seconds=20))
def test_a_mutated_mesh_is_read_or_refused_in_one_sentence(written, tmp_path_factory, name, data):
    path = tmp_path_factory.getbasetemp() / f"mutated.{name.partition('_')[0]}"
    path.write_bytes(mutated(data, written[name]))
    said = said_by(lambda: read_hull(path))
    assert said == "" or (said.startswith(f"{path} is not a mesh with a hull: ") and "\n" not in said)


@pytest.mark.parametrize("name", ["glb", "3mf", "stl"])
@given(data=st.data())
@settings(max_examples=100, deadline=timedelta(seconds=20))
def test_mutated_bodies_are_read_or_refused_in_one_sentence(written, tmp_path_factory, name, data):
    pytest.importorskip("networkx")
    path = tmp_path_factory.getbasetemp() / f"mutated_bodies.{name}"
    if name == "3mf":  # its text, as hardly any package is one when a byte of it is another
        text = zipfile.ZipFile(io.BytesIO(written[name])).read("3D/3dmodel.model")
        with zipfile.ZipFile(path, "w") as packed:
            packed.writestr("3D/3dmodel.model", mutated(data, text))
    else:
        path.write_bytes(mutated(data, written[name]))
    said = said_by(lambda: read_parts(path))
    assert said == "" or (said.startswith(f"{path} is not a mesh that can be read: ") and "\n" not in said)


@pytest.mark.parametrize("name", FORMATS)
def test_a_mesh_that_nobody_changed_is_read(written, tmp_path, name):
    path = tmp_path / f"whole.{name.partition('_')[0]}"
    path.write_bytes(written[name])
    assert read_hull(path).volume == pytest.approx(Hull(CORNERS).volume, rel=1e-5)


def test_a_count_of_triangles_that_are_not_there_is_refused(written, tmp_path):
    path = tmp_path / "x.stl"
    path.write_bytes(written["stl"][:80] + struct.pack("<I", 2**32 - 1) + written["stl"][84:])
    count = (len(written["stl"]) - 84) // 50
    assert refusal(path) == f"it states 4,294,967,295 triangles, but has room for {count}"


@pytest.mark.parametrize("heading", ["format binary_little_endian 1.0", "format ascii 1.0"])
def test_counts_of_ply_that_are_not_there_are_refused(tmp_path, heading):
    path = tmp_path / "x.ply"
    axes = "".join(f"property float {axis}\n" for axis in "xyz")
    faces = "element face 4000000000\nproperty list uchar int vertex_indices\nend_header\n"
    path.write_text(f"ply\n{heading}\nelement vertex 4000000000\n{axes}{faces}" + "0 0 0\n" * 9)
    assert refusal(path)


def test_counts_of_off_and_indices_of_obj_that_are_not_there_are_refused(tmp_path):
    (tmp_path / "x.off").write_text("OFF\n4000000000 4000000000 0\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n")
    (tmp_path / "x.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 2 2000000000\nf 1 2 3\n")
    assert refusal(tmp_path / "x.off") and refusal(tmp_path / "x.obj")


PIPES = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="Windows has no named pipes")
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"


@PIPES
def test_a_pipe_is_refused_as_a_mesh_and_as_a_file_that_a_mesh_needs(tmp_path):
    for name in ("pipe.obj", "pipe"):
        os.mkfifo(tmp_path / name)
    assert refusal(tmp_path / "pipe.obj") == "it is a pipe or a device, not a file"
    with pytest.raises(ValueError, match=r"is not a mesh that can be read: it is a pipe or a device, not a file$"):
        read_parts(tmp_path / "pipe.obj")
    (tmp_path / "x.gltf").write_text(json.dumps(scene(uri="pipe")))
    assert refusal(tmp_path / "x.gltf") == "it needs the file 'pipe' in the same folder, which does not exist"
    (tmp_path / "x.obj").write_text("mtllib pipe\nusemtl a\n" + TETRAHEDRON)
    assert read_hull(tmp_path / "x.obj").volume == pytest.approx(1 / 6)


def test_a_folder_and_a_file_that_is_not_there_are_errors_of_the_system(tmp_path):
    with pytest.raises(IsADirectoryError):
        read_hull(tmp_path)
    with pytest.raises(FileNotFoundError):
        read_parts(tmp_path / "none.step")


@PIPES
def test_a_texture_is_not_opened(tmp_path, capfd):
    head = "ply\nformat ascii 1.0\ncomment TextureFile /dev/zero\nelement vertex 4\n"
    head += "".join(f"property float {axis}\n" for axis in "xyzst")
    faces = "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
    corners = "0 0 0 0 0\n1 0 0 0 0\n0 1 0 0 0\n0 0 1 0 0\n"
    (tmp_path / "x.ply").write_text(f"{head}{faces}{corners}3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n")
    assert read_hull(tmp_path / "x.ply").volume == pytest.approx(1 / 6)
    os.mkfifo(tmp_path / "picture.png")
    picture = {"images": [{"uri": "picture.png"}], "textures": [{"source": 0}]}
    material = {"materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]}
    whole = scene(3) | picture | material
    whole["meshes"][0]["primitives"][0]["material"] = 0
    (tmp_path / "x.gltf").write_text(json.dumps(whole))
    assert "picture" not in refusal(tmp_path / "x.gltf")  # its corners are nowhere
    assert capfd.readouterr().err == ""


def test_an_obj_of_many_materials_is_one_mesh_and_read_as_fast_as_without(tmp_path):
    faces = "f 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n" * 500
    (tmp_path / "x.obj").write_text(
        TETRAHEDRON + "".join(f"usemtl m{k}\n{f}\n" for k, f in enumerate(faces.split("\n")))
    )
    (tmp_path / "y.obj").write_text(TETRAHEDRON + faces)
    (dear,), (plain,) = read_parts(tmp_path / "x.obj"), read_parts(tmp_path / "y.obj")
    assert np.array_equal(dear.triangles, plain.triangles)
    start = time.process_time()
    mesh_parser.parts(tmp_path / "x.obj", "m")
    assert time.process_time() - start < 1.0  # a mesh for each material took 4 s


def test_few_materials_leave_the_order_of_triangles_as_trimesh_has_it(tmp_path):
    (tmp_path / "x.obj").write_text(TETRAHEDRON.replace("f 2", "usemtl b\nf 2").replace("f 1 3", "usemtl a\nf 1 3"))
    (part,) = read_parts(tmp_path / "x.obj")
    assert part.triangles[0].tolist() == [[1, 0, 0], [0, 1, 0], [0, 0, 1]]


def test_meshes_share_a_process_which_ends_with_one_that_breaks_a_limit(tmp_path, monkeypatch):
    (tmp_path / "x.obj").write_text(TETRAHEDRON)
    read_hull(tmp_path / "x.obj")
    first = mesh_file.confined(os.getpid)
    read_parts(tmp_path / "x.obj")
    assert mesh_file.confined(os.getpid) == first != os.getpid()
    monkeypatch.setattr(mesh_file, "confined", Confined(0.0, 256))
    assert refusal(tmp_path / "x.obj") == "reading it took longer than 0 s"


def scene(count=4, nodes=1, **buffer):
    """A glTF scene of one mesh. Its buffer has four corners; its accessor claims `count` indices."""
    corners = {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"}
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": list(range(nodes))}],
        "nodes": [{"mesh": 0}] * nodes,
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "buffers": [{"byteLength": 48, **buffer}],
        "bufferViews": [{"buffer": 0, "byteLength": 48}],
        "accessors": [corners, {"componentType": 5125, "count": count, "type": "SCALAR"}],
    }


def test_a_scene_that_counts_numbers_that_are_nowhere_is_refused(tmp_path):
    text = json.dumps(scene(400_000_000)).encode()
    (tmp_path / "x.gltf").write_bytes(text)
    assert refusal(tmp_path / "x.gltf") == f"it states 400,000,000 numbers, but has {len(text)} bytes"
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<II", len(text), 0x4E4F534A) + text + struct.pack("<II", 48, 0x004E4942) + bytes(48)
    (tmp_path / "x.glb").write_bytes(struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks)
    assert refusal(tmp_path / "x.glb").startswith("it states 400,000,000 numbers, but has ")


def test_a_chunk_that_is_longer_than_its_file_is_refused(written, tmp_path):
    whole = bytearray(written["glb"])
    (first,) = struct.unpack_from("<I", whole, 12)
    room = len(whole) - 28 - first  # behind the two heads of the file, and those of two chunks
    struct.pack_into("<I", whole, 20 + first, 4_000_000_000)
    (tmp_path / "x.glb").write_bytes(whole)
    assert refusal(tmp_path / "x.glb") == f"it has a chunk of 4,000,000,000 bytes, but room for {room}"
    behind = struct.pack("<I4s", 4_000_000_000, b"BIN\0")  # behind the length that the file states
    (tmp_path / "x.glb").write_bytes(written["glb"] + behind)
    assert refusal(tmp_path / "x.glb") == "it has a chunk of 4,000,000,000 bytes, but room for 0"


def test_numbers_in_a_file_beside_the_scene_are_there(tmp_path):
    (tmp_path / "x.bin").write_bytes(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], np.float32).tobytes())
    (tmp_path / "x.gltf").write_text(json.dumps(scene(3, uri="x.bin")))
    with open(tmp_path / "x.bin", "ab") as file:
        file.write(bytes(5000))
    assert "it states" not in refusal(tmp_path / "x.gltf")  # three indices, which are all 0: no hull
    (tmp_path / "x.gltf").write_text(json.dumps(scene(4000, uri="x.bin")))
    assert "it states" not in refusal(tmp_path / "x.gltf")


def test_a_mesh_that_a_scene_shows_too_often_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(mesh_parser, "MOST_SHOWN", 1000)
    (tmp_path / "x.gltf").write_text(json.dumps(scene(nodes=126)))
    with pytest.raises(ValueError, match=r"^it has 1,008 vertices and indices, more than 1,000$"):
        mesh_parser.hull(tmp_path / "x.gltf")


def package(path, objects, build, **files):
    """A 3MF file of objects, and what of them is built."""
    with zipfile.ZipFile(path, "w") as packed:
        space = "http://schemas.microsoft.com/3dmanufacturing/core/2015/02"
        text = (
            f'<model unit="millimeter" xmlns="{space}"><resources>{objects}</resources><build>{build}</build></model>'
        )
        packed.writestr("3D/3dmodel.model", text)
        for name, content in files.items():
            packed.writestr(f"3D/{name}.model", content)


def test_a_package_that_shows_an_object_too_often_is_refused_soon(tmp_path):
    path = tmp_path / "x.3mf"
    nested = '<object id="0"><mesh><vertices><vertex x="0" y="0" z="0"/></vertices></mesh></object>'
    for k in range(1, 40):
        twice = f'<component objectid="{k - 1}"/>' * 2
        nested += f'<object id="{k}"><components>{twice}</components></object>'
    package(path, nested, '<item objectid="39"/>')
    assert re.fullmatch(r"it has [\d,]{15,} vertices and indices, more than 30,000,000", refusal(path))
    round_about = '<object id="1"><components><component objectid="1"/></components></object>'
    package(path, round_about, '<item objectid="1"/>')
    assert refusal(path) == "an object in it contains itself"
    elsewhere = '<component objectid="7" p:path="/3D/big.model" xmlns:p="p"/>' * 1000
    package(
        path, f'<object id="1"><components>{elsewhere}</components></object>', '<item objectid="1"/>', big=" " * 10**6
    )
    assert refusal(path).startswith("it has 125,")


def test_compressed_files_are_refused_or_limited_in_size(tmp_path):
    for name in ("x.zip", "x.tar.gz", "x.stl.bz2"):
        (tmp_path / name).write_bytes(b"")
        assert refusal(tmp_path / name) == "it is compressed: decompress it first"
    with zipfile.ZipFile(tmp_path / "x.3mf", "w", zipfile.ZIP_DEFLATED) as packed:
        packed.writestr("3D/3dmodel.model", bytes(10_000_000))
    assert refusal(tmp_path / "x.3mf") == "it decompresses to more than 100 times its size"
    (tmp_path / "y.3mf").write_bytes(b"no zip")
    assert refusal(tmp_path / "y.3mf") == "File is not a zip file"
