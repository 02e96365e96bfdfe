// SPDX-License-Identifier: Apache-2.0
// Writes version 1 B-trees: nodes of a fixed size, keys between children, siblings linked.
#include "io/hdf5/h5_trees.hpp"

#include <algorithm>
#include <string>

namespace tangere::h5 {
namespace {

// Half of the children of a node: the library's default if a file gives no other number.
constexpr std::size_t kGroupNodeHalf = 16, kChunkNodeHalf = 32, kLeafHalf = 4;
constexpr std::size_t kNodeHead = 24, kAddress = 8;

/// A kind of tree: the most children of a node and the size of a key.
struct TreeKind {
  std::uint8_t type;
  std::size_t most, key_bytes;
  [[nodiscard]] std::size_t node_bytes() const {
    return kNodeHead + most * kAddress + (most + 1) * key_bytes;
  }
};

TreeKind group_tree() { return {0, 2 * kGroupNodeHalf, kAddress}; }
TreeKind chunk_tree(std::size_t rank) { return {1, 2 * kChunkNodeHalf, 8 + 8 * (rank + 1)}; }

/// Number of nodes of one level over n children.
std::size_t nodes_over(std::size_t n, std::size_t most) {
  return std::max<std::size_t>(1, (n + most - 1) / most);
}

/// Adds a tree over ordered children. `key(out, i)` appends key i of the leaves: i = 0 lies before
/// the first child, i = count behind the last.
template <class Key>
std::uint64_t add_tree(Bytes& out, std::uint64_t base, const TreeKind& kind,
                       std::vector<std::uint64_t> children, const Key& key) {
  std::vector<std::size_t> ends(
      children.size());  // number of leaf children up to the end of each child
  for (std::size_t i = 0; i < ends.size(); ++i) ends[i] = i + 1;
  for (std::uint8_t level = 0;; ++level) {
    const std::size_t nodes = nodes_over(children.size(), kind.most);
    std::vector<std::uint64_t> parents;
    std::vector<std::size_t> parent_ends;
    const std::uint64_t first = base + out.size();
    for (std::size_t node = 0; node < nodes; ++node) {
      const std::size_t begin = children.size() * node / nodes,
                        end = children.size() * (node + 1) / nodes;
      const std::size_t at = out.size();
      parents.push_back(base + at);
      out.text("TREE");
      out.number(kind.type);
      out.number(level);
      out.number(static_cast<std::uint16_t>(end - begin));
      out.number(node == 0 ? kNowhere : first + (node - 1) * kind.node_bytes());
      out.number(node + 1 == nodes ? kNowhere : first + (node + 1) * kind.node_bytes());
      key(out, begin == 0 ? 0 : ends[begin - 1]);
      for (std::size_t i = begin; i < end; ++i) {
        out.number(children[i]);
        key(out, ends[i]);
      }
      out.zeros(at + kind.node_bytes() - out.size());
      parent_ends.push_back(end == 0 ? 0 : ends[end - 1]);
    }
    if (nodes == 1) return parents.front();
    children = std::move(parents);
    ends = std::move(parent_ends);
  }
}

std::size_t tree_bytes(const TreeKind& kind, std::size_t children) {
  std::size_t bytes = 0;
  for (std::size_t n = children;;) {
    n = nodes_over(n, kind.most);
    bytes += n * kind.node_bytes();
    if (n == 1) return bytes;
  }
}

/// The bytes of a group, handed on in portions.
class GroupBytes {
 public:
  GroupBytes(Bytes& bytes, std::uint64_t base, const Spill& spill)
      : out(bytes), base_(base), spill_(spill) {}
  /// Address of the next byte.
  [[nodiscard]] std::uint64_t here() const { return base_ + out.size(); }
  /// Address of the first byte that was not handed on yet.
  [[nodiscard]] std::uint64_t base() const { return base_; }
  void breathe() {
    constexpr std::size_t kMost = std::size_t{1} << 20;
    if (!spill_ || out.size() < kMost) return;
    spill_(out);
    base_ += out.size();
    out.clear();
  }

  Bytes& out;

