// SPDX-License-Identifier: Apache-2.0
// Every block is played again with a tape, the same bits as those that are stored.
#include "tasks/gradients/episode_gradients.hpp"

#include <algorithm>

#include "engine/derivative/number_gradients.hpp"
#include "tasks/gradients/gradient_block.hpp"
#include "tasks/gradients/row_jacobians.hpp"
#include "tasks/gradients/task_gradient_block.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

/// Of a task: one that a thread plays and those that wait for an earlier one to be written
/// (EpisodeOptions::blocks_in_flight).
constexpr double kBlocksOfThread = 3;

std::size_t size(std::int64_t n) { return static_cast<std::size_t>(n); }

std::vector<std::string> texts(std::span<const std::string> all) {
  return {all.begin(), all.end()};
}

/// Units of displacements along dofs.
std::vector<std::string> displacement_units(const Model& model) {
  std::vector<std::string> units;
  for (const std::string& unit : model.v_units())
    units.emplace_back(unit.substr(0, unit.rfind("/s")));
  return units;
}

struct Named {
  std::vector<std::string> names, units;
  void append(const Named& other) {
    names.insert(names.end(), other.names.begin(), other.names.end());
    units.insert(units.end(), other.units.begin(), other.units.end());
  }
};
Named displacements(const Model& model) {
  Named n{{}, displacement_units(model)};
  for (const auto& name : model.v_names())
    n.names.push_back("displacement of " + std::string(name));
  return n;
}
Named velocities(const Model& model) { return {texts(model.v_names()), texts(model.v_units())}; }
Named actions_of(const Model& model) {
  return {texts(model.u_names()), std::vector<std::string>(size(model.nu()), "1")};
}
Named actions_of(const Task& task) {
  Named n;
  for (std::size_t k = 0; k < task.spec().action.size(); ++k) {
    n.names.push_back(task.spec().action.name + "[" + std::to_string(k) + "]");
    n.units.push_back(task.spec().action.unit);
  }
  return n;
}

GradientArray array(const char* name, std::vector<std::uint64_t> shape, bool by_row,
                    std::string meaning, Named by) {
  return {
      name, std::move(shape), by_row, std::move(meaning), std::move(by.names), std::move(by.units)};
}

/// `of`: "the return", "the loss".
std::vector<GradientArray> arrays_of_return(const Model& model, const Named& actions,
                                            const std::string& of) {
  const std::uint64_t nv = size(model.nv());
  Named numbers;
  const NumberGradients parameters(model);
  for (const NumberInfo& info : parameters.infos()) {
    numbers.names.push_back(info.name);
    numbers.units.push_back(info.unit);
  }
  std::vector<GradientArray> all;
  all.push_back(array("grad_actions", {actions.names.size()}, true,
                      "derivative of " + of + " by the action of each row", actions));
  all.push_back(
      array("grad_q", {nv}, false,
            "derivative of " + of +
                " by the first state's displacement along the dofs, rotations on the right",
            displacements(model)));
  all.push_back(array("grad_v", {nv}, false,
                      "derivative of " + of + " by the first state's velocity", velocities(model)));
  if (!numbers.names.empty())
    all.push_back(array("grad_numbers", {numbers.names.size()}, false,
                        "derivative of " + of + " by the scene's numbers", numbers));
  return all;
}

std::vector<GradientArray> arrays_of_jacobians(const Model& model, const Named& actions) {
  const std::uint64_t n = 2 * size(model.nv());
  Named state = displacements(model);
  state.append(velocities(model));
  const std::string of =
      "derivative of the next row's state (displacement along the dofs, then velocity)";
  std::vector<GradientArray> all;
  all.push_back(array("grad_state_by_state", {n, n}, true, of + " by the row's state", state));
  if (model.integrator().scheme().needs_history())
    all.push_back(array("grad_state_by_previous", {n, n}, true,
                        of + " by the state one step before the row's, which " +
                            to_string(model.integrator()) + " goes on from",
                        state));
  all.push_back(array("grad_state_by_action", {n, actions.names.size()}, true,
                      of + " by the row's action", actions));
  return all;
}

