#include <cassert>

#include "geometry/cancellation.h"
#include "python/arrays.h"
#include "shapes/planes_asked.h"

namespace {

/// Lets Python handle signals: false if a handler raised, as that of Ctrl-C does. What a handler computes is not
/// counted to what was interrupted.
bool no_handler_raised() {
  const auto asked = overlapper::planes_asked;
  const nanobind::gil_scoped_acquire acquire;
  const bool none = PyErr_CheckSignals() == 0;
  overlapper::planes_asked = asked;
  return none;
}

/// What was cancelled raises what the handler raised.
void raise_again(const std::exception_ptr& exception, void*) {
  try {
    std::rethrow_exception(exception);
  } catch (const overlapper::Cancelled&) {
    assert(PyErr_Occurred());
  }
}

}  // namespace

NB_MODULE(_core, m) {
  // A test runner that keeps tracebacks alive at exit is not a leak of ours.
  nanobind::set_leak_warnings(false);
  m.doc() = "Convex shapes and the polytopes they share.";
  overlapper::cancellation::still_wanted = &no_handler_raised;
  nanobind::register_exception_translator(&raise_again);
  overlapper::python::define_shapes(m);
  overlapper::python::define_overlaps(m);
  overlapper::python::define_batch(m);
  overlapper::python::define_poses(m);
  overlapper::python::define_forces(m);
}
