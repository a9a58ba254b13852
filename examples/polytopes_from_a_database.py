"""Random polytopes go into a database, come back one by one, and what they share becomes a mesh file."""

from pathlib import Path

from overlapper import overlap, random_polytope, read_polytopes, write_mesh, write_polytopes

# SQLite needs no server; "postgresql+psycopg://user@host/name" takes one.
URL = "sqlite:///polytopes.db"
Path("polytopes.db").unlink(missing_ok=True)  # ids that are taken would be refused

write_polytopes(URL, ((seed, random_polytope(30, "ball", rng=seed)) for seed in range(5)))

hulls = []
for id, hull in read_polytopes(URL):
    print(f"polytope {id}: {len(hull.vertices)} corners, {hull.volume:.3f} m³")
    hulls.append(hull)

common = overlap(*hulls)
print(f"all share  {common.volume:.6f} m³, wrong by {common.volume_error:.0e} m³ at most")

write_mesh("common.stl", common)
print("look at    common.stl")
