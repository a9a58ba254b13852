"""STEP files of polyhedra, as text, since trimesh cannot write them."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import count

import numpy as np

HEAD = """ISO-10303-21;
HEADER;
FILE_DESCRIPTION((''),'2;1');
FILE_NAME('parts','2020-01-01T00:00:00',(''),(''),'','','');
FILE_SCHEMA(('AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }'));
ENDSEC;
DATA;
#1=APPLICATION_CONTEXT('core data for automotive mechanical design processes');
#2=APPLICATION_PROTOCOL_DEFINITION('international standard','automotive_design',2000,#1);
#3=PRODUCT_CONTEXT('',#1,'mechanical');
#4=PRODUCT_DEFINITION_CONTEXT('part definition',#1,'design');
#5=(LENGTH_UNIT() NAMED_UNIT(*) SI_UNIT(.MILLI.,.METRE.));
#6=(NAMED_UNIT(*) PLANE_ANGLE_UNIT() SI_UNIT($,.RADIAN.));
#7=(NAMED_UNIT(*) SI_UNIT($,.STERADIAN.) SOLID_ANGLE_UNIT());
#8=UNCERTAINTY_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.E-7),#5,'distance_accuracy_value','');
#9=(GEOMETRIC_REPRESENTATION_CONTEXT(3) GLOBAL_UNCERTAINTY_ASSIGNED_CONTEXT((#8))
GLOBAL_UNIT_ASSIGNED_CONTEXT((#5,#6,#7)) REPRESENTATION_CONTEXT('',''));
"""


def step_text(bodies: dict[str, tuple[np.ndarray, Sequence[Sequence[int]]]]) -> str:
    """A file of products by name, each a polyhedron of vertices (n, 3) in mm and rings of their indices."""
    lines: list[str] = []
    numbers = count(10)

    def add(text: str) -> str:
        number = f"#{next(numbers)}"
        lines.append(f"{number}={text};")
        return number

    def point(corner: np.ndarray) -> str:
        return add(f"CARTESIAN_POINT('',({','.join(f'{x:.9E}' for x in corner)}))")

    def direction(way: np.ndarray) -> str:
        return add(f"DIRECTION('',({','.join(f'{x:.9E}' for x in way / np.linalg.norm(way))}))")

    for name, (vertices, rings) in bodies.items():
        corners = [point(vertex) for vertex in vertices]
        faces = []
        for ring in rings:
            a, b, c = (vertices[i] for i in ring[:3])
            axes = add(
                f"AXIS2_PLACEMENT_3D('',{corners[ring[0]]},{direction(np.cross(b - a, c - a))},{direction(b - a)})"
            )
            loop = add(f"POLY_LOOP('',({','.join(corners[i] for i in ring)}))")
            bound = add(f"FACE_OUTER_BOUND('',{loop},.T.)")
            plane = add(f"PLANE('',{axes})")
            faces.append(add(f"FACE_SURFACE('',({bound}),{plane},.T.)"))
        shell = add(f"CLOSED_SHELL('',({','.join(faces)}))")
        brep = add(f"FACETED_BREP('{name}',{shell})")
        shape = add(f"FACETED_BREP_SHAPE_REPRESENTATION('{name}',({brep}),#9)")
        product = add(f"PRODUCT('{name}','{name}','',(#3))")
        formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
        definition = add(f"PRODUCT_DEFINITION('design','',{formation},#4)")
        defined = add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
        add(f"SHAPE_DEFINITION_REPRESENTATION({defined},{shape})")
    return HEAD + "\n".join(lines) + "\nENDSEC;\nEND-ISO-10303-21;\n"
