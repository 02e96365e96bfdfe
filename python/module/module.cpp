// SPDX-License-Identifier: Apache-2.0
// The module tangere._core: the classes of the libraries with arrays for arguments and results.
// The package around it is python/tangere.
#include "python/module/module.hpp"

#include "engine/base/error.hpp"
#include "kernels/table/isa.hpp"

NB_MODULE(_core, m) {
  namespace nb = nanobind;
  using namespace tangere::python;
  // Compiled functions of JAX and graphs of PyTorch may hold tapes until the process ends.
  nb::set_leak_warnings(false);
  m.doc() = "Batched differentiable tactile simulation on CPUs: the compiled part.";
  m.attr("__version__") = TANGERE_VERSION;
  m.attr("instruction_set") = tangere::kernels::active_isa_name();
  // A request that cannot be carried out is a ValueError, a failing file an OSError.
  nb::exception<tangere::InputError>(m, "InputError", PyExc_ValueError);
  nb::exception<tangere::IoError>(m, "IoError", PyExc_OSError);
  if (const char* const why = tangere::kernels::isa_error(); *why != '\0')
    throw nb::import_error(why);
  add_scenes(m);
  add_scene_schema(m);
  add_robots(m);
  add_batches(m);
  add_tasks(m);
  add_environments(m);
  add_episode_writer(m);
  add_tapes(m);
  add_scene_tapes(m);
  add_views(m);
  add_data_files(m);
}
