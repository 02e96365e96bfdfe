// SPDX-License-Identifier: Apache-2.0
// One row for each shape: its name and size in files, its mass and inertia for uniform density, and
// its contact points.
#include "engine/scene/shapes.hpp"

#include <algorithm>
#include <cmath>

#include "engine/base/vector3.hpp"
#include "engine/scene/frames.hpp"
#include "engine/scene/mass_properties.hpp"
#include "engine/scene/scene_number.hpp"
#include "engine/scene/schema.hpp"
#include "kernels/contact/distance.hpp"
#include "kernels/numbers/dual.hpp"

namespace tangere {

namespace {

// --- masses: the numbers of a size in the order of SizeNumber::component, over any number type ---

/// Mass and principal inertia, over any number type.
template <class T>
struct Principal {
  T mass, xx, yy, zz;
};

struct BallMass {
  template <class T>
  static Principal<T> of(double density, const T* n) {
    const T& r = n[0];
    const T mass = density * 4.0 / 3.0 * M_PI * r * r * r, inertia = 0.4 * mass * r * r;
    return {mass, inertia, inertia, inertia};
  }
};

struct CuboidMass {
  template <class T>
  static Principal<T> of(double density, const T* n) {
    const T &x = n[0], &y = n[1], &z = n[2];
    const T mass = density * x * y * z;
    return {mass, mass / 12 * (y * y + z * z), mass / 12 * (x * x + z * z),
            mass / 12 * (x * x + y * y)};
  }
};

struct CylinderMass {
  template <class T>
  static Principal<T> of(double density, const T* n) {
    const T &r = n[0], &l = n[1];
    const T square = r * r, mass = density * M_PI * square * l;
    const T across = mass / 12 * (3 * square + l * l);
    return {mass, across, across, mass / 2 * square};
  }
};

/// A cylinder and two half balls, each with its centre of mass 3 r/8 beyond the cylinder's end.
struct CapsuleMass {
  template <class T>
  static Principal<T> of(double density, const T* n) {
    const T &r = n[0], &l = n[1];
    const T tube = density * M_PI * r * r * l, ball = density * 4.0 / 3.0 * M_PI * r * r * r;
    const T across =
        tube * (l * l / 12 + r * r / 4) + ball * (0.4 * r * r + l * l / 4 + 0.375 * l * r);
    return {tube + ball, across, across, tube * r * r / 2 + 0.4 * ball * r * r};
  }
};

struct EllipsoidMass {
  template <class T>
  static Principal<T> of(double density, const T* n) {
    const T &x = n[0], &y = n[1], &z = n[2];
    const T mass = density * M_PI / 6.0 * x * y * z;
    return {mass, mass / 20 * (y * y + z * z), mass / 20 * (x * x + z * z),
            mass / 20 * (x * x + y * y)};
  }
};

MassProperties centred(const Principal<double>& p) {
  return {p.mass, {0, 0, 0}, {{{p.xx, 0, 0}, {0, p.yy, 0}, {0, 0, p.zz}}}};
}
template <class Form>
MassProperties mass_of(const Shape& shape, double density) {
  double n[3] = {0, 0, 0};
  Shape copy = shape;
  for (const SizeNumber& s : row_of(shape).sizes) n[s.component] = *s.at(copy);
  return centred(Form::of(density, n));
}
template <class Form>
MassProperties mass_slope(const Shape& shape, double density, int which) {
  using D = kernels::Dual<double>;
  D n[3] = {0, 0, 0};
  Shape copy = shape;
  for (const SizeNumber& s : row_of(shape).sizes)
    n[s.component] = D(*s.at(copy), s.which == which ? 1 : 0);
  const Principal<D> p = Form::of(density, n);
  return centred({p.mass.epsilon, p.xx.epsilon, p.yy.epsilon, p.zz.epsilon});
}

/// Volume, its moment and its second moments grow with the third, fourth and fifth power.
MassProperties scaled_mass(const Shape& shape, double density, double s, double mass_factor,
                           double centre_factor, double inertia_factor) {
  const MassProperties one = mesh_mass(std::get<MeshShape>(shape), density);
  return {mass_factor * s * s * one.mass, centre_factor * one.centre,
          (inertia_factor * s * s * s * s) * one.inertia};
}
MassProperties mesh_mass_of(const Shape& shape, double density) {
  const double s = std::get<MeshShape>(shape).scale;
  return scaled_mass(shape, density, s, s, s, s);
}
MassProperties mesh_mass_slope(const Shape& shape, double density, int) {
  return scaled_mass(shape, density, std::get<MeshShape>(shape).scale, 3, 1, 5);
}

// --- contact points ---

/// Returns the surface nodes of the grid.
std::vector<double> points_of(const CuboidShape& shape) {
  const std::array<int, 3>& n = shape.contact_resolution;
  std::vector<double> points;
  const auto coordinate = [&](int axis, int i) {
    return -0.5 * shape.size[axis] + i * (shape.size[axis] / (n[axis] - 1));
  };
  const auto on_face = [&](int axis, int i) { return i == 0 || i == n[axis] - 1; };
  for (int i = 0; i < n[0]; ++i)
    for (int j = 0; j < n[1]; ++j)
      for (int k = 0; k < n[2]; ++k) {
        if (!on_face(0, i) && !on_face(1, j) && !on_face(2, k)) continue;
        points.insert(points.end(), {coordinate(0, i), coordinate(1, j), coordinate(2, k)});
      }
  return points;
}

/// Appends `count` points around z, the first along x.
void add_ring(std::vector<double>& points, int count, double radius, double z) {
  for (int j = 0; j < count; ++j) {
    const double angle = 2 * M_PI * j / count;
    points.insert(points.end(), {radius * std::cos(angle), radius * std::sin(angle), z});
  }
}

std::vector<double> points_of(const CylinderShape& shape) {
  std::vector<double> points;
  for (const double z : {-0.5 * shape.length, 0.5 * shape.length}) {
    points.insert(points.end(), {0, 0, z});
    for (int k = 1; k <= shape.contact_rings; ++k)
      add_ring(points, shape.contact_angles, shape.radius * k / shape.contact_rings, z);
  }
  return points;
}

std::vector<double> points_of(const CapsuleShape& shape) {
  const double pole = 0.5 * shape.length + shape.radius;
  std::vector<double> points = {0, 0, pole, 0, 0, -pole};
  const int rings = shape.contact_rings;
  for (int k = 0; k < rings; ++k) {
    const double along =
        rings > 1 ? double(k) / (rings - 1) : 0.5;  // a single ring goes around the middle
    add_ring(points, shape.contact_angles, shape.radius, shape.length * (along - 0.5));
  }
  return points;
}

/// Each point stands for the same area of the ball.
std::vector<double> points_of(const EllipsoidShape& shape) {
  std::vector<double> points;
  const int count = shape.contact_count;
  for (int i = 0; i < count; ++i) {
    const double z = 1 - (2 * i + 1.0) / count, across = std::sqrt(1 - z * z);
    const double turn = M_PI * (3 - std::sqrt(5.0)) * i;  // the golden angle
    points.insert(points.end(),
                  {0.5 * shape.size[0] * across * std::cos(turn),
                   0.5 * shape.size[1] * across * std::sin(turn), 0.5 * shape.size[2] * z});
  }
  return points;
}

std::vector<double> points_of(const MeshShape& mesh) {
  std::vector<double> points = mesh.contact_points.empty() ? mesh.vertices : mesh.contact_points;
  for (double& x : points) x *= mesh.scale;
  return points;
}

template <class S>
std::vector<double> points_on(const Shape& shape) {
  return points_of(std::get<S>(shape));
}

// --- widths ---

HalfWidths ball_widths(const Vector3& s) { return {{}, {s[0], s[0], s[0]}}; }
HalfWidths cuboid_widths(const Vector3& s) { return {s, {}}; }
HalfWidths cylinder_widths(const Vector3& s) { return {{0, 0, s[1]}, {s[0], s[0], 0}}; }
HalfWidths capsule_widths(const Vector3& s) { return {{0, 0, s[1]}, {s[0], s[0], s[0]}}; }
HalfWidths ellipsoid_widths(const Vector3& s) { return {{}, s}; }

// --- the table ---

template <class S>
Shape make() {
  return S{};
}
template <class S>
double* radius(Shape& shape) {
  return &std::get<S>(shape).radius;
}
template <class S>
double* length(Shape& shape) {
  return &std::get<S>(shape).length;
}
template <class S, int Axis>
double* edge(Shape& shape) {
  return &std::get<S>(shape).size[Axis];
}
template <class S, auto Member>
int* count(Shape& shape) {
  return &(std::get<S>(shape).*Member);
}
template <int Axis>
int* cuboid_nodes(Shape& shape) {
  return &std::get<CuboidShape>(shape).contact_resolution[Axis];
}

double* mesh_scale(Shape& shape) { return &std::get<MeshShape>(shape).scale; }

/// Returns a size as three lengths along the body's axes.
template <class S>
std::vector<SizeNumber> edges() {
  return {{2, 0, 0.5, edge<S, 0>}, {3, 1, 0.5, edge<S, 1>}, {4, 2, 0.5, edge<S, 2>}};
}
template <class S>
std::vector<SizeNumber> rod() {
  return {{1, 1, 0.5, length<S>}, {0, 0, 1, radius<S>}};
}

const std::vector<ShapeRow>& table() {
  static const std::vector<ShapeRow> rows = {
      {.name = "sphere",
       .make = make<SphereShape>,
       .distance = PrimitiveShape::sphere,
       .sizes = {{0, 0, 1, radius<SphereShape>}},
       .mass = mass_of<BallMass>,
       .mass_by_size = mass_slope<BallMass>,
       .half_widths = ball_widths},
      {.name = "cuboid",
       .make = make<CuboidShape>,
       .distance = PrimitiveShape::cuboid,
       .sizes = edges<CuboidShape>(),
       .counts = {{"general_contact_resolution",
                   2,
                   {cuboid_nodes<0>, cuboid_nodes<1>, cuboid_nodes<2>}}},
       .mass = mass_of<CuboidMass>,
       .mass_by_size = mass_slope<CuboidMass>,
       .points = points_on<CuboidShape>,
       .half_widths = cuboid_widths},
      {.name = "cylinder",
       .make = make<CylinderShape>,
       .distance = PrimitiveShape::cylinder,
       .sizes = rod<CylinderShape>(),
       .counts = {{"general_contact_angle_resolution",
                   3,
                   {count<CylinderShape, &CylinderShape::contact_angles>}},
                  {"general_contact_radius_resolution",
                   1,
                   {count<CylinderShape, &CylinderShape::contact_rings>}}},
       .mass = mass_of<CylinderMass>,
       .mass_by_size = mass_slope<CylinderMass>,
       .points = points_on<CylinderShape>,
       .half_widths = cylinder_widths},
      {.name = "capsule",
       .make = make<CapsuleShape>,
       .distance = PrimitiveShape::capsule,
       .sizes = rod<CapsuleShape>(),
       .counts = {{"general_contact_resolution",
                   2,
                   {count<CapsuleShape, &CapsuleShape::contact_rings>,
                    count<CapsuleShape, &CapsuleShape::contact_angles>}}},
       .mass = mass_of<CapsuleMass>,
       .mass_by_size = mass_slope<CapsuleMass>,
       .points = points_on<CapsuleShape>,
       .half_widths = capsule_widths},
      {.name = "ellipsoid",
       .make = make<EllipsoidShape>,
       .distance = PrimitiveShape::ellipsoid,
       .sizes = edges<EllipsoidShape>(),
       .counts = {{"general_contact_resolution",
                   4,
                   {count<EllipsoidShape, &EllipsoidShape::contact_count>}}},
       .mass = mass_of<EllipsoidMass>,
       .mass_by_size = mass_slope<EllipsoidMass>,
       .points = points_on<EllipsoidShape>,
       .half_widths = ellipsoid_widths,
       .slenderness = 100},
      {.name = "plane",
       .make = make<PlaneShape>,
       .distance = PrimitiveShape::plane,
       .bounded = false},
      {.name = "mesh",
       .make = make<MeshShape>,
       .distance = PrimitiveShape::mesh,
       .sizes = {{kScaleIndex, 0, 1, mesh_scale}},
       .mass = mesh_mass_of,
       .mass_by_size = mesh_mass_slope,
       .points = points_on<MeshShape>},
      {.name = "abstract",
       .make = make<AbstractShape>,
       .mass =
           [](const Shape& s, double) {
             const auto& a = std::get<AbstractShape>(s);
             const std::array<double, 6>& i = a.inertia;
             return MassProperties{
                 a.mass, {0, 0, 0}, {{{i[0], i[1], i[2]}, {i[1], i[3], i[4]}, {i[2], i[4], i[5]}}}};
           },
       .points = [](const Shape& s) { return std::get<AbstractShape>(s).contact_points; }}};
  return rows;
}

}  // namespace

const SizeNumber* ShapeRow::size(int which) const {
  for (const SizeNumber& s : sizes)
    if (s.which == which) return &s;
  return nullptr;
}

std::span<const ShapeRow> shape_rows() { return table(); }
const ShapeRow& row_of(const Shape& shape) {
  return table()[shape.index()];  // in the order of its alternatives: Shapes.TheTableIsInOrder
}
const ShapeRow& row_of(PrimitiveShape shape) {
  return *std::find_if(table().begin(), table().end(),
                       [shape](const ShapeRow& row) { return row.distance == shape; });
}

std::string with_article(const char* name) {
  return (std::string("aeiou").find(name[0]) != std::string::npos ? "an " : "a ") +
         std::string(name);
}
std::string shapes_with(const std::function<bool(const ShapeRow&)>& has) {
  std::vector<const char*> names;
  for (const ShapeRow& row : shape_rows())
    if (has(row)) names.push_back(row.name);
  std::string text = with_article(names[0]);
  for (std::size_t k = 1; k < names.size(); ++k)
    text += (k + 1 < names.size() ? ", " : " or ") + std::string(names[k]);
  return text;
}

std::string slenderness_fault(const ShapeRow& row, double least, double most) {
  if (row.slenderness == 0 || most <= row.slenderness * least) return "";
  return with_article(row.name) + " with a longest number of its size " +
         std::to_string(most / least) + " times the shortest; expected at most " +
         std::to_string(static_cast<int>(row.slenderness)) + " times";
}
std::string slenderness_fault(const Shape& shape) {
  const ShapeRow& row = row_of(shape);
  if (row.slenderness == 0) return "";
  Shape copy = shape;
  double least = INFINITY, most = 0;
  for (const SizeNumber& s : row.sizes)
    least = std::min(least, *s.at(copy)), most = std::max(most, *s.at(copy));
  return slenderness_fault(row, least, most);
}

// --- queries ---

std::vector<NamedSize> named_sizes(const Shape& shape) {
  Shape copy = shape;
  std::vector<NamedSize> out;
  if (std::holds_alternative<MeshShape>(shape)) return out;
  const ShapeRow& row = row_of(shape);
  for (int which = 0; which < kScaleIndex; ++which) {
    const SizeNumber* const n = row.size(which);
    if (n == nullptr) continue;
    const char* const name = number_kind(NumberOwner::body, size_of_body("", which).field).name;
    if (out.empty() || std::string_view(out.back().name) != name) out.push_back({name, {}});
    out.back().values.push_back(*n->at(copy));
  }
  return out;
}

double volume_of(const Shape& shape) { return mass_properties(shape, 1).mass; }

const char* shape_name(const Shape& shape) { return row_of(shape).name; }
bool has_distance(const Shape& shape) {
  const auto* const mesh = std::get_if<MeshShape>(&shape);
  return row_of(shape).distance.has_value() && (mesh == nullptr || mesh->resolution > 0);
}
bool is_ball(const Shape& shape) {
  return row_of(shape).distance.has_value() && kernels::is_ball(*row_of(shape).distance);
}
bool has_contact_points(const Shape& shape) {
  const ShapeRow& row = row_of(shape);
  return row.stretches() || !contact_points(shape).empty();
}
bool can_touch(const Shape& general, const Shape& primitive) {
  return has_distance(primitive) &&
         (has_contact_points(general) ||
          (is_ball(general) && !std::holds_alternative<MeshShape>(primitive)));
}

double* size_number(Shape& shape, int which) {
  const SizeNumber* s = row_of(shape).size(which);
  return s == nullptr ? nullptr : s->at(shape);
}

MassProperties mass_properties(const Shape& shape, double density) {
  const ShapeRow& row = row_of(shape);
  return row.mass != nullptr ? row.mass(shape, density) : centred({0, 0, 0, 0});
}
std::array<double, 6> solid_inertia(const Shape& shape, double mass) {
  const MassProperties dense = mass_properties(shape, 1);
  const double density = row_of(shape).sizes.empty() ? 1 : mass / dense.mass;
  const auto& i = dense.inertia.m;
  return {density * i[0][0], density * i[0][1], density * i[0][2],
          density * i[1][1], density * i[1][2], density * i[2][2]};
}
MassProperties mass_properties_by_size(const Shape& shape, double density, int which) {
  return row_of(shape).mass_by_size(shape, density, which);
}

std::vector<double> contact_points(const Shape& shape) {
  const ShapeRow& row = row_of(shape);
  return row.points != nullptr ? row.points(shape) : std::vector<double>{};
}

Vector3 size_in_kernels(const Shape& shape) {
  Vector3 size{0, 0, 0};
  for (const SizeNumber& s : row_of(shape).sizes)
    // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast): only read
    size[std::size_t(s.component)] = s.scale * *s.at(const_cast<Shape&>(shape));
  return size;
}

std::array<double, 3> widths(const Shape& shape) {
  const ShapeRow& row = row_of(shape);
  if (row.half_widths == nullptr) return {0, 0, 0};
  const HalfWidths half = row.half_widths(size_in_kernels(shape));
  return 2.0 * (half.straight + half.round);
}

std::optional<SurfaceDistance> distance_from(const Shape& shape, const Vector3& point) {
  const std::optional<PrimitiveShape> kind = row_of(shape).distance;
  if (!kind || kind == PrimitiveShape::mesh) return std::nullopt;
  const kernels::Vec3<double> size = vec3_of(size_in_kernels(shape));
  return kernels::with_distance<double>(*kind, size, [&](const auto& solid) {
    const kernels::Distance<double> at = kernels::distance_at(solid, vec3_of(point));
    return SurfaceDistance{at.d, {at.n.x, at.n.y, at.n.z}};
  });
}

}  // namespace tangere
