// SPDX-License-Identifier: Apache-2.0
// Each add_…() declares channels and the function that computes their rows. Blocks are read on
// several threads; one thread writes rows in ascending order.
#include "tasks/run/recorder.hpp"

#include <algorithm>
#include <limits>
#include <string>

#include "engine/base/as_size.hpp"
#include "engine/rows/camera_layout.hpp"
#include "engine/rows/sensor_layout.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/sense/transmission_forces.hpp"
#include "engine/step/sleeping_trees.hpp"
#include "kernels/numbers/block.hpp"
#include "tasks/run/block_reader.hpp"

namespace tangere {
namespace {

constexpr int kPoseWidth = 7, kTwistWidth = 6, kPositionWidth = 3;
constexpr OutputTimes kAlways{};
constexpr const char* kStepsOfRow = "steps of this run before each row";

std::size_t numbers_in(const Model& model, FieldOutput output) { return numbers_of(model, output); }

std::vector<std::string> recorded_bodies(const Model& model, const RolloutOutputs& outputs) {
  const auto all = model.body_names();
  if (outputs.chosen_bodies.empty()) return {all.begin(), all.end()};
  std::vector<std::string> names;
  for (const int body : outputs.chosen_bodies) {
    if (body < 0 || body >= model.nb())
      throw InputError("an output of body " + std::to_string(body) + "; the scene has " +
                       std::to_string(model.nb()));
    names.push_back(all[as_size(body)]);
  }
  return names;
}

std::vector<std::string> copy(std::span<const std::string> texts) {
  return {texts.begin(), texts.end()};
}

Numbers flags(const std::vector<std::uint8_t>& values) {
  return std::span(reinterpret_cast<const std::int8_t*>(values.data()), values.size());
}

}  // namespace

Recorder::Recorder(const Batch& batch, std::span<const Stepper> steppers,
                   const RolloutOptions& options, const TaskSpec* task)
    : batch_(batch),
      model_(batch.model()),
      steppers_(steppers),
      options_(options),
      task_(task),
      environments_(as_size(batch.environments())) {
  add_state();
  add_motion();
  add_solver();
  if (options.outputs.audit) add_audit();
  if (options.outputs.transmissions) add_transmissions();
  if (steppers.front().sleep() > 0) add_sleep();
  if (options.outputs.memory) add_shear(options.outputs.shear_times);
  add_readings();
  add_views();
  add_randomized();
  if (task != nullptr) add_task();
}

std::int64_t Recorder::rows(const OutputTimes& times, bool at_start) const {
  const auto before = [&](std::int64_t row) {
    return times.before(row, options_.steps, options_.first_step);
  };
  return before(options_.steps + 1) - (at_start ? 0 : before(1));
}

bool Recorder::due(const Source& source, std::int64_t t) const {
  return (t > 0 || source.at_start) && source.times.at(t, options_.steps, options_.first_step);
}

void Recorder::add(Channel channel, Source source) {
  channel.rows = source.when == When::action ? task_->horizon : rows(source.times, source.at_start);
  recording_.channels.push_back(std::move(channel));
  sources_.push_back(std::move(source));
}

void Recorder::add_steps(const std::string& name, const char* meaning, const Source& of) {
  add({.name = name, .type = NumberType::int64, .shape = {}, .meaning = meaning},
      {of.when, of.times, of.at_start, 1,
       [this](auto, int) { return Numbers(std::span(&row_, 1)); }});
}

void Recorder::add_state() {
  const OutputTimes& times = options_.outputs.states;
  const auto at = [&](Read read) { return Source{When::row, times, true, 1, std::move(read)}; };
  add({.name = "time", .shape = {}, .units = {"s"}}, at([this](std::int64_t t, int) {
        // From the step counter, so times do not drift.
        time_ = static_cast<double>(options_.first_step + t) * steppers_.front().timestep();
        return std::span<const double>(&time_, 1);
      }));
  add({.name = "q",
       .shape = {environments_, as_size(model_.nq())},
       .names = copy(model_.q_names()),
       .units = copy(model_.q_units()),
       .frame = "each joint's fixed frame; quaternions turn the moving frame into it"},
      at([this](auto, int) {
        for (int e = 0; e < batch_.environments(); ++e) batch_.get_q(e, part(q_, e));
        return std::span<const double>(q_);
      }));
  add({.name = "v",
       .shape = {environments_, as_size(model_.nv())},
       .names = copy(model_.v_names()),
       .units = copy(model_.v_units()),
       .frame = "linear: axes of the joint's fixed frame; angular: axes of the moving frame"},
      at([this](auto, int) {
        for (int e = 0; e < batch_.environments(); ++e) batch_.get_v(e, part(v_, e));
        return std::span<const double>(v_);
      }));
  if (times.given()) add_steps("step", kStepsOfRow, at({}));
}

void Recorder::add_sleep() {
  const std::vector<std::string> trees = sleeping_trees(model_);
  if (trees.empty()) return;
  recording_.groups.push_back(
      {"sleep",
       {{"trees", trees},
        {"meaning",
         "at each row of /q; a tree is a body, named, with all that joints connect it with"}}});
  // `member`: of SleepState; numbers that it lacks are `none`.
  const auto list = [&](const char* name, NumberType type, auto& buffer, auto member, auto none,
                        std::size_t width, const char* meaning) {
    buffer.resize(environments_ * width);
    add({.name = name,
         .type = type,
         .shape = {environments_, width},
         .meaning = meaning,
         .storage = Channel::Storage::compressed},
        {When::row, options_.outputs.states, true, 1,
         [this, &buffer, member, none, width](auto, int) {
           std::fill(buffer.begin(), buffer.end(), none);
           for (std::size_t e = 0; e < environments_; ++e) {
             const auto& numbers = batch_.sleeps()[e].*member;
             std::copy(numbers.begin(), numbers.end(), buffer.begin() + std::ptrdiff_t(e * width));
           }
           return Numbers(std::span(std::as_const(buffer)));
         }});
  };
  list("sleep/island", NumberType::int32, island_, &SleepState::island, -1, trees.size(),
       "-1: awake; else the lowest tree of those that fell asleep together");
  list("sleep/rested", NumberType::int32, rested_, &SleepState::rested, 0, trees.size(),
       "steps in a row in which the tree hardly moved");
  list("sleep/u", NumberType::float64, sleep_u_, &SleepState::u,
       std::numeric_limits<double>::quiet_NaN(), as_size(model_.nu()),
       "controls of the last step before which some tree rested; NaN: none");
  const auto one = [&](const char* name, NumberType type, auto& buffer, auto number,
                       const char* meaning) {
    buffer.resize(environments_);
    add({.name = name,
         .type = type,
         .shape = {environments_},
         .meaning = meaning,
         .storage = Channel::Storage::compressed},
        {When::row, options_.outputs.states, true, 1, [this, &buffer, number](auto, int) {
           for (std::size_t e = 0; e < environments_; ++e) buffer[e] = number(batch_.sleeps()[e]);
           return Numbers(std::span(std::as_const(buffer)));
         }});
  };
  one(
      "sleep/clearance", NumberType::float64, clearance_,
      [](const SleepState& sleep) { return sleep.clearance; },
      "what awake bodies may move before one may reach a sleeping one [m]");
  one(
      "sleep/resting", NumberType::int8, resting_,
      [](const SleepState& sleep) {
        return sleep.asleep.empty() ? std::int8_t{-1} : std::int8_t{sleep.resting};
      },
      "1: a tree that is awake rested in the last step; -1: nothing is known yet of this "
      "environment");
}

void Recorder::add_shear(const OutputTimes& times) {
  constexpr const char* kFrame = "axes of the moving frame that carries the point";
  shear_points_ = shear_state_arrays(model_);
  const std::size_t points = shear_points_.count();
  if (points == 0) return;
  std::vector<std::string> names;
  std::vector<std::int64_t> first{0};
  std::vector<double> places;
  for (const ShearSpringPlaces& contact : shear_points_.contacts) {
    names.push_back(contact.name);
    first.push_back(first.back() + std::ssize(contact.places));
    for (const Vector3& p : contact.places) places.insert(places.end(), p.begin(), p.end());
  }
  recording_.groups.push_back({"memory", {{"contacts", names}, {"first", first}}});
  recording_.tables.push_back({{.name = "memory/place",
                                .shape = {3},
                                .rows = static_cast<std::int64_t>(points),
                                .units = {"m"},
                                .frame = kFrame},
                               places});
  const Source source{
      When::row, times, true, batch_.blocks(), [this](auto, int block) {
        read_shear(block);
        const int lanes = lanes_of(batch_, block);
        return std::span<const double>(shear_).first(as_size(lanes) * 3 * shear_points_.count());
      }};
  add({.name = "memory/s",
       .shape = {environments_, points, 3},
       .units = {"m"},
       .frame = kFrame,
       .meaning = "elastic displacement of each point; 0: none, or no touch",
       .storage = Channel::Storage::compressed},
      source);
  add_steps("memory/step", kStepsOfRow, source);
}

void Recorder::read_shear(int block) {
  const std::size_t width = 3 * shear_points_.count();
  for (int lane = 0; lane < lanes_of(batch_, block); ++lane)
    shear_points_.write(batch_.shear_states()[as_size(block * kernels::kBlock + lane)],
                        std::span(shear_).subspan(as_size(lane) * width, width));
}

void Recorder::add_motion() {
  const RolloutOutputs& outputs = options_.outputs;
  if (outputs.bodies && model_.nb() > 0) {
    const std::vector<std::string> names = recorded_bodies(model_, outputs);
    bodies_ = names.size();
    const Attributes bodies{{"bodies", names}};
    recording_.groups.push_back({"bodies", {{"names", names}}});
    const auto at = [&](Read read) {
      return Source{When::row, outputs.body_times, true, 1, std::move(read)};
    };
    add({.name = "bodies/pose",
         .shape = {environments_, names.size(), kPoseWidth},
         .names = {"x", "y", "z", "qw", "qx", "qy", "qz"},
         .units = {"m", "m", "m", "1", "1", "1", "1"},
         .frame = "body frame in the world",
         .more = bodies},
        at([this](auto, int) {
          for (int e = 0; e < batch_.environments(); ++e)
            readouts_[0].bodies(batch_, e, part(pose_, e), part(twist_, e),
                                options_.outputs.chosen_bodies);
          return std::span<const double>(pose_);
        }));
    add({.name = "bodies/twist",
         .shape = {environments_, names.size(), kTwistWidth},
         .names = {"wx", "wy", "wz", "vx", "vy", "vz"},
         .units = {"rad/s", "rad/s", "rad/s", "m/s", "m/s", "m/s"},
         .frame = "world axes; velocity of the body frame's origin",
         .more = bodies},
        at([this](auto, int) { return std::span<const double>(twist_); }));  // read with the poses
    if (outputs.body_times.given()) add_steps("bodies/step", kStepsOfRow, at({}));
  }
  if (!outputs.end_effectors || model_.end_effectors().empty()) return;
  std::vector<std::string> names;
  for (const EndEffectorInfo& info : model_.end_effectors()) names.push_back(info.name);
  const Source source{When::row, outputs.end_effector_times, true, 1, [this](auto, int) {
                        for (int b = 0; b < batch_.blocks(); ++b)
                          read_end_effectors(readouts_[0], batch_, b,
                                             [this](int e) { return part(end_effectors_, e); });
                        return std::span<const double>(end_effectors_);
                      }};
  if (outputs.end_effector_times.given()) add_steps("variables/step", kStepsOfRow, source);
  add({.name = "variables/position",
       .shape = {environments_, names.size(), kPositionWidth},
       .names = names,
       .units = {"m"},
       .frame = "world"},
      source);
}

/// Where states have times of their own, of the solver's numbers only the status is recorded.
void Recorder::add_solver() {
  const OutputTimes& states = options_.outputs.states;
  const bool all = !states.given();
  const auto at = [](Read read) { return Source{When::step, kAlways, false, 1, std::move(read)}; };
  if (all && model_.nu() > 0)
    add({.name = "u",
         .shape = {environments_, as_size(model_.nu())},
         .names = copy(model_.u_names()),
         .units = copy(model_.u_units()),
         .meaning = "as given; motors clip them and map them to forces and targets"},
        at([this](auto, int) { return u_; }));
  if (all)
    add({.name = "solver/iterations",
         .type = NumberType::int32,
         .shape = {environments_},
         .meaning = "evaluations of the residual, sub-steps included"},
        at([this](auto, int) {
          for (int e = 0; e < batch_.environments(); ++e)
            iterations_[as_size(e)] = tally_->steps(batch_, e) ? batch_.iterations(e) : 0;
          return std::span<const std::int32_t>(iterations_);
        }));
  std::vector<std::int8_t> values;
  std::vector<std::string> meanings;
  for (const StepStatus status : step_statuses()) {
    values.push_back(static_cast<std::int8_t>(status));
    meanings.emplace_back(to_string(status));
  }
  add({.name = "solver/status",
       .type = NumberType::int8,
       .shape = {environments_},
       .meaning = all ? "" : "of the step that ends at each row of /q; 0 at row 0",
       .more = {{"values", values}, {"meanings", meanings}}},
      {When::step, states, !all, 1, [this](std::int64_t t, int) {
         for (int e = 0; e < batch_.environments() && t > 0; ++e)
           status_[as_size(e)] = static_cast<std::int8_t>(batch_.status(e));
         return std::span<const std::int8_t>(status_);
       }});
  if (all)
    add({.name = "solver/residual",
         .shape = {environments_},
         .meaning = "scaled residual at acceptance, dimensionless"},
        at([this](auto, int) { return batch_.residuals(); }));
}

void Recorder::add_audit() {
  add({.name = "audit/energy",
       .shape = {environments_, 3},
       .names = {"motion", "height", "held"},
       .units = {"J", "J", "J"},
       .meaning = "of moving bodies; -m gravity.x; by springs, limits and contacts"},
      {When::step, kAlways, true, 1, [this](auto, int) { return audit_->energy(); }});
  add({.name = "audit/momentum",
       .shape = {environments_, 6},
       .names = {"x", "y", "z", "about_x", "about_y", "about_z"},
       .units = {"kg m/s", "kg m/s", "kg m/s", "kg m^2/s", "kg m^2/s", "kg m^2/s"},
       .frame = "world; angular about its origin"},
      {When::step, kAlways, true, 1, [this](auto, int) { return audit_->momentum(); }});
  add({.name = "audit/step",
       .shape = {environments_, 3},
       .names = {"motors", "taken", "made"},
       .units = {"J", "J", "J"},
       .meaning = "work of the motors; what damping and friction took; what the scheme made: the "
                  "change of energy less the first, plus the second"},
      {When::step, kAlways, false, 1, [this](auto, int) { return audit_->passed(); }});
}

void Recorder::add_transmissions() {
  std::vector<std::string> names, units;
  for (const TransmissionDescription& d : model_.scene().transmissions) {
    const auto link = std::ranges::find_if(
        model_.scene().links, [&](const LinkDescription& l) { return l.joint.name == d.joint; });
    names.push_back(d.joint);
    units.emplace_back(dof_turns(link->joint.type, 0) ? "N m" : "N");
  }
  add({.name = "transmissions/force",
       .shape = {environments_, names.size()},
       .names = names,
       .units = units,
       .meaning = "on the joint at the end of the step, under its controls; positive lengthens"},
      {When::step, kAlways, false, 1, [this](auto, int) {
         forces_.clear();
         const std::size_t nu = as_size(model_.nu());
         for (int e = 0; e < batch_.environments(); ++e) {
           const std::vector<double> one =
               transmission_forces(model_, batch_, e, u_.subspan(as_size(e) * nu, nu));
           forces_.insert(forces_.end(), one.begin(), one.end());
         }
         return std::span<const double>(forces_);
       }});
}

/// Readings of a sensor share their list of steps, unless they are taken at other times.
void Recorder::add_readings() {
  std::vector<FieldOutput> first;  // of each sensor
  for (const FieldOutput output : sensor_fields_of(model_, options_.outputs)) {
    const SensorInfo& info = model_.sensors()[as_size(output.sensor)];
    const SensorLayout layout =
        sensor_layout(info, model_.scene().sensors[as_size(output.sensor)], 1);
    check_sensor_name(layout.name);
    const std::string group = "tactile/" + layout.name + "/";
    const OutputTimes times = reading_times(model_, output, options_);
    Channel channel{.name = group + dataset_of(output.form), .shape = {environments_}};
    for (const std::uint64_t n : reading_shape(layout, output.form)) channel.shape.push_back(n);
    channel.more = {{"every", times.final ? options_.first_step + options_.steps : times.every}};
    for (RunAttribute& one : reading_attributes(layout, output.form))
      channel.more.push_back(std::move(one));
    if (output.form != FieldForm::sum) channel.storage = Channel::Storage::per_environment;
    channel.type = is_colour(output.form)    ? NumberType::uint8
                   : is_picture(output.form) ? NumberType::float32
                                             : NumberType::float64;
    const Source source{When::row, times, false, 1, [this, output](auto, int) -> Numbers {
                          if (is_colour(output.form)) return read_as(output, bytes_);
                          if (is_picture(output.form)) return read_as(output, heights_);
                          return read_as(output, reading_);
                        }};
    const auto same = std::find_if(first.begin(), first.end(), [&](const FieldOutput& other) {
      return other.sensor == output.sensor;
    });
    const bool is_first = same == first.end();
    const std::string steps = is_first ? group + "step" : channel.name + "_step";
    add(std::move(channel), source);
    if (is_first || times != reading_times(model_, *same, options_))
      add_steps(steps,
                options_.outputs.states.given() ? "steps of this run before each field"
                                                : "row of /q that each field was read from",
                source);
    if (!is_first) continue;
    first.push_back(output);
    for (Table& table : point_tables(layout, group)) recording_.tables.push_back(std::move(table));
  }
}

/// Pictures of a camera share their list of steps, unless they are taken at other times.
void Recorder::add_views() {
  std::vector<FieldOutput> first;  // of each camera
  for (const FieldOutput output : fields_of(model_, options_.outputs)) {
    if (!is_view(output.form)) continue;
    const CameraLayout layout =
        camera_layout(model_.scene(), model_.scene().cameras[as_size(output.sensor)]);
    const std::string group = "cameras/" + layout.name + "/";
    const OutputTimes times = reading_times(model_, output, options_);
    const std::size_t own = own_bytes(output.form);
    Channel channel{.name = group + to_string(output.form),
                    .type = own == 1   ? NumberType::uint8
                            : own == 2 ? NumberType::int16
                                       : NumberType::float32,
                    .shape = {environments_},
                    .storage = Channel::Storage::per_environment};
    for (const std::uint64_t n : view_shape(layout, output.form)) channel.shape.push_back(n);
    channel.more = view_attributes(layout, output.form);
    const Source source{When::row, times, false, 1, [this, output, own](auto, int) -> Numbers {
                          if (own == 1) return read_as(output, bytes_);
                          if (own == 2) return read_as(output, ids_);
                          return read_as(output, heights_);
                        }};
    const auto same = std::find_if(first.begin(), first.end(), [&](const FieldOutput& other) {
      return other.sensor == output.sensor;
    });
    const std::string steps = same == first.end() ? group + "step" : channel.name + "_step";
    const bool alone = same == first.end() || times != reading_times(model_, *same, options_);
    add(std::move(channel), source);
    if (alone)
      add_steps(steps,
                options_.outputs.states.given() ? "steps of this run before each picture"
                                                : "row of /q of which each picture is",
                source);
    if (same == first.end()) first.push_back(output);
  }
}

/// Reads an output of all environments into a buffer of its type.
template <class T>
std::span<const T> Recorder::read_as(FieldOutput output, std::vector<T>& buffer) {
  const std::size_t width = numbers_in(model_, output);
  buffer.resize(std::max(buffer.size(), environments_ * width));
  threads_->for_each(batch_.blocks(), readouts_, [&](Readout& readout, int block) {
    read_field<T>(readout, batch_, block, output,
                  [&](int e) { return std::span(buffer).subspan(as_size(e) * width, width); });
  });
  return std::span<const T>(buffer).first(environments_ * width);
}

void Recorder::add_randomized() {
  Channel channel{.name = "randomized", .shape = {}, .rows = batch_.environments()};
  for (const RandomizationDescription& d : model_.scene().randomizations) {
    channel.names.push_back(name_of(d.number));
    channel.units.push_back(unit_of(model_.scene(), d.number));
  }
  if (channel.names.empty()) return;
  channel.shape = {channel.names.size()};
  std::vector<double> values;
  for (int e = 0; e < batch_.environments(); ++e)
    for (int k = 0; k < std::ssize(channel.names); ++k)
      values.push_back(batch_.randomized_value(e, k));
  recording_.tables.push_back({std::move(channel), std::move(values)});
}

void Recorder::add_task() {
  recording_.groups.push_back({"task", {{"success", task_->success}}});
  const auto at = [](Read read) {
    return Source{When::action, kAlways, false, 1, std::move(read)};
  };
  add({.name = "task/action",
       .shape = {environments_, task_->action.size()},
       .more = {{"unit", task_->action.unit}, {"meaning", task_->action.meaning}}},
      at([this](auto, int) { return std::span<const double>(data_->action); }));
  add_steps("task/step",
            options_.outputs.states.given() ? "steps of this run before the end of each action"
                                            : "row of /q after each action",
            at({}));
  add({.name = "task/reward", .shape = {environments_}},
      at([this](auto, int) { return std::span<const double>(data_->reward); }));
  const auto flag = [&](const char* name, std::vector<std::uint8_t> EnvironmentData::*member) {
    add({.name = name, .type = NumberType::int8, .shape = {environments_}},
        at([this, member](auto, int) { return flags(data_->*member); }));
  };
  flag("task/terminated", &EnvironmentData::terminated);
  flag("task/truncated", &EnvironmentData::truncated);
  flag("task/success", &EnvironmentData::success);
}

std::span<double> Recorder::part(std::span<double> all, int environment) const {
  const std::size_t width = all.size() / environments_;
  return all.subspan(as_size(environment) * width, width);
}

void Recorder::resize_buffers() {
  const std::size_t e = environments_;
  q_.resize(e * as_size(model_.nq()));
  v_.resize(e * as_size(model_.nv()));
  pose_.resize(e * bodies_ * kPoseWidth);
  twist_.resize(e * bodies_ * kTwistWidth);
  if (options_.outputs.end_effectors)
    end_effectors_.resize(e * model_.end_effectors().size() * kPositionWidth);
  shear_.resize(std::min<std::size_t>(e, kernels::kBlock) * 3 * shear_points_.count());
  iterations_.resize(e);
  status_.resize(e);
}

void Recorder::begin(std::span<const double> u, const StepTally& tally, const EnvironmentData* data,
                     BlockThreads& threads, RowSink& sink) {
  u_ = u, tally_ = &tally, data_ = data, threads_ = &threads, sink_ = &sink;
  while (readouts_.size() < steppers_.size()) readouts_.emplace_back(model_, options_.precision);
  resize_buffers();
  if (options_.outputs.audit) {
    audit_.emplace(batch_, steppers_.front().timestep());
    audit_->start();
  }
  write(When::step, 0);
  write(When::row, 0);
}

void Recorder::before_step() {
  if (audit_) audit_->before(u_);
}

void Recorder::after_step(std::int64_t t) {
  if (audit_) audit_->after(u_, *tally_);
  write(When::step, t);
}

void Recorder::write(When when, std::int64_t t) {
  row_ = t;
  for (std::size_t k = 0; k < sources_.size(); ++k) {
    const Source& source = sources_[k];
    if (source.when != when || !due(source, t)) continue;
    for (int part = 0; part < source.parts; ++part) sink_->write(t, k, source.read(t, part));
  }
}

std::int64_t Recorder::loads_not_carried() const {
  std::int64_t sum = 0;
  for (const Readout& readout : readouts_) sum += readout.loads_not_carried();
  return sum;
}

std::optional<EnergyBalanceSummary> Recorder::audit() const {
  if (!audit_) return {};
  return audit_->summary();
}

}  // namespace tangere
