// SPDX-License-Identifier: Apache-2.0
// One table for each element.
#include "io/robot/mjcf_words.hpp"

#include <map>

namespace tangere {
namespace {

const char* const kUser = "numbers for other programs";
const char* const kLaw = "coefficients of MuJoCo's contacts; scenes have laws of their own";

Words actuator_words(std::initializer_list<const char*> own) {
  Words words = {{"name"},
                 {"class"},
                 {"joint"},
                 {"jointinparent"},
                 {"ctrllimited"},
                 {"forcelimited"},
                 {"ctrlrange"},
                 {"forcerange"},
                 {"gear"},
                 {"tendon"},
                 {"site"},
                 {"body"},
                 {"cranksite"},
                 {"slidersite"},
                 {"refsite"},
                 {"cranklength", Fate::zero, "of a slider-crank"},
                 {"group"},
                 {"user", Fate::idle, kUser},
                 {"damping", Fate::zero, "damping that the actuator adds to its joint"},
                 {"armature", Fate::zero, "armature that the actuator adds to its joint"},
                 {"input", Fate::lost, "what the control is"},
                 {"lengthrange", Fate::idle, "for muscles"},
                 {"actlimited", Fate::idle, "for actuators with a state"},
                 {"actrange", Fate::idle, "for actuators with a state"},
                 {"actearly", Fate::idle, "for actuators with a state"},
                 {"actdim", Fate::idle, "for actuators with a state"},
                 {"delay", Fate::zero, "delays the control"},
                 {"nsample", Fate::zero, "delays the control"},
                 {"interp", Fate::idle, "of a delayed control"}};
  for (const char* name : own) words.push_back({name});
  return words;
}

Words joint_words() {
  return {{"name"},
          {"class"},
          {"type"},
          {"pos"},
          {"axis"},
          {"range"},
          {"limited"},
          {"stiffness"},
          {"springref"},
          {"damping"},
          {"armature"},
          {"ref"},
          {"actuatorfrcrange"},
          {"actuatorfrclimited"},
          {"frictionloss"},
          {"springdamper", Fate::zero, "chooses stiffness and damping from a frequency"},
          {"springyield", Fate::zero, "bounds the force of the spring"},
          {"actuatorgravcomp", Fate::idle, "of bodies without weight"},
          {"group", Fate::idle, kSight},
          {"user", Fate::idle, kUser},
          {"margin", Fate::idle, "of MuJoCo's limits; here limits are springs"},
          {"solreflimit", Fate::idle, "of MuJoCo's limits; here limits are springs"},
          {"solimplimit", Fate::idle, "of MuJoCo's limits; here limits are springs"},
          {"solreffriction", Fate::idle, kSolverSetting},
          {"solimpfriction", Fate::idle, kSolverSetting}};
}

Words tendon_words() {
  Words words = {{"name"},
                 {"class"},
                 {"limited"},
                 {"range"},
                 {"stiffness"},
                 {"springlength"},
                 {"damping"},
                 {"armature"},
                 {"frictionloss"},
                 {"actuatorfrcrange", Fate::lost, "bounds the sum of actuators of a tendon"},
                 {"actuatorfrclimited", Fate::idle, "of a bound"},
                 {"margin", Fate::idle, "of MuJoCo's limits; here limits are springs"},
                 {"user", Fate::idle, kUser}};
  for (const char* name : {"group", "width", "material", "rgba"})
    words.push_back({name, Fate::idle, kSight});
  for (const char* name : {"solreflimit", "solimplimit"})
    words.push_back({name, Fate::idle, "of MuJoCo's limits; here limits are springs"});
  for (const char* name : {"solreffriction", "solimpfriction"})
    words.push_back({name, Fate::idle, kSolverSetting});
  return words;
}

std::map<std::string, Words> all_words() {
  std::map<std::string, Words> all;
  all["joint"] = joint_words();
  all["tendon"] = tendon_words();
  all["geom"] = with_rotations({{"name"},
                                {"class"},
                                {"type"},
                                {"size"},
                                {"fromto"},
                                {"mass"},
                                {"density"},
                                {"mesh"},
                                {"rgba"},
                                {"material"},
                                {"contype"},
                                {"conaffinity"},
                                {"group"},
                                {"shellinertia"},
                                {"hfield"},
                                {"condim", Fate::idle, kLaw},
                                {"friction", Fate::idle, kLaw},
                                {"solref", Fate::idle, kLaw},
                                {"solimp", Fate::idle, kLaw},
                                {"solmix", Fate::idle, kLaw},
                                {"priority", Fate::idle, kLaw},
                                {"margin", Fate::idle, kLaw},
                                {"gap", Fate::idle, kLaw},
                                {"adhesion", Fate::zero, "pulls what touches"},
                                {"surfacevel", Fate::zero, "moves the surface of a geom"},
                                {"castshadow", Fate::idle, kSight},
                                {"fitscale", Fate::idle, "no primitive is fitted to a mesh"},
                                {"fluidshape", Fate::lost, "forces of a fluid"},
                                {"fluidcoef", Fate::idle, "of a fluid"},
                                {"user", Fate::idle, kUser}});
  all["site"] = with_rotations({{"name"},
                                {"class"},
                                {"fromto"},
                                {"type", Fate::idle, kSight},
                                {"size", Fate::idle, kSight},
                                {"material", Fate::idle, kSight},
                                {"rgba", Fate::idle, kSight},
                                {"group", Fate::idle, kSight},
                                {"user", Fate::idle, kUser}});
  all["mesh"] = {{"name"},
                 {"class"},
                 {"file"},
                 {"scale"},
                 {"inertia"},
                 {"refpos"},
                 {"refquat"},
                 {"vertex"},
                 {"builtin"},
                 {"params"},
                 {"content_type", Fate::idle, kSolverSetting},
                 {"face"},
                 {"normal", Fate::idle, kSight},
                 {"texcoord", Fate::idle, kSight},
                 {"smoothnormal", Fate::idle, kSight},
                 {"maxhullvert", Fate::idle, "meshes are not replaced by hulls"},
                 {"octree_maxdepth", Fate::idle, kSolverSetting},
                 {"material", Fate::idle, kSight}};
  all["material"] = {{"name"}, {"class"}, {"rgba"}, {"specular"}, {"shininess"}, {"emission"}};
  for (const char* name :
       {"texture", "texrepeat", "texuniform", "reflectance", "metallic", "roughness"})
    all["material"].push_back({name, Fate::idle, kSight});
  all["general"] =
      actuator_words({"dyntype", "gaintype", "biastype", "gainprm", "biasprm", "inheritrange"});
  all["general"].push_back({"ffrange", Fate::lost, "a force beside the control"});
  all["general"].push_back({"dynprm", Fate::idle, "for actuators with a state"});
  all["motor"] = actuator_words({});
  all["position"] = actuator_words({"kp", "kv", "inheritrange", "dampratio"});
  all["position"].push_back({"timeconst", Fate::zero, "filters the control"});
  all["velocity"] = actuator_words({"kv"});
  return all;
}

}  // namespace

Words with_rotations(Words words) {
  for (const char* name : {"pos", "quat", "axisangle", "euler", "xyaxes", "zaxis"})
    words.push_back({name});
  return words;
}

const Words& mjcf_words(const std::string& element) {
  static const std::map<std::string, Words> all = all_words();
  return all.at(element);
}

}  // namespace tangere