/// Zeros for `episodes` episodes of at most `rows` rows.
void make_room(const std::vector<GradientArray>& arrays, int episodes, std::int64_t rows,
               std::vector<std::vector<double>>& out) {
  out.resize(arrays.size());
  for (std::size_t k = 0; k < arrays.size(); ++k)
    out[k].assign(size(episodes) * arrays[k].width() * (arrays[k].by_row ? size(rows) : 1), 0.0);
}

double bytes_of(const std::vector<GradientArray>& arrays, std::int64_t rows) {
  double numbers = 0;
  for (const GradientArray& a : arrays)
    numbers += double(a.width()) * (a.by_row ? double(rows) : 1);
  return 8.0 * kBlock * numbers;
}

/// A lane's row into the arrays of Jacobians.
void put_row(const RowJacobian& j, bool with_previous, std::size_t row,
             std::vector<std::vector<double>>& out) {
  const auto put = [row](const std::vector<double>& from, std::vector<double>& to) {
    std::copy(from.begin(), from.end(),
              to.begin() + static_cast<std::ptrdiff_t>(row * from.size()));
  };
  put(j.state, out[0]);
  if (with_previous) put(j.previous, out[1]);
  put(j.others, out.back());
}

class SceneReturns : public EpisodeGradients {
 public:
  SceneReturns(const Model& model, const ControlProgram& controls, const EpisodeOptions& run,
               const GradientOptions& options, const RolloutLoss* loss,
               const std::vector<GradientArray>& arrays)
      : model_(model),
        controls_(controls),
        run_(run),
        options_(options),
        arrays_(arrays),
        block_(model, options, {&loss, 1}) {}

  void compute(std::int64_t first, int episodes, std::vector<std::vector<double>>& out) override {
    Batch batch(model_, episodes, run_.seed, first);
    std::vector<double> u(size(episodes) * size(model_.nu()));
    GradientSummary summary = empty_gradients(model_, episodes, options_, 1);
    std::vector<FailedEnvironment> failures;
    block_.run(
        batch, 0,
        [&](std::int64_t step, int e, std::span<double> to) {
          controls_.evaluate(step / run_.every * run_.every, first + e, to);
        },
        u, summary, failures);
    LossGradient& g = summary.losses[0];
    make_room(arrays_, episodes, run_.steps / run_.every, out);
    const std::size_t nu = size(model_.nu());
    for (std::size_t i = 0; i < g.u.size(); ++i) {  // an action is held for K steps
      const std::size_t step = i / nu;
      out[0][step / size(run_.every) * nu + i % nu] += g.u[i];
    }
    out[1] = std::move(g.q);
    out[2] = std::move(g.v);
    if (!g.parameters.empty()) out[3] = std::move(g.parameters);
    out.back() = std::move(g.value);
  }

 private:
  const Model& model_;
  const ControlProgram& controls_;
  const EpisodeOptions& run_;
  GradientOptions options_;
  std::vector<GradientArray> arrays_;
  GradientBlock block_;
};

class SceneJacobians : public EpisodeGradients {
 public:
  SceneJacobians(const Model& model, const ControlProgram& controls, const EpisodeOptions& run,
                 const std::vector<GradientArray>& arrays)
      : model_(model),
        controls_(controls),
        run_(run),
        arrays_(arrays),
        stepper_(model),
        jacobians_(model),
        tape_(model, stepper_.integrator(), run.every),
        chains_(kBlock, RowChain(model.nv(), size(model.nu()))),
        held_(size(model.nu()) * (2 * size(model.nv()) + size(model.nu()))) {
    const std::size_t nu = size(model.nu()), nv = size(model.nv());
    for (std::size_t k = 0; k < nu; ++k) held_[k * (2 * nv + nu) + 2 * nv + k] = 1;
  }

