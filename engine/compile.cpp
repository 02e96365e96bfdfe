// SPDX-License-Identifier: Apache-2.0
// compile(scene): names become indices, fixed joints fold into what they hang on, joints become elementary links.
#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "engine/compiled_model.hpp"

namespace tangere {

using kernels::Frame;
using kernels::JointKind;
using kernels::Link;
using kernels::Mat3;
using kernels::Vec3;

kernels::Frame<double> to_frame(const Pose& pose) {
  const Quaternion& o = pose.orientation;
  const double scale = 1 / std::sqrt(o[0] * o[0] + o[1] * o[1] + o[2] * o[2] + o[3] * o[3]);
  const kernels::Quat<double> q = {scale * o[0], scale * o[1], scale * o[2], scale * o[3]};
  return {kernels::to_matrix(q), {pose.position[0], pose.position[1], pose.position[2]}};
}

kernels::Quat<double> quaternion_of(const kernels::Mat3<double>& R) {
  // The largest of the four squares is divided by: never near zero.
  const auto& m = R.m;
  const double w = 1 + m[0][0] + m[1][1] + m[2][2], x = 1 + m[0][0] - m[1][1] - m[2][2];
  const double y = 1 - m[0][0] + m[1][1] - m[2][2], z = 1 - m[0][0] - m[1][1] + m[2][2];
  kernels::Quat<double> q;
  if (w >= x && w >= y && w >= z) {
    q = {w, m[2][1] - m[1][2], m[0][2] - m[2][0], m[1][0] - m[0][1]};
  } else if (x >= y && x >= z) {
    q = {m[2][1] - m[1][2], x, m[0][1] + m[1][0], m[0][2] + m[2][0]};
  } else if (y >= z) {
    q = {m[0][2] - m[2][0], m[0][1] + m[1][0], y, m[1][2] + m[2][1]};
  } else {
    q = {m[1][0] - m[0][1], m[0][2] + m[2][0], m[1][2] + m[2][1], z};
  }
  double scale = 1 / std::sqrt(q.w * q.w + q.x * q.x + q.y * q.y + q.z * q.z);
  if (q.w < 0) scale = -scale;
  return {scale * q.w, scale * q.x, scale * q.y, scale * q.z};
}

namespace {

const Frame<double> kIdentity = {kernels::diagonal(1.0), {0, 0, 0}};

bool is_identity(const Frame<double>& f) {
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j)
      if (f.R.m[i][j] != (i == j ? 1.0 : 0.0)) return false;
  return f.p.x == 0 && f.p.y == 0 && f.p.z == 0;
}

Vec3<double> vec(const Vector3& a) { return {a[0], a[1], a[2]}; }

/// Name → index of one kind of thing; a second use of a name is an error.
class NameIndex {
 public:
  void add(const std::string& kind, const std::string& name, int index, const Source& source) {
    if (!index_.emplace(name, index).second)
      throw InputError(source.prefix() + kind + " name '" + name + "' is used twice");
  }
  [[nodiscard]] int find(const std::string& kind, const std::string& name, const Source& source) const {
    const auto it = index_.find(name);
    if (it == index_.end()) throw InputError(source.prefix() + "no " + kind + " is named '" + name + "'");
    return it->second;
  }

 private:
  std::unordered_map<std::string, int> index_;
};

class Compiler {
 public:
  explicit Compiler(const Scene& scene) { m_.scene = scene; }

  CompiledModel run() {
    for (int i = 0; i < static_cast<int>(m_.scene.links.size()); ++i) add_link(i);
    if (m_.nv == 0) throw InputError(where() + "nothing in the scene can move: every joint is fixed");
    motors();
    m_.damping.resize(m_.nv);
    for (std::size_t i = 0; i < m_.scene.links.size(); ++i) {
      const JointDescription& joint = m_.scene.links[i].joint;
      for (int k = 0; k < dof_count(joint.type); ++k) m_.damping[m_.joints[i].v + k] = joint.damping;
    }
    initial_state();
    unknown_scales();
    pair_contacts();
    ground_contacts();
    sensors();
    randomizations();
    symbolic();
    return std::move(m_);
  }

