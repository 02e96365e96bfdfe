// SPDX-License-Identifier: Apache-2.0
// compile(scene): names become indices, fixed joints are folded into their parents, joints become
// elementary links.
#include "engine/model/compile.hpp"

#include <algorithm>
#include <cmath>
#include <map>

#include "engine/model/body_shape.hpp"
#include "engine/model/compile_effects.hpp"
#include "engine/model/compile_followers.hpp"
#include "engine/model/compile_imperfections.hpp"
#include "engine/model/compile_joints.hpp"
#include "engine/model/compile_loops.hpp"
#include "engine/model/compile_markers.hpp"
#include "engine/model/compile_sensor.hpp"
#include "engine/model/compile_shear_springs.hpp"
#include "engine/model/compile_transmissions.hpp"
#include "engine/model/compile_variations.hpp"
#include "engine/model/compiled_layer.hpp"
#include "engine/model/components.hpp"
#include "engine/model/contact_tiles.hpp"
#include "engine/model/gravity_shares.hpp"
#include "engine/model/group_contacts.hpp"
#include "engine/model/inner_faces.hpp"
#include "engine/model/link_inertia.hpp"
#include "engine/model/sensor_layer.hpp"
#include "engine/scene/contact_resolution.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/scene_faults.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/sensed_bodies.hpp"
#include "engine/scene/shapes.hpp"

namespace tangere {

using kernels::Frame;
using kernels::JointKind;
using kernels::Link;
using kernels::Mat3;
using kernels::Vec3;

namespace {

constexpr std::size_t kMostContactPoints = std::size_t{1} << 20;  // of one contact
// A step may have to factor a full matrix of them, and the pattern has a table of all pairs.
constexpr int kMostDofs = 3072;

class Compiler {
 public:
  explicit Compiler(const Scene& scene) {
    m_.scene = scene;
    // The coefficients of a contact of surfaces are those of its first half.
    std::vector<PairContactDescription>& pairs = m_.scene.pair_contacts;
    for (std::size_t k = 1; k < pairs.size(); ++k)
      if (pairs[k].second_half) pairs[k].coefficients = pairs[k - 1].coefficients;
  }

  CompiledModel run() {
    check_scene(m_.scene);
    for (int i = 0; i < static_cast<int>(m_.scene.links.size()); ++i) add_link(i);
    move_near();
    if (m_.nv == 0)
      throw InputError(where() + "nothing in the scene can move: every joint is fixed");
    compile_joint_effects(m_);
    check_masses(m_);
    compile_gravity_shares(m_);
    compile_motors(m_, joints_);
    compile_followers(m_, joints_);
    compile_transmissions(m_, joints_, bodies_);
    compile_initial_state(m_, joints_);
    unknown_scales();
    coarse_pairs();
    mesh_distances();
    thin_walls();
    place_ground();
    pair_contacts();
    ground_contacts();
    group_contacts(m_);
    compile_loops(m_, bodies_);
    components();
    sensors();
    layer_pads();
    end_effectors();
    randomizations();
    find_inner_faces(m_);
    bound_links(m_);
    find_link_balls(m_);
    symbolic();
    return std::move(m_);
  }

 private:
  [[nodiscard]] std::string where() const {
    return m_.scene.path.empty() ? "" : m_.scene.path + ": ";
  }

  // --- tree ---

  void add_link(int i) {
    const LinkDescription& d = m_.scene.links[i];
    links_.add("link", d.name, i, d.joint.source);
    joints_.add("joint", d.joint.name, i, d.joint.source);
    bodies_.add("body", d.body.name, i, d.body.source);
    if (d.parent >= i || d.parent < -1)
      throw InputError(d.joint.source.prefix() + "link '" + d.name + "': parents must come first");
    const int parent = d.parent < 0 ? -1 : m_.joints[d.parent].link;
    const Frame<double> base = d.parent < 0 ? kIdentityFrame : m_.joints[d.parent].frame;
    m_.joints.push_back(add_joint(m_, d.joint, parent, compose(base, to_frame(d.joint.pose))));
    if (m_.nv > kMostDofs)
      throw InputError(d.joint.source.prefix() + "joint '" + d.joint.name +
                       "' is one too many: with it the scene has " + std::to_string(m_.nv) +
                       " degrees of freedom; expected at most " + std::to_string(kMostDofs));
    add_body(d, m_.joints.back());
  }