  void compute(std::int64_t first, int episodes, std::vector<std::vector<double>>& out) override {
    const std::int64_t rows = run_.steps / run_.every;
    const std::size_t nu = size(model_.nu());
    Batch batch(model_, episodes, run_.seed, first);
    make_room(arrays_, episodes, rows, out);
    std::vector<double> u(size(episodes) * nu);
    StepJacobian step;
    RowJacobian row;
    for (std::int64_t j = 0; j < rows; ++j) {
      for (int e = 0; e < episodes; ++e)
        controls_.evaluate(j * run_.every, first + e, std::span(u).subspan(size(e) * nu, nu));
      tape_.start(batch, 0);
      for (int k = 0; k < run_.every; ++k) stepper_.step_block(batch, 0, u, &tape_);
      for (int e = 0; e < episodes; ++e) chains_[size(e)].begin();
      for (int k = 0; k < run_.every; ++k) {
        jacobians_.evaluate(batch, 0, tape_, k, u);
        for (int e = 0; e < episodes; ++e) {
          jacobians_.get(e, step);
          chains_[size(e)].add(step, held_);
        }
      }
      for (int e = 0; e < episodes; ++e) {
        chains_[size(e)].get(row);
        put_row(row, out.size() == 3, size(e) * size(rows) + size(j), out);
      }
    }
  }

 private:
  const Model& model_;
  const ControlProgram& controls_;
  const EpisodeOptions& run_;
  std::vector<GradientArray> arrays_;
  Stepper stepper_;
  StepJacobians jacobians_;
  BlockTape tape_;
  std::vector<RowChain> chains_;
  std::vector<double> held_;  // (nu, 2 nv + nu): controls are the action
};

class TaskReturns : public EpisodeGradients {
 public:
  TaskReturns(const Task& task, const TaskActions& actions, const TaskGradientOptions& options,
              const std::vector<GradientArray>& arrays)
      : task_(task), actions_(actions), options_(options), arrays_(arrays), block_(task, options) {}

  void compute(std::int64_t first, int episodes, std::vector<std::vector<double>>& out) override {
    options_.episodes = episodes;
    TaskGradients g = empty_task_gradients(task_, options_);
    std::vector<LostEpisode> lost;
    block_.run(first, episodes, actions_, 0, g, lost);
    make_room(arrays_, episodes, options_.actions, out);
    out[0] = std::move(g.by_action);
    out[1] = std::move(g.by_q);
    out[2] = std::move(g.by_v);
    if (out.size() > 3) out[3] = std::move(g.by_parameter);
  }

 private:
  const Task& task_;
  const TaskActions& actions_;
  TaskGradientOptions options_;
  std::vector<GradientArray> arrays_;
  TaskGradientBlock block_;
};

class TaskJacobians : public EpisodeGradients {
 public:
  TaskJacobians(const Task& task, const TaskActions& actions, const EpisodeOptions& run,
                const std::vector<GradientArray>& arrays)
      : task_(task),
        actions_(actions),
        run_(run),
        arrays_(arrays),
        rollout_(task, {}, run.precision),
        jacobians_(task, {}),
        tape_(task.model(), rollout_.integrator(), task.spec().steps_per_action),
        record_(task) {}

  void compute(std::int64_t first, int episodes, std::vector<std::vector<double>>& out) override {
    const std::int64_t rows = task_.spec().horizon;
    make_room(arrays_, episodes, rows, out);
    std::vector<std::int64_t> numbers;
    for (int e = 0; e < episodes; ++e) numbers.push_back(first + e);
    rollout_.start(run_.seed, numbers);
    for (std::int64_t a = 0; a < rows && rollout_.running(); ++a) {
      rollout_.choose(actions_, record_);
      rollout_.begin(record_);
      rollout_.take_steps(&tape_);
      jacobians_.evaluate(rollout_, record_, a, tape_);
      for (int e = 0; e < episodes; ++e)
        if (record_.taken[size(e)])
          put_row(jacobians_.of(e), out.size() == 3, size(e) * size(rows) + size(a), out);
      rollout_.conclude();
    }
  }

 private:
  const Task& task_;
  const TaskActions& actions_;
  const EpisodeOptions& run_;
  std::vector<GradientArray> arrays_;
  TaskRollout rollout_;
  ActionJacobians jacobians_;
  BlockTape tape_;
  ActionRecord record_;
};

}  // namespace

const char* to_string(GradientKind kind) {
  switch (kind) {
    case GradientKind::none: return "none";
    case GradientKind::returns: return "return";
    case GradientKind::jacobians: return "jacobians";
  }
  return "unknown";
}