 private:
  [[nodiscard]] std::string where() const { return m_.scene.path.empty() ? "" : m_.scene.path + ": "; }

  // --- tree ---

  void add_link(int i) {
    const LinkDescription& d = m_.scene.links[i];
    links_.add("link", d.name, i, d.joint.source);
    joints_.add("joint", d.joint.name, i, d.joint.source);
    bodies_.add("body", d.body.name, i, d.body.source);
    if (d.parent >= i || d.parent < -1)
      throw InputError(d.joint.source.prefix() + "link '" + d.name + "': parents must come first");
    const int parent = d.parent < 0 ? -1 : m_.joints[d.parent].link;
    const Frame<double> base = d.parent < 0 ? kIdentity : m_.joints[d.parent].frame;
    m_.joints.push_back(add_joint(d.joint, parent, compose(base, to_frame(d.joint.pose))));
    add_body(d, m_.joints.back());
  }

  CompiledJoint add_joint(const JointDescription& d, int parent, const Frame<double>& frame) {
    CompiledJoint joint;
    joint.q = m_.nq;
    joint.v = m_.nv;
    joint.first_link = static_cast<int>(m_.links.size());
    joint.frame = kIdentity;
    const Vec3<double> x = {1, 0, 0}, y = {0, 1, 0}, z = {0, 0, 1};
    const Vec3<double> axis0 = vec(d.axis0), axis1 = vec(d.axis1);
    // Appends an elementary link; only the first carries the joint's rest pose.
    const auto add = [&](JointKind kind, const Vec3<double>& axis) {
      const bool first = joint.link_count == 0;
      const Frame<double>& at = first ? frame : kIdentity;
      const int up = first ? parent : joint.link;
      const bool slides = kernels::slides(kind), steady = up < 0 || m_.links[up].still;
      const bool rotated = !is_identity({at.R, {0, 0, 0}}), turned = !slides || rotated;
      const bool placed = slides || !is_identity({kIdentity.R, at.p});
      Link link{up, kind, m_.nq, m_.nv, axis, at, rotated, turned, placed, steady, steady && slides, false, 0,
                {0, 0, 0}, kernels::zero33<double>()};
      m_.nq += kernels::coordinates(kind);
      m_.nv += kernels::dofs(kind);
      joint.link = static_cast<int>(m_.links.size());
      m_.links.push_back(link);
      ++joint.link_count;
    };
    switch (d.type) {
      case JointType::fixed:
        joint.first_link = -1;
        joint.link = parent;
        joint.frame = frame;
        break;
      case JointType::revolute: add(JointKind::revolute, axis0); break;
      case JointType::prismatic: add(JointKind::prismatic, axis0); break;
      case JointType::planar:
        add(JointKind::prismatic, axis0);
        add(JointKind::prismatic, axis1);
        break;
      case JointType::translational: add(JointKind::translational, x); break;
      case JointType::free2d:
        add(JointKind::prismatic, x);
        add(JointKind::prismatic, y);
        add(JointKind::revolute, z);
        break;
      case JointType::spherical: add(JointKind::spherical, x); break;
      case JointType::free:
        add(JointKind::translational, x);
        add(JointKind::spherical, x);
        break;
    }
    name_coordinates(d);
    return joint;
  }