  void add_body(const LinkDescription& d, const CompiledJoint& joint) {
    CompiledBody body;
    body.link = joint.link;
    body.frame = compose(joint.frame, to_frame(d.body.pose));
    place_shape(d.body.shape, body);
    const MassProperties properties = mass_properties(d.body.shape, d.body.density);
    body.mass = properties.mass;
    body.centre = properties.centre;
    if (!(body.mass >= 0) || !std::isfinite(body.mass))
      throw InputError(d.body.source.prefix() + "body '" + d.body.name + "' has mass " +
                       std::to_string(body.mass) + " kg; expected a finite one, zero or more");
    if (body.link >= 0 && body.mass > 0) add_inertia(m_.links[body.link], body, properties);
    m_.bodies.push_back(body);
    m_.body_names.push_back(d.body.name);
  }

  /// Whether a contact or sensor of the scene needs the distance to a body.
  [[nodiscard]] bool is_touched(std::size_t body) const {
    const std::string& name = m_.scene.links[body].body.name;
    const auto contact_needs = [&](const PairContactDescription& d) {
      return d.primitive_body == name;
    };
    // A sensor's signs are those of its own body's surface.
    const auto sensor_needs = [&](const TactileDescription& d) {
      return d.body == name || std::ranges::binary_search(sensed_bodies(m_.scene, d), int(body));
    };
    const Scene& s = m_.scene;
    return std::any_of(s.pair_contacts.begin(), s.pair_contacts.end(), contact_needs) ||
           std::any_of(s.sensors.begin(), s.sensors.end(), sensor_needs);
  }

  /// Finds the bodies whose contact points are far apart for each other.
  void coarse_pairs() {
    for (const CoarseContact& coarse : coarse_contacts(m_.scene, ComparedWidth::smallest))
      add_coarse_pair(m_.scene.pair_contacts[coarse.contact]);
  }
  void add_coarse_pair(const PairContactDescription& d) {
    const int one = bodies_.find("body", d.general_body, d.source),
              two = bodies_.find("body", d.primitive_body, d.source);
    const std::array<int, 2> pair = {std::min(one, two), std::max(one, two)};
    if (std::ranges::find(m_.coarse_pairs, pair) == m_.coarse_pairs.end())
      m_.coarse_pairs.push_back(pair);
  }
  /// Adds the pairs with a mesh whose walls are thinner than the other's points are apart.
  void thin_walls() {
    for (const PairContactDescription& d : m_.scene.pair_contacts) {
      if ((!d.points.empty() && !d.per_area()) || d.on_ground) continue;
      const CompiledBody& touched =
          m_.bodies[std::size_t(bodies_.find("body", d.primitive_body, d.source))];
      if (touched.grid == nullptr) continue;
      const int general = bodies_.find("body", d.general_body, d.source);
      const double gap = d.per_area()
                             ? d.spacing
                             : contact_point_gap(m_.scene.links[std::size_t(general)].body.shape);
      if (gap > 0 && gap >= 2 * touched.inscribed * touched.size.x) add_coarse_pair(d);
    }
  }