GradientPlan scene_gradients(const Model& model, const ControlProgram& controls,
                             const EpisodeOptions& run, GradientKind kind, const RolloutLoss* loss,
                             const std::string& loss_meaning, double tape_bytes) {
  GradientPlan plan;
  if (kind == GradientKind::none) return plan;
  const std::int64_t rows = run.steps / run.every;
  const Named actions = actions_of(model);
  if (kind == GradientKind::jacobians) {
    plan.arrays = arrays_of_jacobians(model, actions);
    plan.bytes = bytes_of(plan.arrays, rows) +
                 double(Stepper::workspace_bytes(model)) * (2 + 2 * model.nv());
    plan.make = [&model, &controls, &run,
                 arrays = plan.arrays]() -> std::unique_ptr<EpisodeGradients> {
      return std::make_unique<SceneJacobians>(model, controls, run, arrays);
    };
    return plan;
  }
  plan.arrays = arrays_of_return(model, actions, "the loss");
  plan.arrays.push_back(array("loss", {1}, false, loss_meaning, {}));
  GradientOptions options;
  options.steps = run.steps;
  options.precision = run.precision;
  options.parameters = true;
  options.tape_bytes = tape_bytes;
  plan.bytes = bytes_of(plan.arrays, rows) + gradient_bytes(model, kBlock, options, 1);
  plan.make = [&model, &controls, &run, options, loss,
               arrays = plan.arrays]() -> std::unique_ptr<EpisodeGradients> {
    return std::make_unique<SceneReturns>(model, controls, run, options, loss, arrays);
  };
  return plan;
}

GradientPlan task_episode_gradients(const Task& task, const TaskActions& actions,
                                    const EpisodeOptions& run, GradientKind kind,
                                    double tape_bytes) {
  GradientPlan plan;
  if (kind == GradientKind::none) return plan;
  const Model& model = task.model();
  if (kind == GradientKind::jacobians) {
    plan.arrays = arrays_of_jacobians(model, actions_of(task));
    plan.bytes = kBlocksOfThread * bytes_of(plan.arrays, task.spec().horizon) +
                 double(Stepper::workspace_bytes(model)) * (2 + 2 * model.nv());
    plan.make = [&task, &actions, &run,
                 arrays = plan.arrays]() -> std::unique_ptr<EpisodeGradients> {
      return std::make_unique<TaskJacobians>(task, actions, run, arrays);
    };
    return plan;
  }
  plan.arrays = arrays_of_return(model, actions_of(task), "the return");
  TaskGradientOptions options;
  options.episodes = kBlock;
  options.seed = run.seed;
  options.actions = task.spec().horizon;
  options.precision = run.precision;
  options.parameters = true;
  options.tape_bytes = tape_bytes;
  plan.bytes = kBlocksOfThread * bytes_of(plan.arrays, task.spec().horizon) +
               task_gradient_bytes(task, options);
  plan.make = [&task, &actions, options,
               arrays = plan.arrays]() -> std::unique_ptr<EpisodeGradients> {
    return std::make_unique<TaskReturns>(task, actions, options, arrays);
  };
  return plan;
}

void GradientSink::prepare(const EpisodeRows& rows) {
  if (rows.rows > rows.action_rows) {  // the last piece: the block is complete
    std::unique_ptr<EpisodeGradients> worker;
    {
      const std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        worker = std::move(idle_.back());
        idle_.pop_back();
      }
    }
    if (!worker) worker = plan_.make();
    Block block;
    worker->compute(rows.first_episode, rows.episodes, block.numbers);
    block.spans.assign(block.numbers.begin(), block.numbers.end());
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(worker));
    blocks_[rows.first_episode] = std::move(block);
  }
  next_.prepare(with_gradients(rows));
}

void GradientSink::write(const EpisodeRows& rows) { next_.write(with_gradients(rows)); }

void GradientSink::finish(std::int64_t first_episode, std::span<const FailedEpisode> failures) {
  {
    const std::lock_guard lock(mutex_);
    blocks_.erase(first_episode);
  }
  next_.finish(first_episode, failures);
}

EpisodeRows GradientSink::with_gradients(const EpisodeRows& rows) {
  EpisodeRows out = rows;
  if (rows.rows <= rows.action_rows) return out;
  const std::lock_guard lock(mutex_);
  out.gradients = blocks_.at(rows.first_episode).spans;
  return out;
}

}  // namespace tangere
