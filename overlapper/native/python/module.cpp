#include "python/arrays.h"

NB_MODULE(_core, m) {
  // A test runner that keeps tracebacks alive at exit is not a leak of ours.
  nanobind::set_leak_warnings(false);
  m.doc() = "Convex shapes and the polytopes they share.";
  overlapper::python::define_shapes(m);
  overlapper::python::define_overlaps(m);
  overlapper::python::define_batch(m);
  overlapper::python::define_poses(m);
}