  /// Makes the distances to meshes. Bodies with the same mesh share one.
  void mesh_distances() {
    for (std::size_t b = 0; b < m_.bodies.size(); ++b) {
      const BodyDescription& d = m_.scene.links[b].body;
      const auto* const mesh = std::get_if<MeshShape>(&d.shape);
      if (mesh == nullptr) continue;
      const bool touched = mesh->resolution > 0 && is_touched(b);
      if (!touched && std::ranges::none_of(m_.coarse_pairs, [&](const auto& pair) {
            return pair[0] == int(b) || pair[1] == int(b);
          }))
        continue;
      std::shared_ptr<const MeshGrid> grid;
      try {
        grid = touched ? fitting_mesh_grid(*mesh) : coarse_mesh_grid(*mesh);
      } catch (const InputError& error) {
        if (!touched) continue;
        throw InputError(d.source.prefix() + "body '" + d.name + "': " + error.what());
      }
      const kernels::DistanceGrid& view = grid->view;
      // A wall thinner than a cell is not resolved: the spline's values there are meaningless.
      const double deepest = -*std::ranges::min_element(grid->coefficients);
      m_.bodies[b].inscribed = deepest > 0.5 * view.cell ? deepest : 0;
      m_.bodies[b].grid = &view;
      m_.mesh_grids.push_back(std::move(grid));
      if (!touched) continue;
      m_.mesh_info.push_back({d.name,
                              {view.cells[0], view.cells[1], view.cells[2]},
                              mesh->scale * view.cell,
                              m_.mesh_grids.back()->bytes(),
                              mesh->scale * m_.mesh_grids.back()->fit.error,
                              m_.mesh_grids.back()->fit.unresolved});
      m_.bodies[b].touchable = true;
    }
  }

  // --- contacts ---

  static kernels::ContactParameters constants(const ContactCoefficients& c) {
    return transformed(c, [](double value) { return kernels::Parameter{value, -1}; });
  }

  /// A body so small that it rests less deep than the usual ramp would hardly be damped.
  static double ramp_of(const std::optional<double>& ramp, const CompiledBody& body) {
    if (ramp) return *ramp;
    return body.extent > 0 ? std::min(kUsualRamp, kUsualRampShare * body.extent) : kUsualRamp;
  }

  /// Returns `points` (n, 3) unless they are too many for one contact.
  static std::vector<double> points_in_contact(std::vector<double> points, const std::string& of,
                                               const Source& source) {
    if (points.size() / 3 > kMostContactPoints)
      throw InputError(source.prefix() + "'" + of + "' touches with " +
                       std::to_string(points.size() / 3) + " points; expected at most " +
                       std::to_string(kMostContactPoints));
    return points;
  }

  const double* keep(std::vector<std::vector<double>>& storage, std::vector<double> values) {
    storage.push_back(std::move(values));
    return storage.back().data();  // moving a vector keeps its buffer
  }

  void place_ground() {
    const GroundDescription d = m_.scene.ground.value_or(GroundDescription{});
    const Vec3<double> at = vec3_of(d.position);
    ground_.shape = PrimitiveShape::plane;
    ground_.frame = ground_frame(m_.moved ? at - m_.origin : at, vec3_of(d.normal));
  }

  void pair_contacts() {
    for (const PairContactDescription& d : m_.scene.pair_contacts) {
      const int b1 = bodies_.find("body", d.general_body, d.source);
      const int b2 = d.on_ground ? -1 : bodies_.find("body", d.primitive_body, d.source);
      const CompiledBody &first = m_.bodies[b1],
                         &second = d.on_ground ? ground_ : m_.bodies[std::size_t(b2)];
      const Shape& general = m_.scene.links[b1].body.shape;
      const bool ball = d.points.empty() && is_ball(general);
      if (first.link == second.link)
        throw InputError(d.source.prefix() + "bodies '" + d.general_body + "' and '" +
                         d.primitive_body + "' cannot move against each other");
      const std::vector<double> centre = {0, 0, 0};
      std::vector<double> points = points_in_contact(ball               ? centre
                                                     : d.points.empty() ? contact_points(general)
                                                                        : d.points,
                                                     d.first_name(), d.source);
      double reach = 0;
      for (std::size_t k = 0; k < points.size(); k += 3) {
        const Vec3<double> p =
            first.frame.R * Vec3<double>{points[k], points[k + 1], points[k + 2]} + first.frame.p;
        points[k] = p.x, points[k + 1] = p.y, points[k + 2] = p.z;
        reach = std::max(reach, std::sqrt(dot(p, p)));
      }
      std::vector<int> order;
      std::vector<double> tiles = sort_into_tiles(points, kernels::kContactTile, &order);
      kernels::PairContact pair{};
      pair.link1 = first.link;
      pair.link2 = second.link;
      pair.frame2 = second.frame;
      pair.shape = second.shape;
      pair.size = second.size;
      pair.grid = second.grid;
      pair.law = d.law;
      pair.ramp = ramp_of(d.ramp, first);
      pair.parameters = constants(d.coefficients);
      pair.n_points = static_cast<int>(points.size() / 3);
      pair.n_tiles = static_cast<int>(tiles.size() / 4);
      pair.reach = reach;
      pair.body1 = b1;
      pair.body2 = b2;
      if (ball) pair.ball_radius = first.size.x;
      if (pair.shape == PrimitiveShape::cuboid && d.points.empty() && is_convex(general) &&
          pair.n_points <= kMostFacePoints)
        meet_faces(pair, first);
      pair.points = keep(m_.point_storage, std::move(points));
      if (d.per_area()) {
        std::vector<double> areas;
        for (const int k : order) areas.push_back(d.areas[std::size_t(k)]);
        pair.weights = keep(m_.point_storage, std::move(areas));
      }
      lay_out_tiles(m_, pair, tiles);
      if (!d.sensor.empty()) sensor_points_[d.sensor] = std::move(order);
      contacts_.add("contact", d.first_name() + " " + d.primitive_body,
                    static_cast<int>(m_.pairs.size()), d.source);
      m_.pairs.push_back(pair);
      m_.contact_info.push_back(
          {d.first_name(), d.primitive_body, pair.n_points, law_name(d.law, d.ramp)});
      touching_.emplace_back(pair.link1, pair.link2);
    }
  }

