// SPDX-License-Identifier: Apache-2.0
// Batch in Python. Blocks of 16 environments are spread over threads, and the GIL is free while
// they are stepped or read.
#include "python/module/batches.hpp"

#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <variant>

#include <cmath>

#include "engine/step/control.hpp"
#include "kernels/numbers/block.hpp"
#include "python/module/batch_arrays.hpp"
#include "python/module/module.hpp"
#include "python/module/options.hpp"
#include "tasks/run/block_reader.hpp"
#include "tasks/run/episode_program.hpp"

namespace tangere::python {

using nb::literals::operator""_a;

PythonBatch::PythonBatch(const Model& model, int environments, const BatchOptions& options)
    : batch_(model, environments, options.seed, options.first_episode),
      shear_arrays_(shear_state_arrays(model)),
      precision_(options.precision),
      counts_(as_size(environments)),
      threads_(options.threads) {
  for (int i = 0; i < options.threads; ++i)
    workers_.push_back({Stepper(model, options.stepper), Readout(model, options.precision)});
}

void PythonBatch::step(const Argument<double>& u) {
  const std::vector<double> controls = rows_of(u, count(), as_size(model().nu()), "controls");
  const InUse::Turn turn(in_use_);
  const nb::gil_scoped_release free;
  threads_.for_each(batch_.blocks(), workers_,
                    [&](Worker& worker, int block) { take_step(worker, block, controls); });
}

/// Takes one step of a block, (E, nu) controls, and counts it for those that found a solution.
void PythonBatch::take_step(Worker& worker, int block, std::span<const double> u) {
  worker.stepper.step_block(batch_, block, u);
  const int first = block * kernels::kBlock;
  for (int e = first; e < std::min(first + kernels::kBlock, environments()); ++e)
    if (!batch_.held(e) && !failed(batch_.status(e))) counts_[as_size(e)].count(batch_, e);
}

FieldOutput PythonBatch::reading_named(const std::string& name) const {
  if (const auto output = find_output(model().scene(), name)) {
    const std::string reason = reason_against(model().scene(), *output);
    if (!reason.empty()) throw InputError(fmt::format("reading '{}': {}", name, reason));
    return *output;
  }
  std::vector<std::string> names;
  for (const std::string& n : output_names(model().scene()))
    if (!is_plain_output(n) && !find_body_output(model().scene(), n)) names.push_back(n);
  throw InputError(fmt::format("no reading is named '{}'; expected one of: {}", name,
                               names.empty()
                                   ? "nothing, because the scene has neither sensor nor camera"
                                   : fmt::format("{}", fmt::join(names, ", "))));
}

Shape PythonBatch::shape_of_reading(FieldOutput output) const {
  Shape shape = reading_shape(model(), output);
  if (output.form == FieldForm::pressure) shape.pop_back();
  return shape;
}

template <class T>
nb::object PythonBatch::read(FieldOutput output, const nb::object& out) {
  Shape shape = shape_of_reading(output);
  shape.insert(shape.begin(), count());
  std::span<T> numbers;
  nb::object result = out;
  if (out.is_none()) {
    result = nb::cast(new_array<T>(shape, numbers));
  } else {
    nb::ndarray<T, nb::c_contig, nb::device::cpu> given;
    if (!nb::try_cast(out, given, false))
      throw InputError(
          fmt::format("out is no writable contiguous array of {}", sizeof(T) == 1   ? "uint8"
                                                                   : sizeof(T) == 2 ? "int16"
                                                                   : sizeof(T) == 4 ? "float32"
                                                                                    : "float64"));
    const Shape found(given.shape_ptr(), given.shape_ptr() + given.ndim());
    if (found != shape)
      throw InputError(fmt::format("out of shape ({}); expected ({})", fmt::join(found, ", "),
                                   fmt::join(shape, ", ")));
    numbers = {given.data(), given.size()};
  }
  const std::size_t width = numbers.size() / count();
  const InUse::Turn turn(in_use_);
  const nb::gil_scoped_release free;
  threads_.for_each(batch_.blocks(), workers_, [&](Worker& worker, int block) {
    read_field<T>(worker.readout, batch_, block, output,
                  [&](int e) { return numbers.subspan(as_size(e) * width, width); });
  });
  return result;
}

nb::object PythonBatch::tactile(const std::string& reading, const nb::object& out) {
  const FieldOutput output = reading_named(reading);
  if (is_colour(output.form)) return read<std::uint8_t>(output, out);
  if (output.form == FieldForm::view_ids) return read<std::int16_t>(output, out);
  if (is_picture(output.form)) return read<float>(output, out);
  return precision_ == Precision::f64 ? read<double>(output, out) : read<float>(output, out);
}

Run PythonBatch::run(const Argument<double>& u, const Whole<int>& interval,
                     const std::vector<std::string>& readings, const nb::object& environments) {
  const std::vector<int> moving = listed(environments);
  if (u.ndim() == 0 || u.shape(0) == 0)
    throw InputError("controls without a step; expected (T, E, nu)");
  const std::size_t steps = u.shape(0), nu = as_size(model().nu());
  const int every = interval.value("every");
  if (every < 1 || steps % as_size(every) != 0)
    throw InputError(
        fmt::format("{} steps with a frame every {}; expected a multiple of it", steps, every));
  const auto controls = numbers_of(u, {steps, count(), nu}, "controls");
  return precision_ == Precision::f64
             ? run_as<double>(controls, steps, as_size(every), readings, moving)
             : run_as<float>(controls, steps, as_size(every), readings, moving);
}

/// Holds all environments but those listed, until it goes out of scope.
struct PythonBatch::Waiting {
  Waiting(Batch& batch, const std::vector<int>& moving) : batch_(batch) {
    for (int e = 0; e < batch.environments(); ++e) batch.hold(e);
    for (const int e : moving) batch.hold(e, false);
  }
  Waiting(const Waiting&) = delete;
  Waiting& operator=(const Waiting&) = delete;
  ~Waiting() {
    for (int e = 0; e < batch_.environments(); ++e) batch_.hold(e, false);
  }