 private:
  std::uint64_t base_;
  const Spill& spill_;
};

std::string name_of(std::string_view prefix, const FileMember& member) {
  return std::string(prefix) + std::to_string(member.number);
}

/// Returns the offset of each member's name in the list of names, and of its end. Zeros end each
/// name and fill it up to a multiple of eight. Offset 0 is the empty name.
std::vector<std::uint64_t> name_begins(std::string_view prefix,
                                       const std::vector<FileMember>& members) {
  std::vector<std::uint64_t> begins;
  begins.reserve(members.size() + 1);
  std::uint64_t at = 8;
  for (const FileMember& member : members) {
    begins.push_back(at);
    at += (name_of(prefix, member).size() / 8 + 1) * 8;
  }
  begins.push_back(at);
  return begins;
}

std::uint64_t add_names(GroupBytes& to, std::string_view prefix,
                        const std::vector<FileMember>& members, std::uint64_t bytes) {
  constexpr std::uint64_t kNothingFree = 1;
  const std::uint64_t heap = to.here();
  to.out.text("HEAP");
  to.out.zeros(4);  // version
  to.out.number(bytes);
  to.out.number(kNothingFree);
  to.out.number(heap + 32);
  to.out.zeros(8);
  for (const FileMember& member : members) {
    const std::string name = name_of(prefix, member);
    to.out.text(name);
    to.out.zeros(8 - name.size() % 8);
    to.breathe();
  }
  return heap;
}

/// Adds symbol nodes of up to 2 kLeafHalf members each. `ends`: number of members up to the end of
/// each node.
std::vector<std::uint64_t> add_leaves(GroupBytes& to, const std::vector<FileMember>& members,
                                      const std::vector<std::uint64_t>& begins,
                                      std::vector<std::size_t>& ends) {
  constexpr std::size_t kMost = 2 * kLeafHalf, kEntry = 40, kHead = 8;
  constexpr std::uint8_t kVersion = 1;
  std::vector<std::uint64_t> leaves;
  for (std::size_t first = 0; first < members.size(); first += kMost) {
    const std::size_t at = to.out.size(), end = std::min(first + kMost, members.size());
    leaves.push_back(to.here());
    to.out.text("SNOD");
    to.out.number(kVersion);
    to.out.zeros(1);
    to.out.number(static_cast<std::uint16_t>(end - first));
    for (std::size_t i = first; i < end; ++i) {
      to.out.number(begins[i]);
      to.out.number(members[i].address);
      to.out.zeros(kEntry - 2 * kAddress);  // no cached data of the object
    }
    to.out.zeros(at + kHead + kMost * kEntry - to.out.size());
    ends.push_back(end);
    to.breathe();
  }
  return leaves;
}

}  // namespace

std::uint64_t add_chunk_index(Bytes& out, std::uint64_t base, std::span<const FileChunk> chunks,
                              std::size_t rank, std::uint64_t chunk_rows) {
  if (chunks.empty()) return kNowhere;
  std::vector<std::uint64_t> addresses;
  for (const FileChunk& chunk : chunks) addresses.push_back(chunk.address);
  return add_tree(out, base, chunk_tree(rank), addresses, [&](Bytes& to, std::size_t i) {
    const bool behind = i == chunks.size();
    to.number<std::uint32_t>(behind ? 0 : chunks[i].bytes);
    to.number<std::uint32_t>(0);  // no filter was skipped
    // One more than the dimensions of the dataset: the bytes of a number count as one.
    for (std::size_t k = 0; k <= rank; ++k) {
      const std::uint64_t past = k == 0 ? chunks.back().first[0] + chunk_rows : 0;
      to.number(behind ? past : k < chunks[i].first.size() ? chunks[i].first[k] : std::uint64_t{0});
    }
  });
}

std::size_t chunk_index_bytes(std::size_t chunks, std::size_t rank) {
  return chunks == 0 ? 0 : tree_bytes(chunk_tree(rank), chunks);
}

std::uint64_t add_large_group(Bytes& out, std::uint64_t base, std::string_view prefix,
                              std::vector<FileMember> members, bool root, const Spill& spill) {
  std::sort(members.begin(), members.end(), [](const FileMember& a, const FileMember& b) {
    return std::to_string(a.number) < std::to_string(b.number);  // the order of names
  });
  const std::vector<std::uint64_t> begins = name_begins(prefix, members);
  GroupBytes to(out, base, spill);
  const std::uint64_t heap = add_names(to, prefix, members, begins.back());
  std::vector<std::size_t> ends;
  const std::vector<std::uint64_t> leaves = add_leaves(to, members, begins, ends);
  // Key i: the last name before child i; the empty name before the first child.
  const std::uint64_t tree =
      add_tree(out, to.base(), group_tree(), leaves, [&](Bytes& keys, std::size_t i) {
        keys.number(i == 0 ? std::uint64_t{0} : begins[ends[i - 1] - 1]);
      });
  constexpr std::uint8_t kVersion = 1;
  constexpr std::uint16_t kSymbolTable = 0x11, kBytes = 16;
  const std::uint64_t group = to.here();
  out.number(kVersion);
  out.zeros(1);
  out.number<std::uint16_t>(1);             // messages
  out.number<std::uint32_t>(root ? 1 : 0);  // number of links to it
  out.number<std::uint32_t>(8 + kBytes);
  out.zeros(4);
  out.number(kSymbolTable);
  out.number(kBytes);
  out.zeros(4);
  out.number(tree);
  out.number(heap);
  return group;
}

}  // namespace tangere::h5