  void ground_contacts() {
    for (const GroundContactDescription& d : m_.scene.ground_contacts) {
      const int b = bodies_.find("body", d.body, d.source);
      const CompiledBody& body = m_.bodies[b];
      if (body.link < 0)
        throw InputError(d.source.prefix() + "body '" + d.body + "' is fixed in the world");
      kernels::GroundContact ground{};
      const Shape& shape = m_.scene.links[b].body.shape;
      std::vector<double> points = points_in_contact(contact_points(shape), d.body, d.source);
      if (is_ball(shape)) {
        points = {0, 0, 0};
        ground.radius = body.size.x;
      }
      for (std::size_t k = 0; k < points.size(); k += 3) {
        const Vec3<double> p =
            body.frame.R * Vec3<double>{points[k], points[k + 1], points[k + 2]} + body.frame.p;
        points[k] = p.x, points[k + 1] = p.y, points[k + 2] = p.z;
      }
      ground.link = body.link;
      ground.body = b;
      ground.law = d.law;
      ground.ramp = ramp_of(d.ramp, body);
      ground.parameters = constants(d.coefficients);
      ground.n_points = static_cast<int>(points.size() / 3);
      ground.points = keep(m_.point_storage, std::move(points));
      lay_out_tiles(m_, ground);
      grounds_.add("ground contact", d.body, static_cast<int>(m_.grounds.size()), d.source);
      m_.grounds.push_back(ground);
      m_.contact_info.push_back({d.body, "ground", ground.n_points, law_name(d.law, d.ramp)});
    }
  }

  /// Throws InputError where the surface of a layer is read and cannot be computed.
  void check_surface(const TactileDescription& d) const {
    SceneNumber kn = first_number(d);
    kn.field = NumberField::kn;
    if (d.layer && randomization_of(m_.scene, kn) >= 0)
      throw InputError(
          (d.markers ? d.markers->source : d.picture->source).prefix() +
          (d.markers ? "markers of '" : "picture of '") + d.name +
          "': its kn varies, but the surface moves with the scene's modulus; expected a "
          "constant kn, or no " +
          (d.markers ? "<markers>" : "<picture>"));
  }

