"""Two links of a chain, pulled taut: concave meshes as convex parts, whose overlaps with each other count once."""

import pybullet as p
import pybullet_data

from overlapper import Hull, Placed, overlap
from overlapper.simulation import Bodies, link_contacts
from overlapper.viewer import Recording

p.connect(p.DIRECT)
ring = f"{pybullet_data.getDataPath()}/torus/torus_textured.obj"
shape = p.createCollisionShape(p.GEOM_MESH, fileName=ring, flags=p.GEOM_FORCE_CONCAVE_TRIMESH, meshScale=[0.1] * 3)
p.createMultiBody(0, shape)
p.createMultiBody(1, shape, -1, [0.06, 0, 0], p.getQuaternionFromEuler([1.5707963, 0, 0]))
for body, color in enumerate(([0.9, 0.6, 0.3, 1], [0.3, 0.6, 0.9, 1])):
    p.changeVisualShape(body, -1, rgbaColor=color)

bodies = Bodies()  # CoACD needs seconds the first time; concave_threshold=0.01 is finer and slower
for mesh in bodies.decomposed:
    print(f"{mesh.name}: {len(mesh.shapes)} parts, {1e6 * mesh.volume:.1f} cm³, mesh {1e6 * mesh.mesh_volume:.1f} cm³")
contacts = bodies.overlaps()
(pair,) = link_contacts(contacts)
print(f"rings     {1e6 * pair.volume:.4f} cm³ ± {1e6 * pair.volume_error:.0e}, at {pair.centroid.round(4)} m")
print(f"by parts  {1e6 * sum(contact.overlap.volume for contact in contacts):.4f} cm³ in {len(contacts)} pairs")
hulls = [
    Placed(Hull([point for part in bodies.shapes[: len(bodies.shapes) // 2] for point in part.vertices]), *pose)
    for pose in (p.getBasePositionAndOrientation(body) for body in (0, 1))
]
print(f"hulls     {1e6 * overlap(*hulls).volume:.1f} cm³")

recording = Recording()
recording.add(bodies, contacts, 0.0)
print(recording.save("chain_links.html"))