  void name_coordinates(const JointDescription& d) {
    struct Coordinate {
      const char *name, *unit;
    };
    std::vector<Coordinate> q, v;
    switch (d.type) {
      case JointType::fixed: break;
      case JointType::revolute: q = {{"angle", "rad"}}, v = {{"rate", "rad/s"}}; break;
      case JointType::prismatic: q = {{"position", "m"}}, v = {{"rate", "m/s"}}; break;
      case JointType::planar: q = {{"axis0", "m"}, {"axis1", "m"}}, v = {{"v0", "m/s"}, {"v1", "m/s"}}; break;
      case JointType::free2d:
        q = {{"x", "m"}, {"y", "m"}, {"angle", "rad"}};
        v = {{"vx", "m/s"}, {"vy", "m/s"}, {"rate", "rad/s"}};
        break;
      case JointType::translational:
      case JointType::free:
        q = {{"x", "m"}, {"y", "m"}, {"z", "m"}};
        v = {{"vx", "m/s"}, {"vy", "m/s"}, {"vz", "m/s"}};
        [[fallthrough]];
      case JointType::spherical:
        if (d.type == JointType::translational) break;
        q.insert(q.end(), {{"qw", "1"}, {"qx", "1"}, {"qy", "1"}, {"qz", "1"}});
        v.insert(v.end(), {{"wx", "rad/s"}, {"wy", "rad/s"}, {"wz", "rad/s"}});
        break;
    }
    for (const Coordinate& c : q) m_.q_names.push_back(d.name + "." + c.name), m_.q_units.emplace_back(c.unit);
    for (const Coordinate& c : v) m_.v_names.push_back(d.name + "." + c.name), m_.v_units.emplace_back(c.unit);
  }

  void add_body(const LinkDescription& d, const CompiledJoint& joint) {
    CompiledBody body;
    body.link = joint.link;
    body.frame = compose(joint.frame, to_frame(d.body.pose));
    place_shape(d.body.shape, body);
    const MassProperties properties = mass_properties(d.body.shape, d.body.density);
    body.mass = properties.mass;
    body.centre = properties.centre;
    const bool massless = body.touchable && body.shape == PrimitiveShape::plane;
    if (!massless && (!(body.mass > 0) || !std::isfinite(body.mass)))
      throw InputError(d.body.source.prefix() + "body '" + d.body.name + "' has mass " + std::to_string(body.mass) +
                       " kg; expected a positive, finite one");
    if (body.link >= 0 && !massless) add_inertia(m_.links[body.link], body, properties);
    m_.bodies.push_back(body);
    m_.body_names.push_back(d.body.name);
  }

  static void place_shape(const Shape& shape, CompiledBody& body) {
    if (const auto* sphere = std::get_if<SphereShape>(&shape)) {
      body.shape = PrimitiveShape::sphere;
      body.size = {sphere->radius, 0, 0};
    } else if (const auto* cuboid = std::get_if<CuboidShape>(&shape)) {
      body.shape = PrimitiveShape::cuboid;
      body.size = 0.5 * vec(cuboid->size);
    } else if (const auto* cylinder = std::get_if<CylinderShape>(&shape)) {
      body.shape = PrimitiveShape::cylinder;
      body.size = {cylinder->radius, 0.5 * cylinder->length, 0};
    } else if (const auto* capsule = std::get_if<CapsuleShape>(&shape)) {
      body.shape = PrimitiveShape::capsule;
      body.size = {capsule->radius, 0.5 * capsule->length, 0};
    } else if (std::holds_alternative<PlaneShape>(shape)) {
      body.shape = PrimitiveShape::plane;
    } else {
      body.touchable = false;
      const std::vector<double> p = contact_points(shape);
      for (std::size_t k = 0; k < p.size(); k += 3)
        body.size.x = std::max(body.size.x, std::hypot(p[k], p[k + 1], p[k + 2]));
    }
  }

  static void add_inertia(Link& link, const CompiledBody& body, const MassProperties& properties) {
    const Mat3<double>& R = body.frame.R;
    const Vec3<double> centre = R * properties.centre + body.frame.p;
    const Mat3<double> p = kernels::skew(centre);
    link.massive = true;
    link.mass += body.mass;
    link.moment += body.mass * centre;
    link.inertia += R * properties.inertia * kernels::transpose(R) - body.mass * (p * p);
  }