  void sensors() {
    for (std::size_t i = 0; i < m_.scene.sensors.size(); ++i) {
      const TactileDescription& d = m_.scene.sensors[i];
      sensors_.add("tactile sensor", d.name, static_cast<int>(i), d.source);
      const int b = bodies_.find("body", d.body, d.source);
      SensorInfo info;
      CompiledSensor sensor = compile_sensor(d, m_.bodies[b], info);
      sensor.body = b;
      sensor.number = static_cast<int>(i);
      compile_imperfections(d, m_.scene.timestep, sensor, info);
      if (d.layer) sensor.layer = compile_sensor_layer(d, sensor, info.pressure_sign);
      if (d.table) sensor.layer = compile_pressure_table(d, sensor, info.pressure_sign);
      if (d.markers) static_cast<void>(compile_markers(d, info.pressure_sign));  // checks them
      if (d.picture) info.picture = {d.picture->rows, d.picture->cols};
      if (d.channels) info.channels = static_cast<int>(d.channels->map->channels());
      if (d.markers || d.picture) check_surface(d);
      m_.layout.past_states = std::max(m_.layout.past_states, info.past_states);
      sensor.parameters = constants(d.coefficients);
      for (const int t : sensed_bodies(m_.scene, d))
        if (m_.bodies[t].touchable) sensor.targets.push_back(t);
      sensor.target_groups = target_groups(sensor);
      m_.sensors.push_back(std::move(sensor));
      m_.sensor_info.push_back(std::move(info));
    }
  }

  [[nodiscard]] std::vector<int> target_groups(const CompiledSensor& sensor) const {
    std::vector<int> links, groups;
    for (const int target : sensor.targets) {
      const bool apart = sensor.layer && sensor.layer->feedback;
      const int link = apart ? m_.bodies[std::size_t(target)].link : 0;
      const auto known = std::ranges::find(links, link);
      groups.push_back(static_cast<int>(known - links.begin()));
      if (known == links.end()) links.push_back(link);
    }
    return groups;
  }

  /// Makes the layers of sensors the contacts of their points, or finds the contacts whose loads
  /// they carry.
  void layer_pads() {
    for (const CompiledSensor& sensor : m_.sensors) {
      if (!sensor.layer || !sensor.layer->feedback) continue;
      const std::string& name = m_.scene.sensors[std::size_t(sensor.number)].name;
      check_layer_contacts(m_, sensor);
      for (std::size_t k = 0; k < m_.pairs.size(); ++k)
        if (m_.scene.pair_contacts[k].sensor == name)
          m_.pairs[k].layer_pad = static_cast<int>(m_.layer_pads.size()),
          m_.contact_info[k].law = "of the layer";
      m_.layer_pads.push_back({sensor.number, sensor.layer, sensor.pad, sensor_points_[name]});
    }
    for (CompiledSensor& sensor : m_.sensors)
      if (sensor.layer && sensor.layer->load_control) sensor.contacts = load_contacts(m_, sensor);
    number_layers(m_);
    for (kernels::PairContact& pair : m_.pairs) pair.extent += bulge_of(m_, pair);
  }

  void end_effectors() {
    m_.cameras = compile_cameras(m_.scene);
    NameIndex names;
    for (const EndEffectorDescription& d : m_.scene.end_effectors) {
      names.add("endeffector", d.name, static_cast<int>(m_.end_effectors.size()), d.source);
      const CompiledJoint& joint = m_.joints[joints_.find("joint", d.joint, d.source)];
      m_.end_effectors.push_back({joint.link, joint.frame.R * vec3_of(d.position) + joint.frame.p});
      m_.end_effector_info.push_back({d.name, d.joint});
    }
  }

  // --- state and what varies ---
  /// Returns where bodies are at rest, then where links are.
  [[nodiscard]] std::vector<Vec3<double>> places() const {
    std::vector<Frame<double>> world;
    std::vector<Vec3<double>> found;
    for (const Link& l : m_.links)
      world.push_back(l.parent < 0 ? l.frame : compose(world[std::size_t(l.parent)], l.frame));
    for (const CompiledBody& b : m_.bodies)
      found.push_back((b.link < 0 ? b.frame : compose(world[std::size_t(b.link)], b.frame)).p);
    for (const Frame<double>& link : world) found.push_back(link.p);
    return found;
  }

