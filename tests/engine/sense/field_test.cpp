// SPDX-License-Identifier: Apache-2.0
// Tests what a tactile field says about a contact: directions and patterns of shear, uniform
// pressure, zero after release, and its balance with the wrench of the contact.
//
// The pad lies above its object and feels with its lower face. axis0 = x and axis1 = -y of the pad,
// so their product points down and out. The numbers are f_x, -f_y, f_z of the force on the pad, and
// pressure is positive.
#include <gtest/gtest.h>

#include <cmath>

#include "engine/model/compiled_model.hpp"
#include "engine/model/model.hpp"
#include "tests/engine/runs.hpp"
#include "tests/engine/scenes.hpp"
#include "tests/engine/stage_buffers.hpp"

namespace tangere {
namespace {

using kernels::Vec3;
using testing::link;

constexpr int kSide = 21;
constexpr double kEdge = 0.04, kThickness = 0.01, kRadius = 0.02;  // [m]
constexpr double kDepth = 5e-4;  // [m] how far the pad is pressed in at q = 0

TactileDescription skin() {
  TactileDescription t;
  t.name = t.body = "pad";
  t.coefficients = {10, 0.01, 1e3, 0};  // sticks
  t.array = {{-kEdge / 2, kEdge / 2, -kThickness / 2},
             {kEdge / 2, -kEdge / 2, -kThickness / 2},
             {1, 0, 0},
             {0, -1, 0},
             kSide,
             kSide};
  return t;
}

/// A pad pressed by kDepth onto an object whose middle is the world's origin.
Scene pad_on(JointType pad_joint, JointType object_joint, const Shape& object, double top) {
  Scene s;
  s.gravity = {0, 0, 0};
  s.links = {link("pad", pad_joint, {0, 0, top + kThickness / 2 - kDepth},
                  CuboidShape{{kEdge, kEdge, kThickness}, {kSide, kSide, 2}}, 1000),
             link("object", object_joint, {0, 0, 0}, object, 1000)};
  s.sensors.push_back(skin());
  return s;
}
Scene on_ball(JointType pad_joint, JointType ball_joint = JointType::fixed) {
  return pad_on(pad_joint, ball_joint, SphereShape{kRadius}, kRadius);
}
Scene on_block(JointType pad_joint, JointType block_joint = JointType::fixed) {
  return pad_on(pad_joint, block_joint, CuboidShape{{0.1, 0.1, 0.02}, {2, 2, 2}}, 0.01);
}

/// The force on the pad at each point in the pad's axes [N], and the point's position.
struct Field {
  std::vector<double> numbers;
  [[nodiscard]] int points() const { return int(numbers.size() / 3); }
  [[nodiscard]] Vec3<double> force(int p) const {
    const double* f = numbers.data() + 3 * p;
    return {f[0], -f[1], f[2]};
  }
  [[nodiscard]] static Vec3<double> at(int p) {
    const double step = kEdge / (kSide - 1);
    const int row = p / kSide, col = p % kSide;
    return {-kEdge / 2 + row * step, kEdge / 2 - col * step, -kThickness / 2};
  }
  [[nodiscard]] bool touched(int p) const { return numbers[std::size_t(3 * p + 2)] != 0; }
  [[nodiscard]] Vec3<double> sum() const {
    Vec3<double> s{};
    for (int p = 0; p < points(); ++p) s += force(p);
    return s;
  }
  [[nodiscard]] double largest_shear() const {
    double most = 0;
    for (int p = 0; p < points(); ++p) most = std::max(most, std::hypot(force(p).x, force(p).y));
    return most;
  }
};

Field read(const Model& model, const std::vector<double>& q, const std::vector<double>& v) {
  Batch batch(model, 1);
  Readout readout(model);
  batch.set_state(0, q, v);
  Field f;
  f.numbers.resize(3 * kSide * kSide);
  readout.tactile(batch, 0, 0, f.numbers);
  return f;
}

TEST(Field, SlidingIsOpposedAtEveryPoint) {
  for (const bool flat : {false, true}) {
    const Model model(flat ? on_block(JointType::translational)
                           : on_ball(JointType::translational));
    EXPECT_EQ(model.sensors()[0].pressure_sign, 1);
    const Field still = read(model, {0, 0, 0}, {0, 0, 0});
    for (const auto& way : {Vec3<double>{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}}) {
      const double speed = 0.1;
      const Field f = read(model, {0, 0, 0}, {speed * way.x, speed * way.y, 0});
      int touched = 0;
      for (int p = 0; p < f.points(); ++p) {
        if (!f.touched(p)) continue;
        ++touched;
        const Vec3<double> drag = f.force(p) - still.force(p);
        EXPECT_LT(dot(drag, way), 0) << "point " << p;
        if (flat) {
          EXPECT_NEAR(dot(drag, way), -0.01 * speed, 1e-15) << "k_t v_t";
          EXPECT_EQ(drag.x * way.y, drag.y * way.x) << "nothing across";
        }
      }
      EXPECT_GT(touched, flat ? 440 : 9);
      const Vec3<double> sum = f.sum();
      EXPECT_NEAR(sum.x * way.y - sum.y * way.x, 0, 1e-12 * std::abs(sum.z));
    }
  }
}

TEST(Field, AnObjectThatSlidesUnderAStillPadDragsItAlong) {
  const Model model(on_block(JointType::translational, JointType::translational));
  const Field f = read(model, std::vector<double>(6, 0), {0, 0, 0, 0.1, -0.05, 0});
  for (int p = 0; p < f.points(); ++p) {
    EXPECT_NEAR(f.force(p).x, 0.001, 1e-15);
    EXPECT_NEAR(f.force(p).y, -0.0005, 1e-15);
  }
}

TEST(Field, PressingAloneReadsNoShear) {
  const Field flat = read(Model(on_block(JointType::translational)), {0, 0, 0}, {0, 0, -0.05});
  EXPECT_EQ(flat.largest_shear(), 0);
  EXPECT_GT(flat.sum().z, 0);
  // A ball pushes its dent apart, so shear is radial and its sum is zero.
  const Field round = read(Model(on_ball(JointType::translational)), {0, 0, 0}, {0, 0, -0.05});
  for (int p = 0; p < round.points(); ++p) {
    const Vec3<double> r = Field::at(p), f = round.force(p);
    EXPECT_NEAR(r.x * f.y - r.y * f.x, 0, 1e-16);
  }
  EXPECT_NEAR(round.sum().x, 0, 1e-12 * round.sum().z);
  EXPECT_NEAR(round.sum().y, 0, 1e-12 * round.sum().z);
}

TEST(Field, ABallSpinningUnderAStillPadIsAVortex) {
  const Model model(on_ball(JointType::translational, JointType::revolute));
  const Field still = read(model, {0, 0, 0, 0}, {0, 0, 0, 0});
  for (const double spin : {3.0, -3.0}) {
    const Field f = read(model, {0, 0, 0, 0}, {0, 0, 0, spin});
    int round = 0;
    for (int p = 0; p < f.points(); ++p) {
      const Vec3<double> r = Field::at(p), more = f.force(p) - still.force(p);
      if (!f.touched(p) || std::hypot(r.x, r.y) < 1e-9) continue;
      ++round;
      EXPECT_GT(spin * (r.x * more.y - r.y * more.x), 0) << "turns with the ball at point " << p;
      EXPECT_NEAR(r.x * more.x + r.y * more.y, 0, 1e-16) << "and nothing along the radius";
    }
    EXPECT_GT(round, 8);
    EXPECT_NEAR(f.sum().x, 0, 1e-15);
    EXPECT_NEAR(f.sum().y, 0, 1e-15);
  }
}

TEST(Field, RollingWithoutSlipReadsNearlyNoShear) {
  const Model model(on_ball(JointType::translational, JointType::free));
  const std::vector<double> q = {0, 0, 0, 0, 0, 0, 1, 0, 0, 0};
  const double v = 0.1;
  const auto drag = [&](double centre, double spin) {
    const Field still = read(model, q, std::vector<double>(9, 0));
    Field f = read(model, q, {v, 0, 0, centre, 0, 0, 0, spin, 0});
    for (std::size_t k = 0; k < f.numbers.size(); ++k) f.numbers[k] -= still.numbers[k];
    return f;
  };
  const Field sliding = drag(0, 0), rolling = drag(v / 2, v / 2 / kRadius),
              backwards = drag(v / 2, -v / 2 / kRadius);
  // Points of the dent, up to a = √(2 r δ) from its middle, still creep by v a²/4r² < v δ/r.
  EXPECT_LT(rolling.largest_shear(), 2 * kDepth / kRadius * sliding.largest_shear());
  EXPECT_LT(std::abs(rolling.sum().x), kDepth / kRadius * std::abs(sliding.sum().x));
  EXPECT_GT(rolling.largest_shear(), 0);
  EXPECT_NEAR(backwards.sum().x / sliding.sum().x, 1, 0.05)
      << "spun the wrong way, the ball's top slides as it did";
}

TEST(Field, AYawedPadReadsInItsOwnAxes) {
  const Model model(on_ball(JointType::free2d));
  const Field straight = read(model, {0.001, 0.002, 0}, {0.1, 0.03, 0});
  const Field quarter = read(model, {-0.002, 0.001, std::acos(-1.0) / 2}, {-0.03, 0.1, 0});
  const double c = std::cos(0.7), s = std::sin(0.7);
  const Field askew = read(model, {0.001 * c - 0.002 * s, 0.001 * s + 0.002 * c, 0.7},
                           {0.1 * c - 0.03 * s, 0.1 * s + 0.03 * c, 0});
  ASSERT_GT(straight.sum().z, 0);
  for (std::size_t k = 0; k < straight.numbers.size(); ++k) {
    EXPECT_NEAR(quarter.numbers[k], straight.numbers[k], 1e-14);
    EXPECT_NEAR(askew.numbers[k], straight.numbers[k], 1e-14);
  }
  // The pad is turned by 90° and dragged along the world's +x, its own -y. The shear drags it back
  // along its +y.
  const Field across = read(model, {0, 0, std::acos(-1.0) / 2}, {0.1, 0, 0});
  EXPECT_GT(across.sum().y, 0);
  EXPECT_NEAR(across.sum().x, 0, 1e-12 * across.sum().y);
}

TEST(Field, FlatOnFlatIsUniformAndCarriesTheLoad) {
  Scene s = on_block(JointType::translational);
  s.gravity = {0, 0, -9.8};
  s.pair_contacts.push_back(
      {"pad", "object", s.sensors[0].coefficients, ContactLaw::clamped, 1e-5, {}});
  s.links[0].joint.damping = 2;
  const Model model(s);
  Stepper stepper(model, testing::options(Integrator::bdf2, 5e-3));
  Batch batch(model, 1);
  for (int k = 0; k < 1000; ++k) stepper.step(batch, {});
  ASSERT_EQ(batch.failed_count(), 0);
  const Field f = read(model, testing::q_of(batch), testing::v_of(batch));
  const double load = model.mass(0) * 9.8;
  EXPECT_NEAR(f.sum().z, load, 1e-9 * load);
  for (int p = 0; p < f.points(); ++p)
    EXPECT_NEAR(f.force(p).z, load / f.points(), 1e-9 * load / f.points());
}

TEST(Field, PureTorsionIsARotation) {
  const Model model(on_block(JointType::revolute));
  const double spin = 2;
  const Field f = read(model, {0.3}, {spin}), still = read(model, {0.3}, {0});
  for (int p = 0; p < f.points(); ++p) {
    const Vec3<double> r = Field::at(p);
    EXPECT_NEAR(f.force(p).x, 0.01 * spin * r.y, 1e-16);  // -k_t ω × r
    EXPECT_NEAR(f.force(p).y, -0.01 * spin * r.x, 1e-16);
    EXPECT_EQ(f.force(p).z, still.force(p).z);
  }
}

TEST(Field, NothingIsLeftAfterRelease) {
  const Model model(on_ball(JointType::translational));
  Batch batch(model, 1);
  Readout readout(model);
  DenseFrame<double> dense(model, 0);
  CompactFrame<double> compact(model, 0);
  const auto read_all = [&](double height) {
    batch.set_state(0, std::vector<double>{0, 0, height}, std::vector<double>{0.1, -0.1, 0.2});
    readout.read(batch, 0, dense);
    readout.read(batch, 0, compact);
    double most = 0;
    bool negative_zero = false;
    for (const double f : dense.values()) {
      most = std::max(most, std::abs(f));
      negative_zero = negative_zero || (f == 0 && std::signbit(f));
    }
    EXPECT_FALSE(negative_zero);
    return most;
  };
  EXPECT_GT(read_all(0), 0);
  EXPECT_GT(compact.tiles().size(), 0U);
  EXPECT_EQ(read_all(kDepth + 1e-12), 0) << "a picometre above the ball";
  EXPECT_EQ(compact.tiles().size(), 0U);
  EXPECT_GT(read_all(kDepth - 1e-7), 0);
  EXPECT_EQ(read_all(0.1), 0);
}

/// If sensor and contact have the same points and coefficients, forces and moments of the field are
/// the contact's wrench in the dynamics. That is the residual with the contact minus the residual
/// without.
TEST(Field, SumAndMomentAreTheWrenchOfTheContact) {
  testing::Random random(5);
  for (const bool flat : {false, true}) {
    Scene s = flat ? on_block(JointType::free, JointType::free)
                   : on_ball(JointType::free, JointType::free);
    s.sensors[0].coefficients = {10, 0.3, 0.4, 2};  // some points stick, some slip
    const Model apart(s);
    s.pair_contacts.push_back(
        {"pad", "object", s.sensors[0].coefficients, ContactLaw::clamped, 1e-5, {}});
    const Model model(s);
    for (int trial = 0; trial < 20; ++trial) {
      // Both are turned a little, and the pad is pressed in deeper. Joint frames are at the bodies'
      // middles.
      std::vector<double> q(14), v(12);
      for (const std::size_t body : {0U, 1U}) {
        const Vec3<double> small = random.vector(0.02);
        const kernels::Quat<double> turn = kernels::quaternion_exp(small);
        for (std::size_t i = 0; i < 3; ++i) q[7 * body + i] = 2e-4 * random.normal();
        const double w[4] = {turn.w, turn.x, turn.y, turn.z};
        std::copy(w, w + 4, q.begin() + 7 * std::ptrdiff_t(body) + 3);
      }
      q[2] -= 1e-3;
      for (double& x : v) x = 0.02 * random.normal();
      const Field f = read(model, q, v);
      ASSERT_GT(f.sum().z, 0);

      const auto residual = [&](const Model& m) {
        testing::StageBuffers<double> b(compiled(m));
        std::copy(q.begin(), q.end(), b.centre.begin());
        std::copy(v.begin(), v.end(), b.r.begin());  // rates are c₀/h x + r/h, with x = 0 and h = 1
        b.residual(1, 1);
        return b.g;
      };
      const std::vector<double> with = residual(model), without = residual(apart);
      std::vector<double> wrench(
          12);  // per body: force in world axes, torque about its middle in body axes
      for (std::size_t i = 0; i < 12; ++i) wrench[i] = without[i] - with[i];

      const auto rotation = [&](std::size_t at) {
        return to_matrix(kernels::Quat<double>{q[at], q[at + 1], q[at + 2], q[at + 3]});
      };
      const kernels::Mat3<double> R1 = rotation(3), R2 = rotation(10);
      const Vec3<double> p1 = {q[0], q[1], q[2] + model.scene().links[0].joint.pose.position[2]};
      const Vec3<double> p2 = {q[7], q[8], q[9]};
      Vec3<double> force{}, moment1{}, moment2{};
      for (int p = 0; p < f.points(); ++p) {
        if (!f.touched(p)) continue;
        const Vec3<double> x = R1 * Field::at(p) + p1, away = x - p2, F = R1 * f.force(p);
        const double distance = std::sqrt(dot(away, away));
        const Vec3<double> n = flat ? R2 * Vec3<double>{0, 0, 1} : (1 / distance) * away;
        const Vec3<double> x2 = x - (flat ? dot(n, away) - 0.01 : distance - kRadius) * n;
        force += F;
        moment1 += cross(x2 - p1, F);
        moment2 += cross(x2 - p2, F);
      }
      const Vec3<double> on1 = transposed_times(R1, moment1), on2 = transposed_times(R2, moment2);
      const double expected[12] = {force.x,  force.y,  force.z,  on1.x,  on1.y,  on1.z,
                                   -force.x, -force.y, -force.z, -on2.x, -on2.y, -on2.z};
      const double scale = std::sqrt(dot(force, force));
      for (std::size_t i = 0; i < 12; ++i)
        EXPECT_NEAR(wrench[i], expected[i], 1e-10 * scale)
            << (flat ? "block " : "ball ") << trial << " dof " << i;
    }
  }
}

}  // namespace
}  // namespace tangere