 private:
  Batch& batch_;
};

template <class T>
Run PythonBatch::run_as(std::span<const double> u, std::size_t steps, std::size_t every,
                        const std::vector<std::string>& readings, const std::vector<int>& moving) {
  struct Requested {
    FieldOutput output;
    std::size_t width = 0;
    std::variant<std::span<T>, std::span<std::uint8_t>, std::span<std::int16_t>> numbers{};
  };
  const std::size_t frames = steps / every, nq = as_size(model().nq()), nv = as_size(model().nv()),
                    nu = as_size(model().nu());
  Run run{model(), double(every) * workers_[0].stepper.timestep(), randomized(), {}, {}, {}, {}};
  std::span<double> q, v;
  run.q = new_array<double>({frames, count(), nq}, q);
  run.v = new_array<double>({frames, count(), nv}, v);
  std::span<std::int8_t> status;
  run.status = new_array<std::int8_t>({count()}, status);
  std::vector<StepStatus> statuses(count());
  std::vector<Requested> requested;
  for (const std::string& name : readings) {
    if (run.readings.contains(name))
      throw InputError(fmt::format("reading '{}' is listed twice; expected each once", name));
    Requested& one = requested.emplace_back(Requested{reading_named(name)});
    Shape shape = shape_of_reading(one.output);
    shape.insert(shape.begin(), {frames, count()});
    if (is_colour(one.output.form)) one.numbers = std::span<std::uint8_t>();
    if (one.output.form == FieldForm::view_ids) one.numbers = std::span<std::int16_t>();
    std::visit(
        [&]<class Number>(std::span<Number>& numbers) {
          run.readings[name] = nb::cast(new_array<Number>(shape, numbers));
          one.width = numbers.size() / (frames * count());
        },
        one.numbers);
  }
  const auto row = [&](auto numbers, std::size_t frame, int e, std::size_t width) {
    return numbers.subspan((frame * count() + as_size(e)) * width, width);
  };
  {
    const InUse::Turn turn(in_use_);
    const nb::gil_scoped_release free;
    const Waiting others(batch_, moving);
    threads_.for_each(batch_.blocks(), workers_, [&](Worker& worker, int block) {
      for (std::size_t t = 0; t < steps; ++t) {
        take_step(worker, block, u.subspan(t * count() * nu, count() * nu));
        if ((t + 1) % every != 0) continue;
        const std::size_t frame = t / every;
        read_states(
            batch_, block, [&](int e) { return row(q, frame, e, nq); },
            [&](int e) { return row(v, frame, e, nv); });
        for (const Requested& a : requested)
          std::visit(
              [&]<class Number>(std::span<Number> numbers) {
                read_field<Number>(worker.readout, batch_, block, a.output,
                                   [&](int e) { return row(numbers, frame, e, a.width); });
              },
              a.numbers);
      }
    });
    std::copy(batch_.statuses().begin(), batch_.statuses().end(), statuses.begin());
  }
  std::transform(statuses.begin(), statuses.end(), status.begin(),
                 [](StepStatus s) { return static_cast<std::int8_t>(s); });
  return run;
}

/// A row of `width` numbers for each environment, filled by `get`.
Array<double> PythonBatch::coordinates(int width, GetCoordinates get) {
  const InUse::Turn turn(in_use_);
  std::span<double> numbers;
  auto array = new_array<double>({count(), as_size(width)}, numbers);
  for (int e = 0; e < environments(); ++e)
    (batch_.*get)(e, numbers.subspan(as_size(e) * as_size(width), as_size(width)));
  return array;
}

Array<double> PythonBatch::q() { return coordinates(model().nq(), &Batch::get_q); }
Array<double> PythonBatch::v() { return coordinates(model().nv(), &Batch::get_v); }

/// Without a turn: the addresses never change.
View PythonBatch::view(nb::handle owner, GetLanes get) const {
  constexpr std::size_t kLanes = kernels::kBlock;
  const std::span<const double> first = (batch_.*get)(0);
  const std::ptrdiff_t next =
      batch_.blocks() > 1 ? (batch_.*get)(1).data() - first.data() : std::ssize(first);
  return View(first.data(), {as_size(batch_.blocks()), kLanes, first.size() / kLanes}, owner,
              {next, 1, std::ptrdiff_t{kLanes}});
}

Array<double> PythonBatch::end_effectors() {
  const InUse::Turn turn(in_use_);
  const std::size_t n = model().end_effectors().size();
  std::span<double> numbers;
  auto array = new_array<double>({count(), n, 3}, numbers);
  for (int e = 0; e < environments() && n > 0; ++e)
    workers_[0].readout.end_effectors(batch_, e, numbers.subspan(as_size(e) * 3 * n, 3 * n));
  return array;
}

Array<double> PythonBatch::transmission_forces(const Argument<double>& u) {
  const auto controls = rows_of(u, count(), as_size(model().nu()), "controls");
  const InUse::Turn turn(in_use_);
  return transmission_force_array(batch_, controls);
}

nb::tuple PythonBatch::bodies() {
  const InUse::Turn turn(in_use_);
  return body_arrays(workers_[0].readout, batch_);
}

nb::tuple PythonBatch::faces(const Whole<int>& environment, double half_space) {
  const InUse::Turn turn(in_use_);
  return face_arrays(batch_, environment.value("env"), half_space);
}

nb::dict PythonBatch::randomized() {
  const InUse::Turn turn(in_use_);
  return randomized_arrays(batch_);
}

nb::dict PythonBatch::counts() {
  const InUse::Turn turn(in_use_);
  nb::dict counts;
  for (const auto& [name, count_of] : kCountNames) {
    std::span<std::int64_t> numbers;
    auto array = new_array<std::int64_t>({count()}, numbers);
    for (std::size_t e = 0; e < count(); ++e) numbers[e] = counts_[e].*count_of;
    counts[name] = array;
  }
  return counts;
}

void PythonBatch::set_randomized(const NamedValues& values, const nb::object& environments) {
  const std::vector<int> list = listed(environments);
  const InUse::Turn turn(in_use_);
  python::set_randomized(batch_, values, list);
}

Array<std::int8_t> PythonBatch::status() {
  const InUse::Turn turn(in_use_);
  return array_of<std::int8_t>({count()}, batch_.statuses());
}

std::vector<int> PythonBatch::listed(const nb::object& environments) const {
  std::vector<int> list;
  if (environments.is_none()) {
    for (int e = 0; e < this->environments(); ++e) list.push_back(e);
    return list;
  }
  const nb::object array = nb::module_::import_("numpy").attr("asarray")(environments);
  const auto shape = nb::cast<std::vector<std::size_t>>(array.attr("shape"));
  if (shape.size() != 1)
    throw InputError(fmt::format("envs of shape ({}); expected a list of indices, or a mask ({})",
                                 fmt::join(shape, ", "), count()));
  const auto kind = nb::cast<std::string>(array.attr("dtype").attr("kind"));
  const bool is_mask = kind == "b";
  if (!is_mask && kind != "i" && kind != "u" && nb::len(array) > 0)
    throw InputError("envs of another kind; expected indices of environments, or a mask of bool");
  std::vector<int> given;
  for (const auto& whole : nb::cast<std::vector<Whole<int>>>(array.attr("tolist")()))
    given.push_back(whole.value("environment"));
  if (is_mask && given.size() != count())
    throw InputError(fmt::format("a mask of {} environments; expected {}", given.size(), count()));
  for (std::size_t k = 0; k < given.size(); ++k)
    if (!is_mask || given[k] != 0) list.push_back(is_mask ? static_cast<int>(k) : given[k]);
  for (const int e : list)
    if (e < 0 || e >= this->environments())
      throw InputError(
          fmt::format("environment {}; expected 0 to {}", e, this->environments() - 1));
  return list;
}

void PythonBatch::set_state(const Argument<double>& q, const Argument<double>& v,
                            const nb::object& environments) {
  const std::vector<int> list = listed(environments);
  const std::size_t nq = as_size(model().nq()), nv = as_size(model().nv());
  const std::vector<double> qs = rows_of(q, list.size(), nq, "q"),
                            vs = rows_of(v, list.size(), nv, "v");
  check_state(model(), qs, vs);
  const InUse::Turn turn(in_use_);
  for (std::size_t k = 0; k < list.size(); ++k)
    batch_.set_state(list[k], std::span(qs).subspan(k * nq, nq), std::span(vs).subspan(k * nv, nv));
}

Array<std::int64_t> PythonBatch::steps() {
  const InUse::Turn turn(in_use_);
  std::span<std::int64_t> numbers;
  auto array = new_array<std::int64_t>({count()}, numbers);
  for (int e = 0; e < environments(); ++e) numbers[as_size(e)] = batch_.steps(e);
  return array;
}

void PythonBatch::set_steps(const std::vector<Whole<std::int64_t>>& steps,
                            const nb::object& environments) {
  constexpr std::int64_t kEnd = std::int64_t{1} << 48;
  const std::vector<int> list = listed(environments);
  if (steps.size() != list.size())
    throw InputError(fmt::format("{} numbers of steps for {} environments; expected one for each",
                                 steps.size(), list.size()));
  std::vector<std::int64_t> counts;
  for (const Whole<std::int64_t>& s : steps) {
    counts.push_back(s.value("steps"));
    if (counts.back() < 0 || counts.back() >= kEnd)
      throw InputError(fmt::format("{} steps; expected 0 or more, below 2^48", counts.back()));
  }
  const InUse::Turn turn(in_use_);
  for (std::size_t k = 0; k < list.size(); ++k) batch_.set_steps(list[k], counts[k]);
}

Array<double> PythonBatch::shear_state() {
  const InUse::Turn turn(in_use_);
  const std::size_t n = shear_arrays_.count();
  std::span<double> numbers;
  auto array = new_array<double>({count(), n, 3}, numbers);
  for (int e = 0; e < environments(); ++e)
    shear_arrays_.write(batch_.shear_state(e), numbers.subspan(as_size(e) * 3 * n, 3 * n));
  return array;
}

void PythonBatch::set_shear_state(const Argument<double>& state, const nb::object& environments) {
  const std::vector<int> list = listed(environments);
  const std::size_t n = shear_arrays_.count();
  std::vector<double> all;
  if (state.ndim() == 2) {
    const std::span<const double> one = numbers_of(state, {n, 3}, "shear_state");
    for (std::size_t k = 0; k < list.size(); ++k) all.insert(all.end(), one.begin(), one.end());
  } else {
    const std::span<const double> each = numbers_of(state, {list.size(), n, 3}, "shear_state");
    all.assign(each.begin(), each.end());
  }
  if (!std::all_of(all.begin(), all.end(), [](double x) { return std::isfinite(x); }))
    throw InputError("a shear state that is not finite; expected numbers");
  const InUse::Turn turn(in_use_);
  for (std::size_t k = 0; k < list.size(); ++k)
    batch_.set_shear_state(list[k], shear_arrays_.read(std::span(all).subspan(k * 3 * n, 3 * n)));
}

void PythonBatch::reset(const nb::object& environments,
                        const std::optional<std::vector<Whole<std::int64_t>>>& episodes) {
  const std::vector<int> list = listed(environments);
  if (episodes && episodes->size() != list.size())
    throw InputError(fmt::format("{} episodes for {} environments; expected one for each",
                                 episodes->size(), list.size()));
  const InUse::Turn turn(in_use_);
  std::vector<std::int64_t> numbers;
  for (std::size_t k = 0; k < list.size(); ++k)
    numbers.push_back(episodes ? (*episodes)[k].value("episode") : batch_.episode(list[k]));
  for (std::size_t k = 0; k < list.size(); ++k) {
    batch_.reset(list[k], numbers[k]);
    counts_[as_size(list[k])] = {};
  }
}

Array<double> PythonBatch::scene_controls(const Whole<std::int64_t>& count_of_steps) {
  const std::int64_t steps = count_of_steps.value("steps");
  if (steps < 1) throw InputError(fmt::format("{} steps; expected at least 1", steps));
  const InUse::Turn turn(in_use_);
  const ControlProgram program(model(), workers_[0].stepper.timestep(), batch_.seed());
  program.check_covers(steps);
  const std::size_t nu = as_size(model().nu());
  std::span<double> numbers;
  auto array = new_array<double>({as_size(steps), count(), nu}, numbers);
  for (std::int64_t t = 0; t < steps; ++t)
    write_controls(program, t, batch_, numbers.subspan(as_size(t) * count() * nu, count() * nu));
  return array;
}

static void add_run(nb::module_& m) {
  nb::class_<Run>(m, "Run", "What Batch.run() leaves: F = steps / every frames.")
      .def_prop_ro(
          "q", [](const Run& r) { return r.q; }, nb::rv_policy::automatic,
          "(F, E, nq) coordinates.")
      .def_prop_ro(
          "v", [](const Run& r) { return r.v; }, nb::rv_policy::automatic, "(F, E, nv) velocities.")
      .def_prop_ro(
          "fields", [](const Run& r) { return r.readings; },
          nb::for_getter(nb::sig("def fields(self) -> dict[str, numpy.typing.NDArray]")),
          "What was requested by name: (F, E, …), as Batch.tactile() returns it.")
      .def_ro("model", &Run::model)
      .def_ro("interval", &Run::interval, "Between two frames [s].")
      .def_prop_ro(
          "randomized", [](const Run& r) { return r.randomized; },
          nb::for_getter(
              nb::sig("def randomized(self) -> dict[str, numpy.typing.NDArray[numpy.float64]]")),
          "As Batch.randomized().")
      .def_prop_ro(
          "status", [](const Run& r) { return r.status; }, nb::rv_policy::automatic,
          "(E) int8: of the last step; negative where an environment failed.");
}

static void make_batch(PythonBatch* self, const Model& model, const Whole<int>& envs,
                       const Whole<std::uint64_t>& seed, const Whole<std::int64_t>& first_episode,
                       const std::optional<Whole<int>>& threads, const std::string& precision,
                       const std::optional<double>& timestep,
                       const std::optional<double>& tolerance,
                       const std::optional<double>& accuracy, const std::optional<double>& sleep) {
  BatchOptions options;
  options.seed = seed.value("seed");
  options.first_episode = first_episode.value("first_episode");
  if (options.first_episode < 0)
    throw InputError(fmt::format("first_episode {}; expected 0 or more", options.first_episode));
  options.threads = threads_of(threads);
  options.precision = precision_named(precision);
  options.stepper.timestep = timestep;
  options.stepper.tolerance = tolerance;
  options.stepper.accuracy = accuracy;
  options.stepper.sleep = sleep;
  new (self) PythonBatch(model, envs.value("num_envs"), options);
}

static void add_statuses(nb::module_& m) {
  nb::enum_<StepStatus>(m, "StepStatus", nb::is_arithmetic(),
                        "How a step ended. Values below 0 are failures: the environment stands\n"
                        "still until it is reset.")
      .value("converged", StepStatus::converged)
      .value("split", StepStatus::split, "Converged in parts.")
      .value("accuracy_not_met", StepStatus::accuracy_not_met,
             "Converged, but its shortest parts missed the accuracy or created energy.")
      .value("tunnelled", StepStatus::tunnelled,
             "Converged, but a body came through another that it touches.")
      .value("damped", StepStatus::damped,
             "Converged, but damped, because the scheme would have created energy.")
      .value("overlapping", StepStatus::overlapping,
             "Converged, but bodies overlap where no contact point is as deep.")
      .value("not_converged", StepStatus::not_converged, "No solution was found.")
      .value("non_finite", StepStatus::non_finite, "A control or state was not finite.")
      .value("rotation", StepStatus::rotation, "A joint turned by pi or more.")
      .value("singular", StepStatus::singular, "The Jacobian could not be factored.")
      .value("unsolved_layer", StepStatus::unsolved_layer,
             "The pressures of a layer that is a contact were not found.");
}

static void add_coordinates(nb::class_<PythonBatch>& batch) {
  batch
      .def_prop_ro("q", &PythonBatch::q, nb::rv_policy::automatic,
                   "(E, nq) coordinates: m, rad, quaternions w x y z.")
      .def_prop_ro("v", &PythonBatch::v, nb::rv_policy::automatic,
                   "(E, nv) velocities: m/s, rad/s.")
      .def_prop_ro(
          "q_view", [](nb::handle_t<PythonBatch> b) { return nb::cast<PythonBatch&>(b).q_view(b); },
          nb::rv_policy::automatic,
          "(B, 16, nq) float64, read only: the coordinates where the engine has them, without a\n"
          "copy. Environment e is q_view[e // 16, e % 16]; places behind the last environment are\n"
          "padding. The numbers change whenever the state does: by step(), run(), set_state() and\n"
          "reset(). Do not read a view while another thread steps the batch. A view keeps the\n"
          "batch's memory alive.")
      .def_prop_ro(
          "v_view", [](nb::handle_t<PythonBatch> b) { return nb::cast<PythonBatch&>(b).v_view(b); },
          nb::rv_policy::automatic, "(B, 16, nv) float64, read only: the velocities, as q_view.");
}

constexpr const char* kTactileText =
    "Reads one sensor or camera in all environments: 'pad' (E, rows, cols, 3) or (E, points, "
    "3),\n"
    "shear, shear, normal force of each point [N]; 'pad.pressure' and 'pad.shear' parts of\n"
    "it; 'pad.sum' (E, 6): force [N] and where it presses [m], body axes; 'pad.flow' the\n"
    "shear over its largest length; 'pad.ideal' the field without imperfections;\n"
    "'pad.markers' the displacement of markers [m], 'pad.surface' that of a layer's\n"
    "surface [m]; 'pad.channels' (E, channels) what the hardware returns;\n"
    "'pad.height' (E, H, W, 1) float32 the surface of a gel [m], 'pad.rgb' and\n"
    "'pad.rgb_marker' (E, H, W, 3) uint8 pictures of it; of a camera 'eye.rgb', 'eye.depth'\n"
    "[m] and 'eye.ids' (E, H, W, 1) int16, nb for the ground, -1 for nothing. `out`: an\n"
    "array to fill instead of a new one.";
constexpr const char* kRunText =
    "Takes T steps with the controls `u`, (T, E, nu), in one call. Keeps the state after every\n"
    "`every` steps, and the readings named in `fields`. `envs`: the environments that are stepped\n"
    "(indices, or a mask (E)), None for all; the others stand still. InputError: another shape, T\n"
    "is no multiple of `every`, or there is no such reading or environment.";

void add_batches(nb::module_& m) {
  add_statuses(m);

  add_run(m);
  nb::class_<PythonBatch> batch(
      m, "Batch",
      "Many environments of one model, stepped together on all cores. Results are new arrays.\n"
      "The same seed gives the same bits for any number of environments and threads. One Python\n"
      "thread uses a batch at a time.");
  add_coordinates(batch);
  batch
      .def("__init__", &make_batch, "model"_a, "num_envs"_a = 1, "seed"_a = 0,
           "first_episode"_a = 0, "threads"_a = nb::none(), "precision"_a = "mixed",
           "timestep"_a = nb::none(), "tolerance"_a = nb::none(), "accuracy"_a = nb::none(),
           "sleep"_a = nb::none(),
           "Draws `envs` starting states: environment e is episode first_episode + e of `seed`.\n"
           "`threads`: None for all cores. `precision`: of tactile fields; 'mixed' returns "
           "float32,\n"
           "'double' float64. `timestep` [s], `tolerance` (of a solve, dimensionless),\n"
           "`accuracy` (of the parts that steps are cut into, relative; 0: they are not cut) and\n"
           "`sleep` (share of its size that a body may move and still rest until it sleeps; 0: "
           "none\n"
           "sleeps): None for the scene's. InputError: a number is out of range.")
      .def_prop_ro("model", &PythonBatch::model)
      .def_prop_ro("num_envs", &PythonBatch::environments, "E")
      .def_prop_ro("threads", &PythonBatch::threads)
      .def_prop_ro("seed", &PythonBatch::seed)
      .def_prop_ro("loads_not_carried", &PythonBatch::loads_not_carried,
                   "Readings so far of layers that cannot carry the loads of their contacts.")
      .def_prop_ro(
          "status", &PythonBatch::status, nb::rv_policy::automatic,
          "(E) int8, StepStatus of the last step; negative where it has failed and stands still.")
      .def("end_effectors", &PythonBatch::end_effectors, "(E, n, 3) places in the world [m].")
      .def(
          "transmission_forces", &PythonBatch::transmission_forces, "u"_a,
          "(E, n) forces on the joints of Model.transmission_names [N; N m where they turn] under\n"
          "the controls u, (E, nu) or (nu): by springs, damping, limits, dry friction and motors.\n"
          "Positive forces lengthen.")
      .def("bodies", &PythonBatch::bodies,
           nb::sig("def bodies(self) -> tuple[numpy.typing.NDArray[numpy.float64], "
                   "numpy.typing.NDArray[numpy.float64]]"),
           "Poses (E, nb, 7), x y z qw qx qy qz in the world, and twists (E, nb, 6), angular then\n"
           "linear velocity in world axes.")
      .def("faces", &PythonBatch::faces, "env"_a, "half_space"_a = 0.0, nb::sig(kFacesSignature),
           kFacesText)
      .def("randomized", &PythonBatch::randomized, nb::sig(kRandomizedSignature), kRandomizedText)
      .def("counts", &PythonBatch::counts,
           nb::sig("def counts(self) -> dict[str, numpy.typing.NDArray[numpy.int64]]"),
           "Name → (E) int64, of the episode so far, without steps that failed: simulation_steps,\n"
           "newton_iterations, and steps by their status: split_steps, accuracy_not_met_steps,\n"
           "tunnelled_steps, damped_steps and overlapping_steps.")
      .def("set_randomized", &PythonBatch::set_randomized, "values"_a, "envs"_a = nb::none(),
           nb::sig(kSetRandomizedSignature), kSetRandomizedText)
      .def("step", &PythonBatch::step, "u"_a,
           "Takes one step. `u`: (E, nu) controls, or (nu) for all environments; clipped to the\n"
           "motors' ranges. InputError: another shape.")
      .def("run", &PythonBatch::run, "u"_a, "every"_a = 1, "fields"_a = std::vector<std::string>(),
           "envs"_a = nb::none(), kRunText)
      .def("tactile", &PythonBatch::tactile, "reading"_a, "out"_a = nb::none(),
           nb::sig("def tactile(self, reading: str, out: numpy.typing.NDArray | None = None) -> "
                   "numpy.typing.NDArray"),
           kTactileText)
      .def("set_state", &PythonBatch::set_state, "q"_a, "v"_a, "envs"_a = nb::none(),
           "Sets states: `q` (n, nq) or (nq), `v` (n, nv) or (nv), of the environments listed in\n"
           "`envs` (indices, or a mask (E)), or of all. Releases a failed environment; drops the\n"
           "state one step before and the shear state.")
      .def_prop_ro(
          "shear_state", &PythonBatch::shear_state, nb::rv_policy::automatic,
          "(E, points, 3) the shear state of contacts with ks: the elastic displacement of\n"
          "every point of Model.shear_state_arrays [m], in the axes of the moving frame that\n"
          "carries it; 0 where it has not moved or does not touch.")
      .def("set_shear_state", &PythonBatch::set_shear_state, "shear_state"_a, "envs"_a = nb::none(),
           "Sets the shear state, (n, points, 3) or (points, 3) as in `shear_state`, of the\n"
           "environments listed in `envs` (indices, or a mask (E)), or of all. To go on from a\n"
           "state, set it after set_state(). InputError: another shape, or not finite.")
      .def_prop_ro("steps", &PythonBatch::steps, nb::rv_policy::automatic,
                   "(E) int64: steps since the start of each episode. The noise of sensors and\n"
                   "skins with memory=\"read\" go by it.")
      .def("set_steps", &PythonBatch::set_steps, "steps"_a, "envs"_a = nb::none(),
           "Sets these counts, one for each of the environments listed in `envs` (indices, or a\n"
           "mask (E)), or of all. set_state() keeps them, so set them to go on from a state of\n"
           "another batch. InputError: another length, or a negative number.")
      .def("reset", &PythonBatch::reset, "envs"_a = nb::none(), "episodes"_a = nb::none(),
           "Draws the starting states again, or those of other `episodes`.")
      .def("scene_controls", &PythonBatch::scene_controls, "steps"_a,
           "(T, E, nu): what the scene's <control> gives for the first T steps.");
}

}  // namespace tangere::python