  /// Returns the greatest distance of any body's point from a place at rest.
  [[nodiscard]] double extent_about(const Vec3<double>& middle) const {
    const std::vector<Vec3<double>> all = places();
    double extent = 0;
    for (std::size_t b = 0; b < m_.bodies.size(); ++b) {
      const Vec3<double> arm = all[b] - middle;
      extent = std::max(extent, std::sqrt(dot(arm, arm)) + m_.bodies[b].extent);
    }
    return extent;
  }

  /// Returns how far a scene reaches from a place: its bodies, its links and the ground below.
  [[nodiscard]] double reach_about(const Vec3<double>& middle) const {
    double reach = extent_about(middle);
    for (const Vec3<double>& p : places()) {
      const Vec3<double> arm = p - middle;
      reach = std::max(reach, std::sqrt(dot(arm, arm)));
    }
    if (m_.scene.ground)
      reach = std::max(reach, std::abs(dot(vec3_of(m_.scene.ground->normal),
                                           middle - vec3_of(m_.scene.ground->position))));
    return reach;
  }

  /// Measures a scene that is far from the world's origin from its own middle.
  void move_near() {
    constexpr double kFar = 1000;  // times its reach
    Vec3<double> middle = {0, 0, 0};
    const std::vector<Vec3<double>> all = places();
    for (const Vec3<double>& p : all) middle = middle + (1.0 / double(all.size())) * p;
    const double away = std::sqrt(dot(middle, middle)), reach = reach_about(middle);
    if (!(reach > 0 && away > kFar * reach) || !std::isfinite(away)) return;
    m_.moved = true;
    m_.origin = middle;
    reach_of_moved_ = reach;
    for (Link& l : m_.links)
      if (l.parent < 0) l.frame.p = l.frame.p - middle;
    for (CompiledBody& b : m_.bodies)
      if (b.link < 0) b.frame.p = b.frame.p - middle;
    for (CompiledJoint& j : m_.joints)
      if (j.link < 0) j.frame.p = j.frame.p - middle;
  }

  /// Sets the scales of unknowns. Lengths are rounded relative to the greatest distance of any
  /// body's point from the model's origin at rest; a scene that was moved reaches as far as it
  /// does.
  void unknown_scales() {
    const double extent = m_.moved ? reach_of_moved_ : extent_about({0, 0, 0});
    m_.fall_time =
        std::sqrt(extent / std::sqrt(dot(vec3_of(m_.scene.gravity), vec3_of(m_.scene.gravity))));
    for (const Link& l : m_.links) {
      const bool turns = l.kind == JointKind::revolute || l.kind == JointKind::spherical;
      m_.unknown_scale.insert(m_.unknown_scale.end(), std::size_t(kernels::dofs(l.kind)),
                              turns ? 1.0 : extent);
    }
  }

  void components() {
    std::vector<std::pair<int, int>> coupled = touching_;
    for (const kernels::FollowerTie& t : m_.ties)
      coupled.emplace_back(link_of_dof(m_, t.v), link_of_dof(m_, t.leader_v));
    for (const kernels::PolynomialFollower& f : m_.polynomials)
      coupled.emplace_back(f.link, link_of_dof(m_, f.leader_v));
    for (const kernels::Loop& loop : m_.loops) coupled.emplace_back(loop.link1, loop.link2);
    for (const kernels::Transmission& t : m_.transmissions)
      for (int k = t.first_dof; k < t.first_dof + t.dofs; ++k)
        coupled.emplace_back(t.link, m_.transmission_dofs[std::size_t(k)].link);
    auto [dofs, begin] = find_components(m_.links, coupled);
    m_.component_dofs = std::move(dofs);
    m_.component_begin = std::move(begin);
  }

  void randomizations() {
    const int past = m_.layout.past_states;
    m_.layout = {0, m_.nq, m_.nq + m_.nv, 2 * m_.nq + m_.nv, 2 * (m_.nq + m_.nv), 0, 0, past};
    int next = m_.layout.parameters;
    for (const RandomizationDescription& d : m_.scene.randomizations) {
      if (!is_of_start(d.number)) vary(d, next);
      m_.drawn_with.push_back(tangere::drawn_with(m_.scene, m_.randomized_row.size()));
      m_.randomized_row.push_back(is_of_start(d.number) ? state_row(d) : next++);
    }
    m_.layout.past = add_derived_rows(m_, next);
    m_.layout.rows = m_.layout.past + past * (m_.nq + m_.nv);
  }

