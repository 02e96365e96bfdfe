// SPDX-License-Identifier: Apache-2.0
// A tape of the scene as a task. Numbers and points that change are put into the scene's compiled
// form, or the scene is compiled again.
#include "python/module/scene_tape.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/derivative/block_cotangent.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "engine/derivative/tactile_point_numbers.hpp"
#include "engine/rows/episode_channels.hpp"
#include "engine/scene/scene_faults.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/variable_numbers.hpp"
#include "engine/step/displacement.hpp"
#include "engine/step/shear_state_arrays.hpp"
#include "kernels/numbers/block.hpp"
#include "python/module/batch_arrays.hpp"

namespace tangere::python {

namespace {

constexpr std::size_t kPose = 7;

void check_finite(std::span<const double> numbers, const char* what) {
  if (!std::ranges::all_of(numbers, [](double x) { return std::isfinite(x); }))
    throw InputError(
        fmt::format("{} with numbers that are not finite; expected finite ones", what));
}

/// The scene with the changes (points, 7) of its sensors' points.
Scene with_points(Scene scene, const Model& model, std::span<const double> moved) {
  for (std::size_t s = 0; s < scene.sensors.size() && !moved.empty(); ++s) {
    const std::size_t numbers = kPointNumbers * as_size(model.sensors()[s].points);
    add_to_points(scene.sensors[s], moved.first(numbers));
    for (const TactilePoint& point : scene.sensors[s].points)
      if (std::ranges::any_of(point.factors, [](double x) { return x < 0; }))
        throw InputError(
            fmt::format("a point of '{}' with a negative coefficient; expected a "
                        "change that leaves 0 or more",
                        scene.sensors[s].name));
    moved = moved.subspan(numbers);
  }
  return scene;
}

/// Whether a number that has a derivative is the same in all environments: contact points follow
/// from a size, and <randomize> does not take every number.
bool is_shared(const Scene& scene, const std::string& name) {
  for (const SceneNumber& number : variable_numbers(scene)) {
    if (name_of(number) != name) continue;
    if (number.owner != NumberOwner::body || number.field == NumberField::density) return false;
    try {
      Scene other = scene;
      let_vary(other, number);
      static_cast<void>(Model(other));
      return false;
    } catch (const InputError&) {
      return true;
    }
  }
  const NumberGradients numbers{Model(scene)};
  return std::ranges::count(numbers.infos(), name, &NumberInfo::name) > 0;
}

std::vector<std::string> own_names(const Scene& scene, std::vector<std::string> names) {
  std::erase_if(names, [&](const std::string& name) { return is_shared(scene, name); });
  return names;
}

/// Why a number that may vary has no derivative, where a rule says it (docs/gradients.md).
std::string_view missing_derivative(const Scene& scene, const std::string& name) {
  for (const SceneNumber& number : variable_numbers(scene)) {
    if (name_of(number) != name) continue;
    if (number.owner == NumberOwner::body && number.field >= NumberField::radius)
      return ": a size has none where the body touches with ks, carries a sensor with feedback, or "
             "nothing depends on the size";
    if (number.field == NumberField::lim_stiffness) return ": its joint has no lim";
  }
  return "";
}

}  // namespace

SceneTape::Taped::Taped(const Scene& scene, const TapeArguments& a)
    : task(with_varying(scene, own_names(scene, a.parameters)), a.every,
           static_cast<int>(a.options.length), a.readings),
      tape(task, a.environments, a.options),
      shear_points(shear_state_arrays(task.model()).count()) {
  const NumberGradients numbers(task.model());
  for (const std::string& name : a.parameters) {
    const auto at = std::ranges::find(numbers.infos(), name, &NumberInfo::name);
    if (at == numbers.infos().end())
      throw InputError(fmt::format("'{}' has no derivative{}; expected another number", name,
                                   missing_derivative(scene, name)));
    rows.push_back(as_size(at - numbers.infos().begin()));
    units.push_back(at->unit);
    if (randomization_of(task.model().scene(), at->number) < 0) shared.emplace(name, at->number);
  }
  number_count = as_size(numbers.count());
}

SceneTape::SceneTape(TapeArguments arguments) { compile(std::move(arguments), {}, {}); }

void SceneTape::compile(TapeArguments arguments, std::vector<double> moved, SharedNumbers shared) {
  Scene scene = arguments.scene;
  for (const auto& [name, value] : shared) {
    const SceneNumber& number = taped_->shared.at(name);
    if (const std::string fault = varying_value_fault(number, value); !fault.empty())
      throw InputError("'" + name + "': " + fault);
    number_in(scene, number) = value;
  }
  if (!moved.empty()) scene = with_points(std::move(scene), model(), moved);
  auto taped = std::make_unique<Taped>(scene, arguments);
  posed_.reset();
  numbers_.reset();
  taped_ = std::move(taped);
  arguments_ = std::move(arguments);
  moved_ = std::move(moved);
  shared_ = std::move(shared);
  draw_numbers();
  start({}, true);
}

std::size_t SceneTape::point_count() const {
  return arguments_.options.points ? as_size(tactile_points(model())) : 0;
}

std::vector<std::string> SceneTape::units() const { return taped_->units; }

void SceneTape::add_parameters(const std::vector<std::string>& names) {
  const InUse::Turn turn(in_use_);
  TapeArguments with = arguments_;
  for (const std::string& name : names)
    if (std::ranges::count(with.parameters, name) == 0) with.parameters.push_back(name);
  if (with.parameters.size() == arguments_.parameters.size()) return;
  with.options.parameters = true;
  const nb::gil_scoped_release free;
  compile(std::move(with), moved_, shared_);
}

void SceneTape::reset(const Whole<std::uint64_t>& seed, const TapeStart& given,
                      const std::optional<Argument<double>>& points, bool record) {
  const InUse::Turn turn(in_use_);
  const std::uint64_t draw = seed.value("seed");
  std::vector<double> moved;
  if (points) {
    const auto all = numbers_of(*points, {point_count(), kPointNumbers}, "points");
    check_finite(all, "points");
    if (std::ranges::any_of(all, [](double x) { return x != 0; }))
      moved.assign(all.begin(), all.end());
  }
  const nb::gil_scoped_release free;
  seed_ = draw;
  const SharedNumbers shared = given.numbers ? shared_in(*given.numbers) : SharedNumbers{};
  if (moved != moved_ || shared != shared_) compile(arguments_, moved, shared);
  draw_numbers();
  if (given.numbers) set_numbers(merged(*given.numbers, given.q && given.v));
  drawn_ = now_;
  taped_->task.set_varying(drawn_);
  start(given, record);
}

/// Starts the tape with the numbers that are set.
void SceneTape::start(const TapeStart& given, bool record) {
  std::vector<double> q, v;
  std::span<const double> shear;
  if (given.q) q = rows_of(*given.q, count(), nq(), "q");
  if (given.v) v = rows_of(*given.v, count(), nv(), "v");
  if (given.shear_state) {
    shear = numbers_of(*given.shear_state, {count(), shear_points(), 3}, "shear_state");
    check_finite(shear, "shear_state");
  }
  sheared_ = !shear.empty();
  tape().reset(seed_, 0, record);
  given_.clear();
  expect_reverse();
  if (given.q || given.v || !shear.empty()) {
    if (!given.q) q.assign(tape().q().begin(), tape().q().end());
    if (!given.v) v.assign(tape().v().begin(), tape().v().end());
    check_state(model(), q, v);
    normalise_quaternions(q);
    tape().displace(q, v, shear);
  }
  first_q_.assign(tape().q().begin(), tape().q().end());
}

void SceneTape::step(const Argument<double>& controls, const std::optional<NamedValues>& numbers) {
  const InUse::Turn turn(in_use_);
  const auto rows = numbers_of(controls, controls_shape(), "controls");
  const nb::gil_scoped_release free;
  tape().check_step(rows);
  std::vector<std::string> names;
  if (numbers) {
    refuse_sensors(*numbers);
    for (const auto& [name, value] : shared_in(*numbers))
      if (value != number_in(model().scene(), taped_->shared.at(name)))
        throw InputError(
            fmt::format("'{}' of {} in a step; expected it in reset(): it is the same "
                        "in all environments and steps",
                        name, value));
    set_numbers(merged(*numbers, false));
    for (const auto& [name, value] : *numbers) names.push_back(name);
  }
  tape().step(rows, numbers ? now_ : std::vector<double>{});
  given_.push_back(std::move(names));
  expect_reverse();
}

void SceneTape::check_step(const Argument<double>& controls) {
  const InUse::Turn turn(in_use_);
  const auto rows = numbers_of(controls, controls_shape(), "controls");
  tape().check_step(rows);
}

Array<double> SceneTape::observations() {
  const InUse::Turn turn(in_use_);
  std::span<double> to;
  auto array = new_array<double>({count(), width()}, to);
  const nb::gil_scoped_release free;
  tape().get_observations(to);
  return array;
}

Array<std::int8_t> SceneTape::status() {
  const InUse::Turn turn(in_use_);
  std::vector<std::int8_t> all;
  for (int e = 0; e < tape().environments(); ++e)
    all.push_back(static_cast<std::int8_t>(tape().status(e)));
  return array_of<std::int8_t>({count()}, std::span<const std::int8_t>(all));
}

/// Adds derivatives by all numbers, while those of a step held, to what later steps left. Returns
/// those by the parameters, (E, names), that it was given; the others are left to earlier steps.
std::vector<double> SceneTape::collect(std::span<const double> all,
                                       const std::vector<std::string>& given) {
  const std::size_t names = parameters().size();
  std::vector<double> own(count() * names);
  carried_.resize(own.size());
  for (std::size_t k = 0; k < names; ++k) {
    const bool is_given = std::ranges::count(given, parameters()[k]) > 0;
    for (std::size_t e = 0; e < count(); ++e) {
      double& carried = carried_[e * names + k];
      carried += all[e * taped_->number_count + taped_->rows[k]];
      if (is_given) own[e * names + k] = std::exchange(carried, 0.0);
    }
  }
  return own;
}

/// The next reverse pass begins at the last step.
void SceneTape::expect_reverse() {
  left_ = given_.size();
  carried_.clear();
}

nb::tuple SceneTape::reverse(const Argument<double>& observation_bar) {
  const InUse::Turn turn(in_use_);
  const auto o = numbers_of(observation_bar, {count(), width()}, "derivatives by readings");
  std::span<double> control_bar;
  auto controls = new_array<double>(controls_shape(), control_bar);
  const std::size_t names = parameters().size();
  std::vector<double> all(names == 0 ? 0 : count() * taped_->number_count);
  {
    const nb::gil_scoped_release free;
    tape().reverse({o}, control_bar, all);
  }
  const std::vector<double> own = collect(all, given_[--left_]);
  return nb::make_tuple(controls, array_of<double>({count(), names}, std::span<const double>(own)));
}

nb::tuple SceneTape::reverse_start(const Argument<double>& observation_bar) {
  const InUse::Turn turn(in_use_);
  const auto o = numbers_of(observation_bar, {count(), width()}, "derivatives by readings");
  const std::size_t names = parameters().size();
  std::span<double> q, v, points, shear;
  auto q_bar = new_array<double>({count(), nq()}, q), v_bar = new_array<double>({count(), nv()}, v),
       point_bar = new_array<double>({point_count(), kPointNumbers}, points),
       shear_bar = new_array<double>({sheared_ ? count() : 0, shear_points(), 3}, shear);
  std::vector<double> along(v.size()), all(names == 0 ? 0 : count() * taped_->number_count),
      each(arguments_.options.points ? count() * points.size() : 0);
  {
    const nb::gil_scoped_release free;
    tape().reverse_start({o}, {along, v, all, each, shear});
    std::ranges::fill(q, 0.0);
    std::ranges::fill(points, 0.0);
    for (std::size_t e = 0; e < count(); ++e) {
      add_along_coordinates(model(), std::span(first_q_).subspan(e * nq(), nq()),
                            std::span<const double>(along).subspan(e * nv(), nv()),
                            q.subspan(e * nq(), nq()));
      if (!each.empty()) add_points(e, std::span(each).subspan(e * points.size()), points);
    }
  }
  const std::vector<double> own = collect(all, parameters());
  return nb::make_tuple(q_bar, v_bar, shear_bar, point_bar,
                        array_of<double>({count(), names}, std::span<const double>(own)));
}

void SceneTape::begin_reverse() {
  const InUse::Turn turn(in_use_);
  tape().begin_reverse();
  expect_reverse();
}

Array<double> SceneTape::varying() {
  const InUse::Turn turn(in_use_);
  return array_of<double>({count(), varying_count()}, std::span<const double>(now_));
}

/// Puts states into a batch of their own, with the numbers (E, varying_count()) that they had.
SceneTape::Posed& SceneTape::posed(const Argument<double>& q, const Argument<double>& v,
                                   const Argument<double>& varying) {
  std::vector<double> qs = rows_of(q, count(), nq(), "q");
  const std::vector<double> vs = rows_of(v, count(), nv(), "v");
  // A state may be older than the last parameters, whose columns come last.
  const std::size_t columns =
      varying.ndim() == 2 ? std::min(varying.shape(1), varying_count()) : varying_count();
  const auto numbers = numbers_of(varying, {count(), columns}, "numbers that vary");
  check_state(model(), qs, vs);
  normalise_quaternions(qs);
  if (!posed_) posed_.emplace(model(), arguments_.environments);

  for (std::size_t e = 0; e < count(); ++e) {
    std::vector<double> all(now_.begin() + std::ptrdiff_t(e * varying_count()),
                            now_.begin() + std::ptrdiff_t((e + 1) * varying_count()));
    std::ranges::copy(numbers.subspan(e * columns, columns), all.begin());
    posed_->batch.set_all_randomized(static_cast<int>(e), all);
    posed_->batch.set_state(static_cast<int>(e), std::span(qs).subspan(e * nq(), nq()),
                            std::span(vs).subspan(e * nv(), nv()));
  }
  return *posed_;
}

Array<double> SceneTape::bodies(const Argument<double>& q, const Argument<double>& v,
                                const Argument<double>& varying) {
  const InUse::Turn turn(in_use_);
  const std::size_t nb = as_size(model().nb());
  std::span<double> to;
  auto array = new_array<double>({count(), nb, kMotion}, to);
  const nb::gil_scoped_release free;
  Posed& states = posed(q, v, varying);
  std::vector<double> pose(kPose * nb), twist((kMotion - kPose) * nb);
  for (std::size_t e = 0; e < count(); ++e) {
    states.readout.bodies(states.batch, static_cast<int>(e), pose, twist);
    for (std::size_t b = 0; b < nb; ++b) {
      const auto own = to.subspan((e * nb + b) * kMotion, kMotion);
      std::copy_n(pose.begin() + std::ptrdiff_t(kPose * b), kPose, own.begin());
      std::copy_n(twist.begin() + std::ptrdiff_t((kMotion - kPose) * b), kMotion - kPose,
                  own.begin() + kPose);
    }
  }
  return array;
}

nb::tuple SceneTape::reverse_bodies(const Argument<double>& q, const Argument<double>& v,
                                    const Argument<double>& varying,
                                    const Argument<double>& body_bar) {
  const InUse::Turn turn(in_use_);
  using kernels::kBlock;
  const std::size_t nb = as_size(model().nb());
  const auto bar = numbers_of(body_bar, {count(), nb, kMotion}, "derivatives by bodies");
  std::span<double> q_bar_data, v_bar_data;
  auto q_bar = new_array<double>({count(), nq()}, q_bar_data),
       v_bar = new_array<double>({count(), nv()}, v_bar_data);
  const auto work = [&] {
    const nb::gil_scoped_release free;
    Posed& states = posed(q, v, varying);
    std::ranges::fill(q_bar_data, 0.0);
    std::vector<double> at(nq()), along(nv());
    BlockCotangent c;
    for (std::size_t first = 0; first < count(); first += kBlock) {
      const auto lanes = std::min(count() - first, as_size(kBlock));
      for (auto* x : {&c.q, &c.v}) x->assign(nv() * kBlock, 0.0);
      states.pullback.place(states.batch, static_cast<int>(first / kBlock));
      states.pullback.clear();
      for (std::size_t l = 0; l < lanes; ++l)
        for (std::size_t b = 0; b < nb; ++b) {
          const auto own = bar.subspan(((first + l) * nb + b) * kMotion, kMotion);
          states.pullback.body(static_cast<int>(l), static_cast<int>(b), own.first(kPose),
                               own.subspan(kPose));
        }
      states.pullback.finish(c);
      for (std::size_t l = 0; l < lanes; ++l) {
        const std::size_t e = first + l;
        for (std::size_t i = 0; i < nv(); ++i) {
          along[i] = c.q[i * kBlock + l];
          v_bar_data[e * nv() + i] = c.v[i * kBlock + l];
        }
        states.batch.get_q(static_cast<int>(e), at);
        add_along_coordinates(model(), at, along, q_bar_data.subspan(e * nq(), nq()));
      }
    }
  };
  work();
  return nb::make_tuple(q_bar, v_bar);
}

/// Adds an environment's derivatives by its points' own numbers to those by the change of the
/// scene's. That change is of factors, so it is in proportion to a coefficient that varies.
void SceneTape::add_points(std::size_t environment, std::span<const double> own,
                           std::span<double> points) const {
  const Scene& scene = model().scene();
  std::size_t at = 0;
  for (std::size_t s = 0; s < scene.sensors.size(); ++s) {
    std::array<double, kPointNumbers> scale;
    scale.fill(1);
    for (int k = 0; k < kPointNumbers - 3; ++k) {
      const SceneNumber number{NumberOwner::tactile, coefficient_field(k), scene.sensors[s].name};
      const int varying = randomization_of(scene, number);
      const double nominal = scene.sensors[s].coefficients[as_size(k)];
      if (varying >= 0 && nominal != 0)
        scale[as_size(3 + k)] = drawn_[environment * varying_count() + as_size(varying)] / nominal;
    }
    for (int p = 0; p < model().sensors()[s].points; ++p)
      for (std::size_t k = 0; k < scale.size(); ++k, ++at) points[at] += scale[k] * own[at];
  }
}

/// Derivatives by points are for the coefficients of the start alone.
void SceneTape::refuse_sensors(const NamedValues& values) const {
  if (point_count() == 0) return;
  for (const auto& [name, value] : values)
    if (name.starts_with("tactile "))
      throw InputError(fmt::format(
          "'{}' in a step of a simulation with points=True; expected it in reset()", name));
}

/// Those of the values that are the same in all environments. Throws InputError where they differ.
SharedNumbers SceneTape::shared_in(const NamedValues& values) const {
  SharedNumbers shared;
  for (const auto& [name, given] : values) {
    if (!taped_->shared.contains(name)) continue;
    const auto all = given.size() == 1 ? std::span<const double>(given.data(), 1)
                                       : numbers_of(given, {count()}, name.c_str());
    for (const double other : all)
      if (other != all[0])
        throw InputError(
            fmt::format("'{}' of {} and {}; expected one value: it is the same in "
                        "all environments",
                        name, all[0], other));
    shared.emplace(name, all[0]);
  }
  return shared;
}

SharedNumbers SceneTape::shared() const {
  SharedNumbers all;
  for (const auto& [name, number] : taped_->shared)
    all.emplace(name, number_in(model().scene(), number));
  return all;
}

/// The numbers of now with some of them changed, (E, varying_count()). `placed`: numbers of the
/// starting state are allowed, because q and v are given.
std::vector<double> SceneTape::merged(const NamedValues& values, bool placed) const {
  std::vector<double> all = now_;
  const std::vector<std::string> varying = varying_names(model().scene());
  for (const auto& [name, given] : values) {
    if (taped_->shared.contains(name)) continue;
    const auto at = std::ranges::find(varying, name);
    if (at == varying.end())
      throw InputError(
          fmt::format("no number of the scene that varies is named '{}'; expected "
                      "one of {}",
                      name, fmt::join(varying, ", ")));
    if (!placed && !numbers_->is_parameter(static_cast<int>(at - varying.begin())))
      throw InputError(fmt::format(
          "'{}' is of the starting state; expected a parameter, or q and v as well", name));
    const bool one = given.size() == 1;
    const auto own =
        one ? std::span<const double>(given.data(), 1) : numbers_of(given, {count()}, name.c_str());
    for (std::size_t e = 0; e < count(); ++e)
      all[e * varying_count() + as_size(at - varying.begin())] = own[one ? 0 : e];
  }
  return all;
}

/// Sets the numbers of now. Throws InputError for one that the scene could not have.
void SceneTape::set_numbers(std::vector<double> numbers) {
  for (std::size_t e = 0; e < count() && varying_count() > 0; ++e)
    numbers_->set_all_randomized(static_cast<int>(e), std::span<const double>(numbers).subspan(
                                                          e * varying_count(), varying_count()));
  now_ = std::move(numbers);
}

/// Draws all numbers that vary.
void SceneTape::draw_numbers() {
  now_.clear();
  if (varying_count() > 0) {
    numbers_.emplace(model(), arguments_.environments, seed_);
    for (int e = 0; e < arguments_.environments; ++e)
      for (std::size_t k = 0; k < varying_count(); ++k)
        now_.push_back(numbers_->randomized_value(e, static_cast<int>(k)));
  }
  drawn_ = now_;
  taped_->task.set_varying(drawn_);
}

void SceneTape::normalise_quaternions(std::span<double> q) const {
  const auto names = model().q_names();
  for (std::size_t i = 0; i < q.size(); ++i) {
    if (!names[i % names.size()].ends_with(".qw")) continue;
    const double length = std::hypot(std::hypot(q[i], q[i + 1]), std::hypot(q[i + 2], q[i + 3]));
    if (std::abs(length - 1) < 1e-15) continue;
    for (std::size_t k = 0; k < 4; ++k) q[i + k] /= length;
  }
}

}  // namespace tangere::python
