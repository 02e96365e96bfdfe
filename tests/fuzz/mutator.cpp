// SPDX-License-Identifier: Apache-2.0
// Uses the engine's numbers as they come: standard distributions differ between libraries.
#include "tests/fuzz/mutator.hpp"

#include <algorithm>
#include <array>
#include <cstring>
#include <iterator>

namespace tangere::fuzz {
namespace {

constexpr const char* kNumbers[] = {
    "nan",   "inf",  "-inf",       "-1",          "0",
    "-0",    "1e15", "1e308",      "-1e308",      "1e-308",
    "1e400", "3",    "2147483648", "99999999999", "18446744073709551616",
    "0x10",  "",     "x",          "1 2 3 4 5",   "1,2"};
constexpr const char* kPieces[] = {"<",    ">",   "\"",       "/>", "=",  "&#0;", "&amp;",
                                   "<!--", "-->", "#",        ",",  "\r", "\t",   "\n\n",
                                   "//",   "-",   "\xC3\xA9", "1 ", "v ", "f "};
// What HDF5 puts before its descriptions: object headers, trees, heaps, tables of symbols.
constexpr const char* kSignatures[] = {"OHDR", "OCHK", "TREE", "SNOD", "HEAP",   "GCOL",
                                       "FRHP", "FHDB", "BTHD", "BTLF", "\x89HDF"};

}  // namespace

std::size_t Mutator::below(std::size_t n) { return n == 0 ? 0 : engine_() % n; }

const std::string& Mutator::one_of(const std::vector<std::string>& texts) {
  return texts.at(below(texts.size()));
}

std::string Mutator::text(const std::vector<std::string>& corpus) {
  std::string t = one_of(corpus);
  for (std::size_t n = 1 + below(4); n > 0; --n) {
    if (t.empty()) t = " ";
    change_text(t, corpus);
  }
  return t;
}

void Mutator::change_text(std::string& t, const std::vector<std::string>& corpus) {
  const std::size_t at = below(t.size()), length = std::min(t.size() - at, 1 + below(40));
  switch (below(11)) {
    case 0: t[at] = static_cast<char>(below(256)); break;
    case 1: t[at] = static_cast<char>(t[at] ^ (1 << below(7))); break;
    case 2: t.erase(at, length); break;
    case 3: t.insert(at, t.substr(at, length)); break;
    case 4: t.insert(at, kPieces[below(std::size(kPieces))]); break;
    case 5: {  // the beginning of one, the end of another
      const std::string& other = one_of(corpus);
      t = t.substr(0, at) + other.substr(below(other.size()));
      break;
    }
    case 6: t.insert(at, std::string(1 + below(3000), t[at])); break;
    case 7: change_lines(t); break;
    case 8:
      if (below(4) == 0) t.resize(at);
      break;
    default: replace_number(t); break;
  }
}

/// Doubles, drops or moves a line.
void Mutator::change_lines(std::string& t) {
  const auto line_at = [&](std::size_t at) {
    const std::size_t begin = at == 0 ? 0 : t.rfind('\n', at - 1) + 1;  // npos + 1 is 0
    const std::size_t end = std::min(t.find('\n', begin), t.size() - 1) + 1;
    return std::pair{begin, end - begin};
  };
  const auto [begin, length] = line_at(below(t.size()));
  const std::string line = t.substr(begin, length);
  const std::size_t way = below(3);
  if (way != 0) t.erase(begin, length);
  if (t.empty()) t = "\n";
  if (way == 1) return;
  t.insert(line_at(below(t.size())).first, line);
}

void Mutator::replace_number(std::string& t) {
  const std::size_t begin = t.find_first_of("0123456789", below(t.size()));
  if (begin == std::string::npos) return;
  const std::size_t end = std::min(t.find_first_not_of("0123456789.e-+", begin), t.size());
  t.replace(begin, end - begin, kNumbers[below(std::size(kNumbers))]);
}

std::string Mutator::hdf5(const std::vector<std::string>& corpus) {
  std::string bytes = one_of(corpus);
  for (std::size_t n = 1 + below(6); n > 0 && bytes.size() > 64; --n) change_hdf5(bytes);
  return bytes;
}

std::size_t Mutator::place_in(const std::string& bytes) {
  const std::size_t anywhere = below(bytes.size());
  if (below(2) == 0) return anywhere;
  const std::size_t near = bytes.find(kSignatures[below(std::size(kSignatures))], anywhere);
  return near == std::string::npos ? anywhere : std::min(near + below(200), bytes.size() - 1);
}

void Mutator::change_hdf5(std::string& bytes) {
  const std::size_t at = place_in(bytes), room = bytes.size() - at;
  const auto put = [&](std::uint64_t field) {
    std::memcpy(&bytes[at], &field, std::min<std::size_t>(sizeof field, room));
  };
  const std::array<std::uint64_t, 12> fields = {0,
                                                1,
                                                2,
                                                UINT64_MAX,
                                                UINT64_MAX - 1,
                                                std::uint64_t{1} << 31,
                                                std::uint64_t{1} << 32,
                                                std::uint64_t{1} << 62,
                                                std::uint64_t{1} << 63,
                                                bytes.size(),
                                                below(bytes.size()),
                                                engine_()};
  switch (below(8)) {
    case 0:
    case 1: bytes[at] = static_cast<char>(bytes[at] ^ (1 << below(8))); break;
    case 2: bytes[at] = static_cast<char>(below(256)); break;
    case 3:
    case 4: put(fields.at(below(fields.size()))); break;
    case 5:
      bytes.replace(at, std::min<std::size_t>(room, 64), std::min<std::size_t>(room, 64),
                    below(2) == 0 ? '\0' : '\xFF');
      break;
    case 6: {  // a piece from elsewhere
      const std::size_t from = place_in(bytes),
                        size = std::min({1 + below(64), room, bytes.size() - from});
      bytes.replace(at, size, bytes.substr(from, size));
      break;
    }
    default:
      if (below(4) == 0) bytes.resize(at);
      break;
  }
}

}  // namespace tangere::fuzz