  void motors() {
    std::vector<char> driven(m_.scene.links.size(), 0);
    for (const MotorDescription& d : m_.scene.motors) {
      const int i = joints_.find("joint", d.joint, d.source);
      const JointType type = m_.scene.links[i].joint.type;
      if (dof_count(type) == 0) throw InputError(d.source.prefix() + "motor on the fixed joint '" + d.joint + "'");
      if (driven[i]) throw InputError(d.source.prefix() + "joint '" + d.joint + "' has two motors");
      driven[i] = 1;
      for (int k = 0; k < dof_count(type); ++k) {
        const int dof = m_.joints[i].v + k;
        m_.motors.push_back({dof, d.low, d.high});
        m_.u_names.push_back(m_.v_names[dof]);
        m_.u_units.emplace_back("1");
      }
    }
    m_.nu = static_cast<int>(m_.motors.size());
  }

  // --- contacts ---

  static kernels::ContactParameters constants(const ContactCoefficients& c) {
    return {{c.kn, -1}, {c.kt, -1}, {c.mu, -1}, {c.damping, -1}};
  }

  const double* keep(std::vector<std::vector<double>>& storage, std::vector<double> values) {
    storage.push_back(std::move(values));
    return storage.back().data();  // moving a vector keeps its buffer
  }

  void pair_contacts() {
    for (const PairContactDescription& d : m_.scene.pair_contacts) {
      const int b1 = bodies_.find("body", d.general_body, d.source);
      const int b2 = bodies_.find("body", d.primitive_body, d.source);
      const CompiledBody &first = m_.bodies[b1], &second = m_.bodies[b2];
      const Shape &general = m_.scene.links[b1].body.shape, &primitive = m_.scene.links[b2].body.shape;
      if (!has_contact_points(general))
        throw InputError(d.source.prefix() + "general_body '" + d.general_body + "' (" + shape_name(general) +
                         ") has no contact points; expected a cuboid, cylinder or capsule (swap the two bodies)");
      if (!has_distance(primitive))
        throw InputError(d.source.prefix() + "primitive_body '" + d.primitive_body + "' (" + shape_name(primitive) +
                         ") has no distance; expected a sphere, cuboid, cylinder, capsule or plane");
      if (b1 == b2 || first.link == second.link)
        throw InputError(d.source.prefix() + "bodies '" + d.general_body + "' and '" + d.primitive_body +
                         "' cannot move against each other");
      std::vector<double> points = contact_points(general);
      double reach = 0;
      for (std::size_t k = 0; k < points.size(); k += 3) {
        const Vec3<double> p = first.frame.R * Vec3<double>{points[k], points[k + 1], points[k + 2]} + first.frame.p;
        points[k] = p.x, points[k + 1] = p.y, points[k + 2] = p.z;
        reach = std::max(reach, std::sqrt(dot(p, p)));
      }
      std::vector<double> tiles = sort_into_tiles(points, kernels::kContactTile);
      kernels::PairContact pair{};
      pair.link1 = first.link;
      pair.link2 = second.link;
      pair.frame2 = second.frame;
      pair.shape = second.shape;
      pair.size = second.size;
      pair.law = d.law;
      pair.ramp = d.ramp;
      pair.parameters = constants(d.coefficients);
      pair.n_points = static_cast<int>(points.size() / 3);
      pair.n_tiles = static_cast<int>(tiles.size() / 4);
      pair.reach = reach;
      pair.points = keep(m_.point_storage, std::move(points));
      lay_out_tiles(pair, tiles);
      m_.pairs.push_back(pair);
      m_.contact_info.push_back({d.general_body, d.primitive_body, pair.n_points, to_string(d.law)});
      touching_.emplace_back(pair.link1, pair.link2);
    }
  }

