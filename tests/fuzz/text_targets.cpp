// SPDX-License-Identifier: Apache-2.0
// Scenes are compiled and make one step too: a number that a reader lets through must not hurt
// later.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <memory>
#include <span>

#include "engine/sense/readout.hpp"
#include "engine/step/control.hpp"
#include "engine/step/stepper.hpp"
#include "io/files/csv.hpp"
#include "io/robot/robot_import.hpp"
#include "io/scene/convex_hull.hpp"
#include "io/scene/scene_reader.hpp"
#include "io/scene/surface_files.hpp"
#include "io/scene/tactile_layouts.hpp"
#include "tests/files.hpp"
#include "tests/fuzz/targets.hpp"

namespace tangere::fuzz {
namespace {

namespace fs = std::filesystem;

constexpr const char* kScenes = TANGERE_TEST_DATA "/scenes/";

/// Large grids are no mistakes, but take a mutant seconds.
void make_small(Scene& scene) {
  const auto few = [](int& n) { n = std::min(n, 12); };
  for (LinkDescription& link : scene.links) {
    if (auto* box = std::get_if<CuboidShape>(&link.body.shape))
      for (int& n : box->contact_resolution) few(n);
    if (auto* rod = std::get_if<CapsuleShape>(&link.body.shape)) few(rod->contact_rings);
    if (auto* rod = std::get_if<CylinderShape>(&link.body.shape)) few(rod->contact_rings);
  }
  for (TactileDescription& sensor : scene.sensors)
    for (int* n : {&sensor.array.rows, &sensor.array.cols}) *n = std::min(*n, 64);
}

void run_scene(const std::string& path) {
  SceneFile file = read_scene(path);
  make_small(file.scene);
  const Model model(file.scene);
  Batch batch(model, 2, 1);
  Stepper stepper(model);
  ControlProgram controls(model, model.timestep(), 0);
  std::vector<double> u(2 * static_cast<std::size_t>(model.nu()), 0.5);
  stepper.step(batch, u);
  Readout readout(model);
  for (std::size_t s = 0; s < model.sensors().size(); ++s) {
    std::vector<double> field(3 * static_cast<std::size_t>(model.sensors()[s].points));
    readout.tactile(batch, 0, static_cast<int>(s), field);
  }
}

std::vector<std::string> scenes(const std::string& folder) {
  for (const char* beside : {"tripod.txt", "wedge.obj", "meshes"})
    fs::copy(std::string(kScenes) + beside, fs::path(folder) / beside, fs::copy_options::recursive);
  std::vector<std::string> corpus;
  for (const char* name :
       {"dialect_finger", "dialect_hand", "dialect_yard", "every_joint", "published_dialect_pad",
        "shapes", "two_balls", "units_cm_g", "units_m_kg"})
    corpus.push_back(file_bytes(std::string(kScenes) + name + ".xml"));
  for (const char* name :
       {"rolling_ball_small", "box_pushing", "cap_opening", "insertion", "stable_grasp"})
    corpus.push_back(file_bytes(std::string(TANGERE_SOURCE_DIR "/scenes/") + name + ".xml"));
  // A scene of two files, of which the mutants change the first.
  fs::copy(TANGERE_SOURCE_DIR "/scenes/sensors/fingertip_guess.xml", fs::path(folder) / "tip.xml");
  fs::copy(std::string(kScenes) + "included_ball.xml", fs::path(folder) / "included_ball.xml");
  corpus.push_back(file_bytes(std::string(kScenes) + "including.xml"));
  corpus.push_back(small_scene());
  return corpus;
}

constexpr const char* kRobots = TANGERE_TEST_DATA "/robots/";

/// Robots become scenes, which are compiled. What is left out is no error here.
void run_robot(const std::string& folder) {
  static_cast<void>(import_robot(folder + "/mutant", folder + "/scene.xml"));
}

/// The robots of a format, with the files that they name beside them.
auto robots(std::initializer_list<const char*> names) {
  return [names = std::vector<std::string>(names.begin(), names.end())](const std::string& folder) {
    for (const char* beside : {"meshes", "part.xml", "models_part.xml"})
      fs::copy(std::string(kRobots) + beside, fs::path(folder) / beside,
               fs::copy_options::recursive);
    std::vector<std::string> corpus;
    for (const std::string& name : names) {
      std::string text = file_bytes(kRobots + name);
      const std::string package = "package://robots/";
      for (std::size_t at = 0; (at = text.find(package)) != std::string::npos;)
        text.erase(at, package.size());
      corpus.push_back(std::move(text));
    }
    return corpus;
  };
}

/// Names that an <include> should not have, and files that lead nowhere: rings, a chain of 300, a
/// folder, files of other kinds and programs.
void hostile_files(const fs::path& folder, const char* root, const char* inside) {
  const auto write = [&](const std::string& name, const std::string& file) {
    std::ofstream(folder / name) << "<" << root << ">" << inside << "<include file=\"" << file
                                 << "\"/></" << root << ">";
  };
  write("itself.xml", "itself.xml");
  write("ring_a.xml", "ring_b.xml");
  write("ring_b.xml", "../folder/ring_a.xml");
  write("back.xml", "mutant");
  for (int k = 0; k < 300; ++k)
    write("deep_" + std::to_string(k) + ".xml", "deep_" + std::to_string(k + 1) + ".xml");
  std::ofstream(folder / "deep_300.xml") << "<" << root << "/>";
  std::ofstream(folder / "empty.xml");
  std::ofstream(folder / "cut.xml") << "<" << root << "><link";
  fs::create_directory(folder / "folder.xml");
  fs::create_symlink("loop.xml", folder / "loop.xml");
}
const std::vector<std::string> kHostileNames = {"mutant",
                                                "./mutant",
                                                "itself.xml",
                                                "ring_a.xml",
                                                "back.xml",
                                                "deep_0.xml",
                                                "deep_250.xml",
                                                "empty.xml",
                                                "cut.xml",
                                                "folder.xml",
                                                "loop.xml",
                                                "meshes/wedge.obj",
                                                "none.xml",
                                                "..",
                                                ".",
                                                "/",
                                                "",
                                                "/etc/passwd",
                                                "/dev/zero",
                                                "/proc/self/mem",
                                                "../../../../../../../../etc/hosts",
                                                std::string(5000, 'a'),
                                                "a/" + std::string(300, '/') + "b",
                                                "part.xml/",
                                                "part.xml&#10;x",
                                                "mesh\xff"};

/// A file that is no whole one of the corpus gets hostile names in its <include>s, and one more, as
/// its own bytes say.
void make_hostile(const std::string& path, const std::vector<std::string>& corpus) {
  std::string text = file_bytes(path);
  if (std::find(corpus.begin(), corpus.end(), text) != corpus.end()) return;
  std::size_t choice = std::hash<std::string>{}(text);
  const auto include = [&] {
    const std::string& name = kHostileNames[choice % kHostileNames.size()];
    choice = choice * 6364136223846793005 + 1442695040888963407;
    return "<include file=\"" + name + "\"";
  };
  for (std::size_t at = 0; (at = text.find("<include file=\"", at)) != std::string::npos; ++at)
    if (const std::size_t end = text.find('"', at + 15); end != std::string::npos && choice % 4 > 0)
      text.replace(at, end + 1 - at, include());
  if (const std::size_t at = text.find('>', choice % (text.size() + 1)); at != std::string::npos)
    text.insert(at + 1, include() + "/>");
  std::ofstream(path, std::ios::binary) << text;
}

/// Files that include others, with hostile names. `read` gets the file.
Target hostile(const std::string& name, const char* root, const char* inside,
               const std::function<std::vector<std::string>(const std::string&)>& prepare,
               const std::function<void(const std::string&)>& read) {
  const auto corpus = std::make_shared<std::vector<std::string>>();
  return {name, false, "mutant",
          [=](const std::string& folder) {
            hostile_files(folder, root, inside);
            return *corpus = prepare(folder);
          },
          [=](const std::string& folder) {
            make_hostile(folder + "/mutant", *corpus);
            read(folder);
          }};
}

std::vector<std::string> tables(const std::string&) {
  return {"a,b,c\n0,0.5,-1\n# a remark\n\n1e-3,+2,3\n", "0,1,2\r\n3,4,5\r\n", "1,2,3",
          file_bytes(TANGERE_TEST_DATA "/rolling_ball/u.csv").substr(0, 600)};
}

/// Blocks that lie flush on each other in part, one with reentrant faces.
const char* const kFlushBlocks =
    "v 0 0 0\nv 4 0 0\nv 4 4 0\nv 3 4 0\nv 3 1 0\nv 0 1 0\n"
    "v 0 0 2\nv 4 0 2\nv 4 4 2\nv 3 4 2\nv 3 1 2\nv 0 1 2\n"
    "f 6 5 4 3 2 1\nf 7 8 9 10 11 12\nf 1 2 8 7\nf 2 3 9 8\nf 3 4 10 9\nf 4 5 11 10\n"
    "f 5 6 12 11\nf 6 1 7 12\n"
    "v 3 1 0\nv 3 3 0\nv 1 3 0\nv 1 1 0\nv 3 1 1\nv 3 3 1\nv 1 3 1\nv 1 1 1\n"
    "f 16 15 14 13\nf 17 18 19 20\nf 13 14 18 17\nf 14 15 19 18\nf 15 16 20 19\n"
    "f 16 13 17 20\n";

std::vector<std::string> meshes(const std::string&) {
  return {kFlushBlocks, file_bytes(TANGERE_TEST_DATA "/scenes/wedge.obj"),
          file_bytes(TANGERE_TEST_DATA "/scenes/meshes/tetrahedron.obj")};
}

/// A tetrahedron, its faces seen from outside.
constexpr float kCorners[4][3] = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
constexpr std::int32_t kFaces[4][3] = {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}};

template <class T>
void put(std::string& bytes, const T& number) {
  bytes.append(reinterpret_cast<const char*>(&number), sizeof number);
}

std::vector<std::string> stl_files(const std::string&) {
  std::string text = "solid t\n", bytes(80, 'x');
  put(bytes, std::uint32_t{4});
  for (const auto& face : kFaces) {
    text += "facet normal 0 0 0\n outer loop\n";
    for (int k = 0; k < 3; ++k) put(bytes, 0.0F);
    for (const std::int32_t corner : face) {
      text += "  vertex";
      for (const float x : kCorners[corner]) {
        text += " " + std::to_string(x);
        put(bytes, x);
      }
      text += "\n";
    }
    text += " endloop\nendfacet\n";
    put(bytes, std::uint16_t{0});
  }
  return {text + "endsolid t\n", bytes};
}

std::vector<std::string> ply_files(const std::string&) {
  const auto header = [](const std::string& format) {
    return "ply\nformat " + format +
           " 1.0\ncomment by hand\nelement vertex 4\nproperty float x\nproperty float y\n"
           "property float z\nelement edge 1\nproperty list uchar int v\nelement face 4\n"
           "property list uchar int vertex_indices\nend_header\n";
  };
  std::string text = header("ascii"), little = header("binary_little_endian"),
              big = header("binary_big_endian");
  const auto put_all = [&](const auto& number) {
    std::string raw;
    put(raw, number);
    little += raw;
    big += std::string(raw.rbegin(), raw.rend());
    text += std::to_string(number) + " ";
  };
  for (const auto& corner : kCorners)
    for (const float x : corner) put_all(x);
  put_all(std::uint8_t{1}), put_all(std::int32_t{2});
  for (const auto& face : kFaces) {
    put_all(std::uint8_t{3});
    for (const std::int32_t corner : face) put_all(corner);
    text += "\n";
  }
  return {text, little, big};
}

std::vector<std::string> contact_points(const std::string&) {
  return {file_bytes(TANGERE_TEST_DATA "/scenes/tripod.txt"), "2\n1 +2 3\n\n-1e-3 0 5\n"};
}

std::vector<std::string> layouts(const std::string&) {
  return {
      "2\n\"0 0 1\" \"0 1\" \"0 0 1\" \"1 0 0\" \"0 1 0\"\n"
      "\"1 0 1\" \"-1 -1\" \"0 0 2\" \"1 0 0\" \"0 1 0\" \"1 2 0.5 0\"\n",
      "1 # points\n0.5 -2e-1 0 3 4 0 0 1 1 0 0 0 1 0\n"};
}

}  // namespace

