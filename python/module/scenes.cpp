// SPDX-License-Identifier: Apache-2.0
// Scene and Model in Python.
#include <nanobind/stl/filesystem.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include "engine/model/model.hpp"
#include "engine/scene/field_form.hpp"
#include "engine/scene/scheme.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "io/files/nearest_name.hpp"
#include "io/files/part_file.hpp"
#include "io/scene/scene_reader.hpp"
#include "python/module/arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/varying_numbers.hpp"
#include "python/module/whole_number.hpp"

namespace tangere::python {
namespace {

using nb::literals::operator""_a;

/// What the reader overlooked must reach the user: each warning is a UserWarning of the frame that
/// calls, or one `depth` further out.
Scene told(SceneFile file, int depth = 1) {
  for (const std::string& warning : file.warnings)
    if (PyErr_WarnEx(PyExc_UserWarning, warning.c_str(), depth) < 0) throw nb::python_error();
  return std::move(file.scene);
}

std::vector<std::string> copied(std::span<const std::string> names) {
  return {names.begin(), names.end()};
}

void add_scene(nb::module_& m) {
  nb::class_<Scene>(m, "Scene", "A scene as its file describes it, in SI units.")
      .def(
          "__init__",
          [](Scene* self, const std::filesystem::path& path, bool allow_unknown) {
            new (self) Scene(told(read_scene(path, {allow_unknown})));
          },
          "path"_a, "allow_unknown"_a = false,
          "Reads a scene file. InputError: something in it is unknown, missing or impossible; the\n"
          "message has file and line. OSError: it cannot be read. `allow_unknown` turns unknown\n"
          "elements and attributes into warnings.")
      .def_static(
          "from_string",
          [](const std::string& text, const std::string& name, bool allow_unknown) {
            return told(parse_scene(text, name, {allow_unknown}));
          },
          "text"_a, "name"_a = "scene", "allow_unknown"_a = false,
          "Reads a scene from text. `name` stands for the file: messages have it, and what the\n"
          "scene names, such as meshes, is looked for beside it. Raises what Scene raises.")
      .def(
          "vary",
          [](const Scene& s, const nb::object& names) {
            std::vector<std::string> given;
            if (!nb::try_cast(names, given))
              throw InputError(
                  fmt::format("names {}; expected a list of names", nb::repr(names).c_str()));
            return with_varying(s, given);
          },
          "names"_a, nb::sig("def vary(self, names: collections.abc.Sequence[str]) -> Scene"),
          "A copy in which environments may have other values of the named numbers, such as\n"
          "'contact pad ball kn' or 'body ball density'. They have the scene's values until\n"
          "Batch.set_randomized() sets others; what <randomize> draws is drawn as before. `text`\n"
          "stays that of the file. InputError: a name is unknown. Model raises InputError for a\n"
          "number on which something depends that cannot follow it.")
      .def_prop_ro("varying", &varying_names,
                   "Names of the numbers that differ between environments: those that <randomize>\n"
                   "draws, then those of vary().")
      .def_ro("name", &Scene::name)
      .def_ro("path", &Scene::path, "The file that it was read from.")
      .def_ro("text", &Scene::text, "The file as read.")
      .def_ro("timestep", &Scene::timestep, "[s]")
      .def("__repr__", [](const Scene& s) { return fmt::format("Scene('{}')", s.path); });
}

void add_sensor(nb::module_& m) {
  nb::class_<CameraDescription>(m, "Camera", "A camera of a model.")
      .def_ro("name", &CameraDescription::name)
      .def_ro("body", &CameraDescription::body, "The body that carries it; '' in the world.")
      .def_ro("rows", &CameraDescription::rows, "Pixels from top to bottom.")
      .def_ro("cols", &CameraDescription::cols, "Pixels from left to right.")
      .def_ro("fov", &CameraDescription::fov, "Degrees from the upper edge to the lower one.")
      .def_ro("far", &CameraDescription::far, "Depth of the sky [m].")
      .def("__repr__", [](const CameraDescription& c) {
        return fmt::format("<Camera {}: {} x {} pixels>", c.name, c.rows, c.cols);
      });
  nb::class_<SensorInfo>(m, "Sensor", "A tactile sensor of a model.")
      .def_ro("name", &SensorInfo::name)
      .def_ro("body", &SensorInfo::body, "The body that carries it.")
      .def_ro("rows", &SensorInfo::rows, "Of a rectangular array; 0 for other layouts.")
      .def_ro("cols", &SensorInfo::cols)
      .def_ro("points", &SensorInfo::points)
      .def_ro("pressure_sign", &SensorInfo::pressure_sign,
              "1 where the third component is positive under pressure, else -1.")
      .def("__repr__", [](const SensorInfo& s) {
        return fmt::format("Sensor('{}', points={})", s.name, s.points);
      });
}

void add_model(nb::module_& m) {
  nb::class_<Model>(m, "Model", "A compiled scene. It never changes; any number of batches use it.")
      .def(
          nb::init<const Scene&>(), "scene"_a,
          "Compiles a scene. InputError: it refers to something that is not there, or cannot move.")
      .def_prop_ro("scene", &Model::scene)
      .def_prop_ro("nq", &Model::nq, "Coordinates; a quaternion counts 4.")
      .def_prop_ro("nv", &Model::nv, "Velocities.")
      .def_prop_ro("nu", &Model::nu, "Controls.")
      .def_prop_ro("nb", &Model::nb, "Bodies.")
      .def_prop_ro("timestep", &Model::timestep, "[s]")
      .def_prop_ro("integrator",
                   [](const Model& s) { return std::string(s.integrator().scheme().name); })
      .def_prop_ro("q_names", [](const Model& s) { return copied(s.q_names()); })
      .def_prop_ro("v_names", [](const Model& s) { return copied(s.v_names()); })
      .def_prop_ro("u_names", [](const Model& s) { return copied(s.u_names()); })
      .def_prop_ro("q_units", [](const Model& s) { return copied(s.q_units()); })
      .def_prop_ro("v_units", [](const Model& s) { return copied(s.v_units()); })
      .def_prop_ro("body_names", [](const Model& s) { return copied(s.body_names()); })
      .def_prop_ro("end_effector_names",
                   [](const Model& s) {
                     std::vector<std::string> names;
                     for (const EndEffectorInfo& e : s.end_effectors()) names.push_back(e.name);
                     return names;
                   })
      .def_prop_ro("transmission_names",
                   [](const Model& s) {
                     std::vector<std::string> names;
                     for (const TransmissionDescription& d : s.scene().transmissions)
                       names.push_back(d.joint);
                     return names;
                   })
      .def_prop_ro("sensors",
                   [](const Model& s) {
                     return std::vector<SensorInfo>(s.sensors().begin(), s.sensors().end());
                   })
      .def_prop_ro("cameras", [](const Model& s) { return s.scene().cameras; })
      .def_prop_ro(
          "readings",
          [](const Model& s) {
            std::vector<std::string> names = output_names(s.scene());
            if (!s.has_shear_state()) std::erase(names, "memory");
            if (s.scene().transmissions.empty()) std::erase(names, "transmissions");
            std::erase_if(names, [&](const std::string& name) {
              return find_body_output(s.scene(), name).has_value();
            });
            return names;
          },
          "Names of everything that can be read: q, v, …, pad, pad.pressure, pad.sum.")
      .def_prop_ro(
          "shear_state_arrays",
          [](const Model& s) {
            nb::dict contacts;
            for (const ShearSpringPlaces& c : shear_state_arrays(s).contacts) {
              std::span<double> numbers;
              auto array = new_array<double>({c.places.size(), 3}, numbers);
              for (std::size_t k = 0; k < c.places.size(); ++k)
                std::copy_n(c.places[k].begin(), 3, &numbers[3 * k]);
              contacts[c.name.c_str()] = array;
            }
            return contacts;
          },
          nb::for_getter(nb::sig("def shear_state_arrays(self) -> "
                                 "dict[str, numpy.typing.NDArray[numpy.float64]]")),
          "Points of every contact and sensor with ks, by name, in the order of "
          "Batch.shear_state:\n"
          "(n, 3) their places [m], in the axes of the moving frame that carries them. Points of\n"
          "a sensor have the order of its field, once for every body that it feels.")
      .def_prop_ro(
          "initial_q",
          [](const Model& s) { return array_of<double>({as_size(s.nq())}, s.initial_q()); },
          nb::rv_policy::automatic, "(nq) where the scene starts.")
      .def(
          "mass",
          [](const Model& s, const Whole<int>& index) {
            const int body = index.value("body");
            if (body < 0 || body >= s.nb())
              throw InputError(fmt::format("body {}; expected 0 to {}", body, s.nb() - 1));
            return s.mass(body);
          },
          "body"_a, "Of a body, by its index [kg].")
      .def("__repr__", [](const Model& s) {
        return fmt::format("Model('{}', nq={}, nv={}, nu={})", s.scene().name, s.nq(), s.nv(),
                           s.nu());
      });
}

/// For texts that Python writes; files are written whole or not at all.
void add_texts(nb::module_& m) {
  m.def(
      "parse_scene",
      [](const std::string& text, const std::string& name,
         const std::vector<std::pair<std::string, int>>& origins) {
        SceneReadOptions options;
        for (const auto& [file, line] : origins) options.origins.push_back({file, line});
        return told(parse_scene(text, name, options), 3);  // behind two functions of the package
      },
      "text"_a, "name"_a, "origins"_a,
      "Reads a scene from text that a program made. `origins`: for each line the file and the "
      "line\n"
      "from which it comes, which messages name.");
  m.def(
      "write_text", &write_text_atomically, "path"_a, "text"_a, "overwrite"_a,
      "Writes a file, whole or not at all. IoError: it cannot, or the file exists and `overwrite`\n"
      "is False.");
  m.def(
      "suggestion",
      [](const std::string& wrong, const std::vector<std::string>& names) {
        return suggestion(wrong, names);
      },
      "wrong"_a, "names"_a, "What messages add after a name that is not known: the nearest one.");
}

}  // namespace

void add_scenes(nb::module_& m) {
  add_scene(m);
  add_texts(m);
  add_sensor(m);
  add_model(m);
}

}  // namespace tangere::python