  /// Points and bounds of the tiles as vectors read them, padded to whole tiles and whole vectors.
  void lay_out_tiles(kernels::PairContact& pair, const std::vector<double>& tiles) {
    constexpr int kTile = kernels::kContactTile, kLanes = kernels::kGroup;
    AlignedVector<double> points(std::size_t(pair.n_tiles) * 3 * kTile, kernels::kFarAway);
    for (int k = 0; k < pair.n_points; ++k)
      for (int c = 0; c < 3; ++c) points[std::size_t((k / kTile * 3 + c) * kTile + k % kTile)] = pair.points[3 * k + c];
    const int groups = (pair.n_tiles + kLanes - 1) / kLanes;
    AlignedVector<double> bounds(std::size_t(groups) * 4 * kLanes, kernels::kFarAway);
    for (int t = 0; t < groups * kLanes; ++t)
      for (int c = 0; c < 4; ++c)
        bounds[std::size_t((t / kLanes * 4 + c) * kLanes + t % kLanes)] =
            t < pair.n_tiles ? tiles[std::size_t(4 * t + c)] : c < 3 ? kernels::kFarAway : 0;
    m_.tile_storage.push_back(std::move(points));
    pair.tile_points = m_.tile_storage.back().data();
    m_.tile_storage.push_back(std::move(bounds));
    pair.tile_bounds = m_.tile_storage.back().data();
  }

  void ground_contacts() {
    for (const GroundContactDescription& d : m_.scene.ground_contacts) {
      if (!m_.scene.ground)
        throw InputError(d.source.prefix() + "ground_contact of '" + d.body + "', but the scene has no <ground>");
      const int b = bodies_.find("body", d.body, d.source);
      const CompiledBody& body = m_.bodies[b];
      if (body.link < 0) throw InputError(d.source.prefix() + "body '" + d.body + "' is fixed in the world");
      kernels::GroundContact ground{};
      const Shape& shape = m_.scene.links[b].body.shape;
      std::vector<double> points = contact_points(shape);
      if (std::holds_alternative<SphereShape>(shape)) {
        points = {0, 0, 0};
        ground.radius = body.size.x;
      }
      if (points.empty())
        throw InputError(d.source.prefix() + "body '" + d.body + "' (" + shape_name(shape) + ") has no contact points");
      for (std::size_t k = 0; k < points.size(); k += 3) {
        const Vec3<double> p = body.frame.R * Vec3<double>{points[k], points[k + 1], points[k + 2]} + body.frame.p;
        points[k] = p.x, points[k + 1] = p.y, points[k + 2] = p.z;
      }
      ground.link = body.link;
      ground.law = d.law;
      ground.ramp = d.ramp;
      ground.parameters = constants(d.coefficients);
      ground.n_points = static_cast<int>(points.size() / 3);
      ground.points = keep(m_.point_storage, std::move(points));
      m_.grounds.push_back(ground);
      m_.contact_info.push_back({d.body, "ground", ground.n_points, to_string(d.law)});
    }
  }

  void sensors() {
    for (std::size_t i = 0; i < m_.scene.sensors.size(); ++i) {
      const TactileDescription& d = m_.scene.sensors[i];
      sensors_.add("tactile sensor", d.name, static_cast<int>(i), d.source);
      const int b = bodies_.find("body", d.body, d.source);
      SensorInfo info;
      CompiledSensor sensor = compile_sensor(d, m_.bodies[b], info);
      sensor.body = b;
      sensor.parameters = constants(d.coefficients);
      for (int t = 0; t < static_cast<int>(m_.bodies.size()); ++t)
        if (m_.bodies[t].link != sensor.link && m_.bodies[t].touchable) sensor.targets.push_back(t);
      m_.sensors.push_back(std::move(sensor));
      m_.sensor_info.push_back(std::move(info));
    }
  }

  // --- state and what varies ---