std::vector<Target> text_targets() {
  const std::vector<std::string> names = {"a", "b", "c"};
  const auto in = [](const std::string& folder) { return folder + "/mutant"; };
  // The name of a surface says how it is written.
  const auto surface = [](const std::string& name, const auto& corpus) {
    const std::string file = "mutant." + name;
    return Target{name, false, file, corpus, [=](const std::string& folder) {
                    const FileSurface read = read_faces(folder + "/" + file);
                    const MeshShape hull = convex_hull(read.points);
                    if (read.fault.empty() && !surface_fault(read.closed).empty())
                      throw std::logic_error("a surface is open: " + surface_fault(read.closed));
                    if (!hull.triangles.empty() && !surface_fault(hull).empty())
                      throw std::logic_error("a hull is open: " + surface_fault(hull));
                    static_cast<void>(mesh_points(read_surface(folder + "/" + file), 0.1, 10'000));
                  }};
  };
  return {
      {"scene", false, "mutant", scenes, [=](const auto& f) { run_scene(in(f)); }},
      {"urdf", false, "mutant", robots({"hand.urdf", "gripper.urdf"}), run_robot},
      {"mjcf", false, "mutant",
       robots({"machine.xml", "meshes.xml", "arm.xml", "including.xml", "models.xml"}), run_robot},
      hostile("mjcf_includes", "mujoco", "<body name=\"x\"/>",
              robots({"including.xml", "machine.xml"}), run_robot),
      hostile("scene_includes", "tangere", "<robot/>", scenes,
              [=](const auto& f) { run_scene(in(f)); }),
      {"table", false, "mutant", tables,
       [=](const auto& f) { static_cast<void>(read_csv(in(f), 3, names)); }},
      surface("obj", meshes),
      surface("stl", stl_files),
      surface("ply", ply_files),
      {"contact_points", false, "mutant", contact_points,
       [=](const auto& f) { static_cast<void>(read_contact_points(in(f))); }},
      {"layout", false, "mutant", layouts,
       [=](const auto& f) { static_cast<void>(read_tactile_points(in(f))); }}};
}

}  // namespace tangere::fuzz
