#include <cassert>

#include "geometry/cancellation.h"
#include "python/arrays.h"
#include "shapes/planes_asked.h"

namespace {

/// Lets Python handle signals. False if a handler raised, as the handler of Ctrl-C does. Planes that a handler
/// evaluates do not count for the interrupted call.
bool no_handler_raised() {
  const auto asked = overlapper::planes_asked;
  const nanobind::gil_scoped_acquire acquire;
  const bool none = PyErr_CheckSignals() == 0;
  overlapper::planes_asked = asked;
  return none;
}

/// A cancelled call raises the exception of the handler.
void raise_again(const std::exception_ptr& exception, void*) {
  try {
    std::rethrow_exception(exception);
  } catch (const overlapper::Cancelled&) {
    assert(PyErr_Occurred());
  }
}

}  // namespace

NB_MODULE(_core, m) {
  // A test runner may keep tracebacks alive at exit, which is not a leak of this module.
  nanobind::set_leak_warnings(false);
  m.doc() = "Convex shapes and the polytopes they share.";
  overlapper::cancellation::still_wanted = &no_handler_raised;
  nanobind::register_exception_translator(&raise_again);
  overlapper::python::define_shapes(m);
  overlapper::python::define_overlaps(m);
  overlapper::python::define_batch(m);
  overlapper::python::define_poses(m);
  overlapper::python::define_shape_arrays(m);
  overlapper::python::define_forces(m);
  overlapper::python::define_function(m);
  overlapper::python::define_motion(m);
}