  /// Lengths are rounded against the farthest point of any body from the world's origin at rest.
  void unknown_scales() {
    std::vector<Frame<double>> world;
    double extent = 0;
    for (const Link& l : m_.links) world.push_back(l.parent < 0 ? l.frame : compose(world[std::size_t(l.parent)], l.frame));
    for (const CompiledBody& b : m_.bodies) {
      const Frame<double> at = b.link < 0 ? b.frame : compose(world[std::size_t(b.link)], b.frame);
      extent = std::max(extent, std::sqrt(dot(at.p, at.p)) + std::sqrt(dot(b.size, b.size)));
    }
    for (const Link& l : m_.links) {
      const bool turns = l.kind == JointKind::revolute || l.kind == JointKind::spherical;
      m_.unknown_scale.insert(m_.unknown_scale.end(), std::size_t(kernels::dofs(l.kind)), turns ? 1.0 : extent);
    }
  }

  void initial_state() {
    m_.initial_q.assign(m_.nq, 0);
    m_.initial_v.assign(m_.nv, 0);
    for (const Link& link : m_.links)
      if (link.kind == JointKind::spherical) m_.initial_q[link.q] = 1;
    for (const InitialState& d : m_.scene.initial) {
      const int i = joints_.find("joint", d.joint, d.source);
      const JointType type = m_.scene.links[i].joint.type;
      const auto copy = [&](const char* what, const std::vector<double>& from, int count, double* to) {
        if (from.empty()) return;
        if (from.size() != std::size_t(count))
          throw InputError(d.source.prefix() + "initial " + what + " of joint '" + d.joint + "' has " +
                           std::to_string(from.size()) + " values; expected " + std::to_string(count));
        std::copy(from.begin(), from.end(), to);
      };
      copy("q", d.q, position_count(type), m_.initial_q.data() + m_.joints[i].q);
      copy("v", d.v, dof_count(type), m_.initial_v.data() + m_.joints[i].v);
    }
  }

  void randomizations() {
    m_.layout = {0, m_.nq, m_.nq + m_.nv, 2 * m_.nq + m_.nv, 2 * (m_.nq + m_.nv), 0};
    int next = m_.layout.parameters;
    for (const RandomizationDescription& d : m_.scene.randomizations) {
      if (d.target == RandomTarget::joint_q || d.target == RandomTarget::joint_v) {
        m_.randomized_row.push_back(state_row(d));
        continue;
      }
      const auto vary = [&](kernels::ContactParameters& p) {
        kernels::Parameter* field[] = {&p.kn, &p.kt, &p.mu, &p.damping};
        field[static_cast<int>(d.field)]->row = next;
      };
      parameters_of(d, vary);
      m_.randomized_row.push_back(next++);
    }
    m_.layout.rows = next;
  }

  int state_row(const RandomizationDescription& d) const {
    const int i = joints_.find("joint", d.name, d.source);
    const JointType type = m_.scene.links[i].joint.type;
    const bool position = d.target == RandomTarget::joint_q;
    const int count = position ? position_count(type) : dof_count(type);
    if (d.index < 0 || d.index >= count)
      throw InputError(d.source.prefix() + "joint '" + d.name + "' has " + std::to_string(count) +
                       (position ? " coordinates" : " velocities") + "; index " + std::to_string(d.index) +
                       " is not one of them");
    return position ? m_.layout.q + m_.joints[i].q + d.index : m_.layout.v + m_.joints[i].v + d.index;
  }

  template <class Vary>
  void parameters_of(const RandomizationDescription& d, const Vary& vary) {
    bool found = false;
    if (d.target == RandomTarget::tactile) {
      vary(m_.sensors[sensors_.find("tactile sensor", d.name, d.source)].parameters);
      return;
    }
    for (std::size_t k = 0; k < m_.pairs.size() && d.target == RandomTarget::pair_contact; ++k) {
      const PairContactDescription& pair = m_.scene.pair_contacts[k];
      if (pair.general_body == d.name && pair.primitive_body == d.second_name) vary(m_.pairs[k].parameters), found = true;
    }
    for (std::size_t k = 0; k < m_.grounds.size() && d.target == RandomTarget::ground_contact; ++k)
      if (m_.scene.ground_contacts[k].body == d.name) vary(m_.grounds[k].parameters), found = true;
    if (!found)
      throw InputError(d.source.prefix() + "no contact between '" + d.name + "' and '" +
                       (d.second_name.empty() ? "ground" : d.second_name) + "' is declared");
  }

