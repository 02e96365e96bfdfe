// SPDX-License-Identifier: Apache-2.0
// Plays every block again with a tape. The repeated steps give the same bits as the stored ones.
#include "tasks/gradients/episode_gradients.hpp"

#include <algorithm>
#include <memory>
#include <numeric>

#include "engine/base/as_size.hpp"
#include "engine/derivative/number_gradients.hpp"
#include "tasks/gradients/gradients.hpp"
#include "tasks/gradients/row_jacobians.hpp"
#include "tasks/gradients/scene_block.hpp"
#include "tasks/gradients/task_block.hpp"

namespace tangere {
namespace {

using kernels::kBlock;

/// Blocks per thread for a task: the one that the thread plays and those that wait until an earlier
/// one is written (EpisodeOptions::blocks_in_flight).
constexpr double kBlocksOfThread = 3;

std::vector<std::string> texts(std::span<const std::string> all) {
  return {all.begin(), all.end()};
}

/// Units of displacements along the dofs.
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
  return {texts(model.u_names()), std::vector<std::string>(as_size(model.nu()), "1")};
}
Named actions_of(const Task& task) {
  Named n;
  for (std::size_t k = 0; k < task.spec().action.size(); ++k) {
    n.names.push_back(task.spec().action.name + "[" + std::to_string(k) + "]");
    n.units.push_back(task.spec().action.unit);
  }
  return n;
}

GradientArray array(const char* name, std::vector<std::uint64_t> shape, bool per_row,
                    std::string meaning, Named by) {
  return {name,
          std::move(shape),
          per_row,
          std::move(meaning),
          std::move(by.names),
          std::move(by.units)};
}

/// Arrays for the derivatives of `of`: "the return" or "the loss".
std::vector<GradientArray> arrays_of_return(const Model& model, const Named& actions,
                                            const std::string& of) {
  const std::uint64_t nv = as_size(model.nv());
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
  const std::uint64_t n = 2 * as_size(model.nv());
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

/// Makes zeros for `episodes` episodes of at most `rows` rows.
void make_room(const std::vector<GradientArray>& arrays, int episodes, std::int64_t rows,
               std::vector<std::vector<double>>& out) {
  out.resize(arrays.size());
  for (std::size_t k = 0; k < arrays.size(); ++k)
    out[k].assign(as_size(episodes) * arrays[k].width() * (arrays[k].per_row ? as_size(rows) : 1),
                  0.0);
}

double bytes_of(const std::vector<GradientArray>& arrays, std::int64_t rows) {
  double numbers = 0;
  for (const GradientArray& a : arrays)
    numbers += double(a.width()) * (a.per_row ? double(rows) : 1);
  return 8.0 * kBlock * numbers;
}

/// Writes a lane's row into the arrays of Jacobians.
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

EpisodeGradients scene_returns(const Model& model, const ControlProgram& controls,
                               const EpisodeOptions& run, const TapeOptions& options,
                               const RolloutLoss* loss) {
  const auto block = std::make_shared<SceneBlock>(model, options, std::span(&loss, 1));
  return [&model, &controls, &run, options, block](std::int64_t first, int episodes, auto& out) {
    Batch batch(model, episodes, run.seed, first);
    const std::size_t nu = as_size(model.nu());
    std::vector<double> u(as_size(episodes) * nu);
    GradientSummary summary = empty_gradients(model, episodes, options, 1);
    std::vector<FailedEnvironment> failures;
    block->run(
        batch, 0,
        [&](std::int64_t step, int e, std::span<double> to) {
          controls.evaluate(step / run.every * run.every, first + e, to);
        },
        u, summary, failures);
    LossGradient& g = summary.losses[0];
    for (std::size_t i = 0; i < g.u.size(); ++i)  // an action is held for K steps
      out[0][i / nu / as_size(run.every) * nu + i % nu] += g.u[i];
    out[1] = std::move(g.q);
    out[2] = std::move(g.v);
    if (!g.parameters.empty()) out[3] = std::move(g.parameters);
    out.back() = std::move(g.value);
  };
}

EpisodeGradients task_returns(const Task& task, const TaskActions& actions, std::uint64_t seed,
                              const TapeOptions& options) {
  const auto block = std::make_shared<TaskBlock>(task, options, 1);
  return [&task, &actions, seed, options, block](std::int64_t first, int episodes, auto& out) {
    TaskGradients g = empty_gradients(task, episodes, options);
    std::vector<FailedEnvironment> failures;
    block->play(seed, {first, first + episodes}, actions, 0, g, failures);
    out[0] = std::move(g.u);
    out[1] = std::move(g.q);
    out[2] = std::move(g.v);
    if (out.size() > 3) out[3] = std::move(g.parameters);
  };
}

/// Refuses scenes in which a state is more than q and v.
void check_no_shear_springs(const Model& model) {
  if (model.has_shear_state())
    throw InputError("scene '" + model.scene().name +
                     "' has contacts with ks or friction of joints; expected none: the derivative "
                     "of a state by the one "
                     "before leaves out the shear state");
}

EpisodeGradients scene_jacobians(const Model& model, const ControlProgram& controls,
                                 const EpisodeOptions& run) {
  struct Scratch {
    Stepper stepper;
    StepJacobians jacobians;
    BlockTape tape;
    std::vector<RowChain> chains;
  };
  const std::size_t nu = as_size(model.nu()), nv = as_size(model.nv());
  check_no_shear_springs(model);
  const auto s = std::make_shared<Scratch>(
      Scratch{Stepper(model, {.differentiable = true}), StepJacobians(model),
              BlockTape(model, model.integrator(), run.every),
              std::vector<RowChain>(kBlock, RowChain(model.nv(), nu))});
  std::vector<double> held(nu * (2 * nv + nu));  // (nu, 2 nv + nu): controls are the action
  for (std::size_t k = 0; k < nu; ++k) held[k * (2 * nv + nu) + 2 * nv + k] = 1;
  return [&model, &controls, &run, nu, s, held](std::int64_t first, int episodes, auto& out) {
    const std::int64_t rows = run.steps / run.every;
    Batch batch(model, episodes, run.seed, first);
    std::vector<double> u(as_size(episodes) * nu);
    StepJacobian step;
    RowJacobian row;
    for (std::int64_t j = 0; j < rows; ++j) {
      for (int e = 0; e < episodes; ++e)
        controls.evaluate(j * run.every, first + e, std::span(u).subspan(as_size(e) * nu, nu));
      s->tape.start(batch, 0);
      for (int k = 0; k < run.every; ++k) s->stepper.step_block(batch, 0, u, &s->tape);
      for (RowChain& chain : s->chains) chain.begin();
      for (int k = 0; k < run.every; ++k) {
        s->jacobians.evaluate(batch, 0, s->tape, k, u);
        for (int e = 0; e < episodes; ++e) {
          s->jacobians.get(e, step);
          s->chains[as_size(e)].add(step, held);
        }
      }
      for (int e = 0; e < episodes; ++e) {
        s->chains[as_size(e)].get(row);
        put_row(row, out.size() == 3, as_size(e) * as_size(rows) + as_size(j), out);
      }
    }
  };
}

EpisodeGradients task_jacobians(const Task& task, const TaskActions& actions,
                                const EpisodeOptions& run) {
  check_no_shear_springs(task.model());
  struct Scratch {
    TaskRollout rollout;
    ActionJacobians jacobians;
    BlockTape tape;
    ActionRecord record;
  };
  const auto s = std::make_shared<Scratch>(
      Scratch{TaskRollout(task, {}, run.precision), ActionJacobians(task, {}),
              BlockTape(task.model(), task.model().integrator(), task.spec().steps_per_action),
              ActionRecord(task)});
  return [&task, &actions, &run, s](std::int64_t first, int episodes, auto& out) {
    const std::int64_t rows = task.spec().horizon;
    std::vector<std::int64_t> numbers(as_size(episodes));
    std::iota(numbers.begin(), numbers.end(), first);
    s->rollout.start(run.seed, numbers);
    for (std::int64_t a = 0; a < rows && s->rollout.running(); ++a) {
      s->rollout.choose(actions, s->record);
      s->rollout.begin(s->record);
      s->rollout.take_steps(&s->tape);
      s->jacobians.evaluate(s->rollout, s->record, a, s->tape);
      for (int e = 0; e < episodes; ++e)
        if (s->record.taken[as_size(e)])
          put_row(s->jacobians.of(e), out.size() == 3, as_size(e) * as_size(rows) + as_size(a),
                  out);
      s->rollout.conclude();
    }
  };
}

/// Memory for Jacobians: one thread's scratch and `blocks` results.
GradientPlan plan_of_jacobians(const Model& model, const Named& actions, std::int64_t rows,
                               double blocks, std::function<EpisodeGradients()> make) {
  GradientPlan plan{arrays_of_jacobians(model, actions), rows, std::move(make), 0};
  plan.bytes = blocks * bytes_of(plan.arrays, rows) +
               double(Stepper::workspace_bytes(model)) * (2 + 2 * model.nv());
  return plan;
}

TapeOptions options_of(const EpisodeOptions& run, std::int64_t length, double tape_bytes) {
  TapeOptions options;
  options.length = length;
  options.precision = run.precision;
  options.parameters = true;
  options.tape_bytes = tape_bytes;
  return options;
}

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
  if (kind == GradientKind::none) return {};
  const std::int64_t rows = run.steps / run.every;
  if (kind == GradientKind::jacobians)
    return plan_of_jacobians(model, actions_of(model), rows, 1,
                             [&] { return scene_jacobians(model, controls, run); });
  const TapeOptions options = options_of(run, run.steps, tape_bytes);
  GradientPlan plan{arrays_of_return(model, actions_of(model), "the loss"), rows,
                    [&model, &controls, &run, options, loss] {
                      return scene_returns(model, controls, run, options, loss);
                    }};
  plan.arrays.push_back(array("loss", {1}, false, loss_meaning, {}));
  plan.bytes = bytes_of(plan.arrays, rows) + gradient_bytes(model, kBlock, options, 1);
  return plan;
}

GradientPlan task_episode_gradients(const Task& task, const TaskActions& actions,
                                    const EpisodeOptions& run, GradientKind kind,
                                    double tape_bytes) {
  if (kind == GradientKind::none) return {};
  const Model& model = task.model();
  const std::int64_t rows = task.spec().horizon;
  if (kind == GradientKind::jacobians)
    return plan_of_jacobians(model, actions_of(task), rows, kBlocksOfThread,
                             [&] { return task_jacobians(task, actions, run); });
  const TapeOptions options = options_of(run, rows, tape_bytes);
  GradientPlan plan{arrays_of_return(model, actions_of(task), "the return"), rows,
                    [&task, &actions, seed = run.seed, options] {
                      return task_returns(task, actions, seed, options);
                    }};
  plan.bytes =
      kBlocksOfThread * bytes_of(plan.arrays, rows) + gradient_bytes(task, kBlock, options);
  return plan;
}

void GradientSink::prepare(const EpisodeRows& rows) {
  if (rows.rows > rows.action_rows) {  // the last piece: the block is complete
    EpisodeGradients compute;
    {
      const std::lock_guard lock(mutex_);
      if (!idle_.empty()) {
        compute = std::move(idle_.back());
        idle_.pop_back();
      }
    }
    if (!compute) compute = plan_.make();
    Block block;
    make_room(plan_.arrays, rows.episodes, plan_.rows, block.numbers);
    compute(rows.first_episode, rows.episodes, block.numbers);
    block.spans.assign(block.numbers.begin(), block.numbers.end());
    const std::lock_guard lock(mutex_);
    idle_.push_back(std::move(compute));
    blocks_[rows.first_episode] = std::move(block);
  }
  next_.prepare(with_gradients(rows));
}

void GradientSink::write(const EpisodeRows& rows) { next_.write(with_gradients(rows)); }

void GradientSink::finish(std::int64_t first_episode, std::span<const FailedEpisode> failures,
                          const EpisodeSteps& steps) {
  {
    const std::lock_guard lock(mutex_);
    blocks_.erase(first_episode);
  }
  next_.finish(first_episode, failures, steps);
}

EpisodeRows GradientSink::with_gradients(const EpisodeRows& rows) {
  EpisodeRows out = rows;
  if (rows.rows <= rows.action_rows) return out;
  const std::lock_guard lock(mutex_);
  out.gradients = blocks_.at(rows.first_episode).spans;
  return out;
}

}  // namespace tangere