  int state_row(const RandomizationDescription& d) const {
    const int i = joints_.find("joint", d.number.name, d.source), k = d.number.component;
    return d.number.field == NumberField::q ? m_.layout.q + m_.joints[i].q + k
                                            : m_.layout.v + m_.joints[i].v + k;
  }

  /// Lets a coefficient of a contact vary: both halves of a contact of surfaces have it.
  void vary_pair(std::size_t k, NumberField field, int row) {
    m_.pairs[k].parameters[coefficient_index(field)].row = row;
    if (k + 1 < m_.pairs.size() && m_.scene.pair_contacts[k + 1].second_half)
      vary_pair(k + 1, field, row);
  }

  /// Makes a row of the block the source of a number.
  void vary(const RandomizationDescription& d, int row) {
    const SceneNumber& n = d.number;
    const auto coefficient = [&](kernels::ContactParameters& of) {
      of[coefficient_index(n.field)].row = row;
    };
    const auto at = [&](const NameIndex& names, const char* kind, const std::string& name) {
      return std::size_t(names.find(kind, name, d.source));
    };
    switch (n.owner) {
      case NumberOwner::contact:
        vary_pair(at(contacts_, "contact", n.name + " " + n.second_name), n.field, row);
        break;
      case NumberOwner::ground:
        coefficient(m_.grounds[at(grounds_, "ground contact", n.name)].parameters);
        break;
      case NumberOwner::tactile:
        coefficient(m_.sensors[at(sensors_, "tactile sensor", n.name)].parameters);
        break;
      case NumberOwner::loop: vary_loop(m_, d, row); break;
      case NumberOwner::camera: break;  // read where a picture is made
      case NumberOwner::body: vary_body(m_, int(at(bodies_, "body", n.name)), d, row); break;
      case NumberOwner::joint:
      case NumberOwner::motor: {
        const int joint = int(at(joints_, "joint", n.name));
        n.field == NumberField::pos ? vary_place(m_, joint, d, row) : vary_joint(m_, joint, d, row);
        break;
      }
    }
  }

  void symbolic() {
    const bool blocks = !m_.has_followers() && m_.loops.empty() && m_.transmissions.empty() &&
                        prefers_blocks(m_.links, touching_);
    m_.pattern = blocks ? block_pattern(m_.links, m_.nv)
                        : analyse_pattern(m_.links, m_.nv, touching_, {m_.ties, m_.polynomials},
                                          m_.loops, driven_dofs(m_));
  }

  CompiledModel m_;
  NameIndex links_, joints_, bodies_, sensors_, contacts_, grounds_;
  std::vector<std::pair<int, int>> touching_;
  std::map<std::string, std::vector<int>> sensor_points_;  ///< in the order of their contacts
  double reach_of_moved_ = 0;                              ///< of a scene that is far away [m]
  CompiledBody ground_;  ///< the ground, as a plane that is fixed in the world
};

}  // namespace

std::shared_ptr<const CompiledModel> compile(const Scene& scene) {
  auto m = std::make_shared<CompiledModel>(Compiler(scene).run());
  decide_effects(*m);
  list_stages(*m);
  kernels::ModelView& v = m->view;
  v.gravity = vec3_of(m->scene.gravity);
  const GroundDescription ground = m->scene.ground.value_or(GroundDescription{});
  v.ground_point = vec3_of(ground.position);
  if (m->moved) v.ground_point = v.ground_point - m->origin;
  v.ground_normal = vec3_of(ground.normal);
  v.ground = ground_frame(v.ground_point, v.ground_normal);
  for (std::size_t k = 0; k < m->bodies.size(); ++k)
    m->solids.push_back(solid_of(m->scene.links[k].body.shape, m->bodies[k]));
  point_view(*m);
  compile_shear_springs(*m);
  compile_dry_friction(*m);
  return m;
}

}  // namespace tangere
