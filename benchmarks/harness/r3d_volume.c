#include <r3d.h>

/* The volume of a polytope that planes cut: n · x + d >= 0 stays. -1 if it has too many vertices for r3d's buffer. */
double r3d_volume(r3d_rvec3* vertices, int count, int* ring, int* sizes, int faces, r3d_plane* planes, int cuts) {
  static r3d_poly poly; /* 16 KB that need not be cleared */
  int* rings[R3D_MAX_VERTS];
  double volume = 0;
  if (count > R3D_MAX_VERTS || faces > R3D_MAX_VERTS) return -1;
  for (int f = 0; f < faces; ring += sizes[f++]) rings[f] = ring;
  if (!r3d_init_poly(&poly, vertices, count, rings, sizes, faces) || !r3d_clip(&poly, planes, cuts)) return -1;
  r3d_reduce(&poly, &volume, 0);
  return volume;
}