  void symbolic() {
    m_.pattern = analyse_pattern(m_.links, m_.nv, touching_);
    std::vector<char> carried(m_.links.size(), 0);
    for (int i = static_cast<int>(m_.links.size()) - 1; i >= 0; --i) {
      if (m_.links[i].massive) carried[i] = 1;
      if (!carried[i]) throw InputError(where() + "a joint moves nothing that has mass");
      if (m_.links[i].parent >= 0) carried[m_.links[i].parent] = 1;
    }
  }

  CompiledModel m_;
  NameIndex links_, joints_, bodies_, sensors_;
  std::vector<std::pair<int, int>> touching_;
};

/// What the scene calls for, and why: decided here once, printed by `inspect`.
void decide_effects(CompiledModel& m) {
  const auto add = [&](const char* name, bool on, std::string reason) {
    m.effects.push_back({name, on, std::move(reason)});
  };
  const auto counted = [](std::size_t n, const std::string& one, const std::string& many) {
    return std::to_string(n) + " " + (n == 1 ? one : many);
  };
  const Vector3& g = m.scene.gravity;
  const bool gravity = g[0] != 0 || g[1] != 0 || g[2] != 0;
  add("gravity", gravity, gravity ? "option gravity is not zero" : "option gravity is zero");
  const bool turning = std::any_of(m.links.begin(), m.links.end(), [](const Link& l) {
    return l.kind == JointKind::spherical || l.kind == JointKind::revolute;
  });
  add("velocity products", turning, turning ? "some joint turns" : "no joint turns");
  const bool damped = std::any_of(m.damping.begin(), m.damping.end(), [](double c) { return c != 0; });
  add("joint damping", damped, damped ? "some joint has damping" : "no joint has damping");
  add("force motors", m.nu > 0, counted(std::size_t(m.nu), "control", "controls"));
  add("pair contact", !m.pairs.empty(), counted(m.pairs.size(), "pair declared", "pairs declared"));
  add("ground contact", !m.grounds.empty(), counted(m.grounds.size(), "body declared", "bodies declared"));
  add("tactile", !m.sensors.empty(), counted(m.sensors.size(), "sensor declared", "sensors declared"));
  const std::size_t varying = m.layout.rows - m.layout.parameters;
  add("varying parameters", varying > 0, counted(varying, "number varies by environment", "numbers vary by environment"));
}

}  // namespace

/// Everything of a model, views included. The result must not be copied: its view points into its own vectors.
std::shared_ptr<const CompiledModel> compile(const Scene& scene) {
  auto m = std::make_shared<CompiledModel>(Compiler(scene).run());
  decide_effects(*m);
  const Vector3& g = m->scene.gravity;
  kernels::ModelView& v = m->view;
  v.n_links = static_cast<int>(m->links.size());
  v.nq = m->nq;
  v.nv = m->nv;
  v.links = m->links.data();
  v.gravity = vec(g);
  const GroundDescription ground = m->scene.ground.value_or(GroundDescription{});
  v.ground_point = vec(ground.position);
  v.ground_normal = vec(ground.normal);
  v.damping = m->damping.data();
  v.n_pairs = static_cast<int>(m->pairs.size());
  v.n_grounds = static_cast<int>(m->grounds.size());
  v.pairs = m->pairs.data();
  v.grounds = m->grounds.data();
  v.pattern = m->pattern.view();
  return m;
}

}  // namespace tangere
