// SPDX-License-Identifier: Apache-2.0
// Writes version 2 object headers: "OHDR", messages, checksum.
#include "io/hdf5/h5_objects.hpp"

#include <algorithm>
#include <bit>
#include <cstring>
#include <limits>
#include <stdexcept>

namespace tangere::h5 {

static_assert(std::endian::native == std::endian::little,
              "numbers are written as they lie in memory");

namespace {

enum Message : std::uint8_t {
  kDataspace = 0x01,
  kLinkInfo = 0x02,
  kDatatype = 0x03,
  kFillValue = 0x05,
  kLink = 0x06,
  kLayout = 0x08,
  kGroupInfo = 0x0A,
  kFilters = 0x0B,
  kAttribute = 0x0C,
  kAttributeInfo = 0x15,
};

/// Writes the header around the messages that are added while this object lives.
class Header {
 public:
  explicit Header(Bytes& out) : out_(out), begin_(out.size()) {}

  /// Adds one message; `body` appends its content.
  template <class Body>
  void message(Message type, const Body& body) {
    scratch_.clear();
    body(scratch_);
    messages_.number<std::uint8_t>(type);
    messages_.number(static_cast<std::uint16_t>(scratch_.size()));
    messages_.number<std::uint8_t>(0);
    messages_.add(scratch_.all());
  }
  void close() {
    if (messages_.size() > UINT16_MAX)
      throw std::logic_error("an object whose description is above 64 KiB");
    constexpr std::uint8_t kVersion = 2, kSizeOfTwoBytes = 1;
    out_.text("OHDR");
    out_.number(kVersion);
    out_.number(kSizeOfTwoBytes);
    out_.number(static_cast<std::uint16_t>(messages_.size()));
    out_.add(messages_.all());
    out_.number(object_checksum(out_.from(begin_)));
    out_.align();
  }

 private:
  Bytes& out_;
  std::size_t begin_;
  Bytes messages_, scratch_;
};

void add_dataspace(Bytes& out, std::span<const std::uint64_t> dims, bool scalar) {
  constexpr std::uint8_t kVersion = 2, kNoMaximum = 0;
  out.number(kVersion);
  out.number(static_cast<std::uint8_t>(dims.size()));
  out.number(kNoMaximum);
  out.number<std::uint8_t>(scalar ? 0 : 1);
  for (const std::uint64_t n : dims) out.number(n);
}

void add_integer(Bytes& out, std::uint32_t size, bool is_signed = true) {
  constexpr std::uint8_t kClass = 0x10, kSigned = 0x08;
  out.number(kClass);
  out.number<std::uint8_t>(is_signed ? kSigned : 0);
  out.zeros(2);
  out.number(size);
  out.number<std::uint16_t>(0);
  out.number(static_cast<std::uint16_t>(8 * size));
}

/// `exponent`: bits of the exponent. The rest except the sign is the mantissa.
void add_float(Bytes& out, std::uint32_t size, std::uint8_t exponent) {
  constexpr std::uint8_t kClass = 0x11, kLeadingOneImplied = 0x20;
  const auto bits = static_cast<std::uint16_t>(8 * size);
  const auto mantissa = static_cast<std::uint8_t>(bits - 1 - exponent);
  out.number(kClass);
  out.number(kLeadingOneImplied);
  out.number(static_cast<std::uint8_t>(bits - 1));
  out.zeros(1);
  out.number(size);
  out.number<std::uint16_t>(0);
  out.number(bits);
  out.number(mantissa);
  out.number(exponent);
  out.number<std::uint8_t>(0);
  out.number(mantissa);
  out.number((std::uint32_t{1} << (exponent - 1)) - 1);
}

/// h5py's boolean: an enumeration FALSE = 0, TRUE = 1 of one byte.
void add_boolean(Bytes& out) {
  constexpr std::uint8_t kClass = 0x18;
  out.number(kClass);
  out.number<std::uint16_t>(2);
  out.zeros(1);
  out.number<std::uint32_t>(1);
  add_integer(out, 1);
  for (const std::string_view name :
       {std::string_view("FALSE\0\0\0", 8), std::string_view("TRUE\0\0\0\0", 8)})
    out.text(name);
  out.number<std::uint8_t>(0);
  out.number<std::uint8_t>(1);
}

/// Bytes up to one length, with zeros behind a shorter text.
void add_text_type(Bytes& out, std::uint32_t bytes) {
  constexpr std::uint8_t kClass = 0x13, kFilledWithZeros = 1;
  out.number(kClass);
  out.number(kFilledWithZeros);
  out.zeros(2);
  out.number(bytes);
}

void add_type(Bytes& out, NumberType type, std::uint32_t text_bytes = 1) {
  constexpr std::uint8_t kExponentOf32 = 8, kExponentOf64 = 11;
  switch (type) {
    case NumberType::float32: return add_float(out, 4, kExponentOf32);
    case NumberType::float64: return add_float(out, 8, kExponentOf64);
    case NumberType::int8: return add_integer(out, 1);
    case NumberType::uint8: return add_integer(out, 1, false);
    case NumberType::int16: return add_integer(out, 2);
    case NumberType::int64: return add_integer(out, 8);
    case NumberType::uint64: return add_integer(out, 8, false);
    case NumberType::boolean: return add_boolean(out);
    case NumberType::text: return add_text_type(out, text_bytes);
  }
}

void add_layout(Bytes& out, const FileDataset& dataset) {
  constexpr std::uint8_t kVersion = 3, kContiguous = 1, kChunked = 2, kVersionOfViews = 4,
                         kView = 3;
  if (dataset.view) {
    out.number(kVersionOfViews);
    out.number(kView);
    out.number(dataset.view->texts);
    out.number(dataset.view->number + 1);  // 0 stands for free space
    return;
  }
  out.number(kVersion);
  if (dataset.chunk.empty()) {
    std::uint64_t size =
        dataset.type == NumberType::text ? dataset.text_bytes : bytes_of(dataset.type);
    for (const std::uint64_t n : dataset.dims) size *= n;
    out.number(kContiguous);
    out.number(size == 0 ? kNowhere : dataset.address);
    out.number(size);
    return;
  }
  out.number(kChunked);
  out.number(static_cast<std::uint8_t>(dataset.dims.size() + 1));
  out.number(dataset.address);
  for (const std::uint64_t n : dataset.chunk) out.number(static_cast<std::uint32_t>(n));
  out.number(static_cast<std::uint32_t>(bytes_of(dataset.type)));
}

/// Adds the value of elements that are not stored.
void add_fill(Bytes& out, const FileDataset& dataset) {
  constexpr std::uint8_t kVersion = 3, kEarly = 1, kLate = 2, kIncremental = 3,
                         kNeverFilled = 1 << 2, kFilledIfSet = 2 << 2;
  constexpr std::uint8_t kNumberFollows = 1 << 5;
  out.number(kVersion);
  if (dataset.view) {
    out.number<std::uint8_t>(kLate | kFilledIfSet | kNumberFollows);
    out.number(static_cast<std::uint32_t>(bytes_of(dataset.type)));
    if (dataset.type == NumberType::uint8)
      out.number<std::uint8_t>(0);
    else if (dataset.type == NumberType::int16)
      out.number<std::int16_t>(-1);
    else if (dataset.type == NumberType::float32)
      out.number(std::bit_cast<std::uint32_t>(std::numeric_limits<float>::quiet_NaN()));
    else
      out.number(std::bit_cast<std::uint64_t>(std::numeric_limits<double>::quiet_NaN()));
  } else {
    out.number<std::uint8_t>(dataset.chunk.empty() ? kEarly | kNeverFilled
                                                   : kIncremental | kFilledIfSet);
  }
}

void add_filters(Bytes& out, std::span<const FileFilter> filters) {
  constexpr std::uint8_t kVersion = 2;
  constexpr std::uint16_t kOptional = 1, kFirstNamed = 256;
  out.number(kVersion);
  out.number(static_cast<std::uint8_t>(filters.size()));
  for (const FileFilter& filter : filters) {
    out.number(filter.id);
    if (filter.id >= kFirstNamed) out.number(static_cast<std::uint16_t>(filter.name.size() + 1));
    out.number(kOptional);
    out.number(static_cast<std::uint16_t>(filter.values.size()));
    if (filter.id >= kFirstNamed) {
      out.text(filter.name);
      out.zeros(1);
    }
    for (const std::uint32_t value : filter.values) out.number(value);
  }
}

void add_link(Bytes& out, const FileLink& link) {
  constexpr std::uint8_t kVersion = 1, kTypeFollows = 0x08, kCharacterSet = 0x10, kUtf8 = 1,
                         kExternal = 64;
  if (link.name.size() > UINT8_MAX) throw std::logic_error("a name above 255 bytes in a file");
  const bool external = !link.file.empty();
  out.number(kVersion);
  // Without a type it is a hard link. Names have one byte for their length; no order of creation.
  out.number<std::uint8_t>(external ? kCharacterSet | kTypeFollows : kCharacterSet);
  if (external) out.number(kExternal);
  out.number(kUtf8);
  out.number(static_cast<std::uint8_t>(link.name.size()));
  out.text(link.name);
  if (!external) {
    out.number(link.address);
    return;
  }
  out.number(static_cast<std::uint16_t>(1 + link.file.size() + 1 + link.path.size() + 1));
  out.number<std::uint8_t>(0);  // version, flags
  for (const std::string_view text : {link.file, link.path}) {
    out.text(text);
    out.zeros(1);
  }
}

/// Adds the type of UTF-8 text of any length. The text lies elsewhere; the value holds its address.
void add_text_type(Bytes& out) {
  constexpr std::uint8_t kClass = 0x19, kText = 1, kUtf8 = 1;
  out.number(kClass);
  out.number(kText);
  out.number(kUtf8);
  out.zeros(1);
  out.number<std::uint32_t>(sizeof(std::uint32_t) + sizeof(std::uint64_t) + sizeof(std::uint32_t));
  add_integer(out, 1, false);
}

/// `type`, `space`: encoded messages.
void add_attribute(Bytes& out, std::string_view name, const Bytes& type, const Bytes& space,
                   std::span<const unsigned char> values) {
  constexpr std::uint8_t kVersion = 3, kNotShared = 0, kUtf8 = 1;
  out.number(kVersion);
  out.number(kNotShared);
  out.number(static_cast<std::uint16_t>(name.size() + 1));
  out.number(static_cast<std::uint16_t>(type.size()));
  out.number(static_cast<std::uint16_t>(space.size()));
  out.number(kUtf8);
  out.text(name);
  out.zeros(1);
  out.add(type.all());
  out.add(space.all());
  out.add(values);
}

void add_attribute(Bytes& out, const FileAttribute& attribute) {
  Bytes type, space;
  add_type(type, attribute.type);
  const std::array<std::uint64_t, 1> dims{attribute.values.size() / bytes_of(attribute.type)};
  add_dataspace(space, std::span(dims).first(attribute.list ? 1 : 0), !attribute.list);
  add_attribute(out, attribute.name, type, space, attribute.values);
}

void add_attribute(Bytes& out, const FileText& text) {
  Bytes type, space, place;
  add_text_type(type);
  add_dataspace(space, {}, true);
  place.number(text.bytes);
  place.number(text.texts);
  place.number(text.number + 1);  // 0 stands for free space
  add_attribute(out, text.name, type, space, place.all());
}

/// Without this message the library finds attributes by name but counts none of them.
void add_attribute_info(Header& header) {
  header.message(kAttributeInfo, [](Bytes& to) {
    to.number<std::uint16_t>(0);  // version, flags
    to.number(kNowhere);
    to.number(kNowhere);
  });
}

}  // namespace

std::uint32_t object_checksum(std::span<const unsigned char> bytes) {
  constexpr std::uint32_t kStart = 0xDEADBEEF;
  std::uint32_t a = kStart + static_cast<std::uint32_t>(bytes.size()), b = a, c = a;
  const auto take = [&](std::span<const unsigned char> twelve) {
    std::array<std::uint32_t, 3> words{};
    std::memcpy(words.data(), twelve.data(), twelve.size());
    a += words[0];
    b += words[1];
    c += words[2];
  };
  constexpr std::size_t kStep = 12;
  if (bytes.empty()) return c;
  for (; bytes.size() > kStep; bytes = bytes.subspan(kStep)) {
    take(bytes.first(kStep));
    a -= c, a ^= std::rotl(c, 4), c += b;
    b -= a, b ^= std::rotl(a, 6), a += c;
    c -= b, c ^= std::rotl(b, 8), b += a;
    a -= c, a ^= std::rotl(c, 16), c += b;
    b -= a, b ^= std::rotl(a, 19), a += c;
    c -= b, c ^= std::rotl(b, 4), b += a;
  }
  take(bytes);
  c ^= b, c -= std::rotl(b, 14);
  a ^= c, a -= std::rotl(c, 11);
  b ^= a, b -= std::rotl(a, 25);
  c ^= b, c -= std::rotl(b, 16);
  a ^= c, a -= std::rotl(c, 4);
  b ^= a, b -= std::rotl(a, 14);
  c ^= b, c -= std::rotl(b, 24);
  return c;
}

void set_end_of_file(std::span<unsigned char, kSuperblockBytes> superblock, std::uint64_t end,
                     std::uint64_t root) {
  constexpr std::size_t kVersion = 8, kEnd = 28, kRoot = 36, kChecksum = 44;
  if (superblock[kVersion] != 2 && superblock[kVersion] != 3)
    throw std::logic_error("a file whose superblock has another version than asked for");
  std::memcpy(&superblock[kEnd], &end, sizeof end);
  if (root != kNowhere) std::memcpy(&superblock[kRoot], &root, sizeof root);
  const std::uint32_t sum =
      object_checksum(std::span<const unsigned char>(superblock).first(kChecksum));
  std::memcpy(&superblock[kChecksum], &sum, sizeof sum);
}

std::size_t bytes_of(NumberType type) {
  switch (type) {
    case NumberType::int16: return 2;
    case NumberType::float32: return 4;
    case NumberType::float64:
    case NumberType::int64:
    case NumberType::uint64: return 8;
    case NumberType::int8:
    case NumberType::uint8:
    case NumberType::boolean:
    case NumberType::text: return 1;
  }
  return 0;
}

/// Writes a global heap collection. Every object in it has a head of 16 bytes, and so does the free
/// rest.
void add_texts(Bytes& out, std::span<const std::string_view> texts) {
  constexpr std::uint8_t kVersion = 1;
  constexpr std::size_t kHead = 16, kLeast = 4096;
  if (texts.empty()) return;
  if (texts.size() > UINT16_MAX)
    throw std::logic_error("a list of more than 65535 texts in a file");
  Bytes objects;
  std::uint16_t index = 0;
  for (const std::string_view text : texts) {
    objects.number(++index);
    objects.zeros(6);  // no reference count
    objects.number<std::uint64_t>(text.size());
    objects.text(text);
    objects.align();
  }
  const std::size_t used = kHead + objects.size(), size = std::max(kLeast, used + kHead);
  out.text("GCOL");
  out.number(kVersion);
  out.zeros(3);
  out.number<std::uint64_t>(size);
  out.add(objects.all());
  out.zeros(8);  // index 0
  out.number<std::uint64_t>(size - used);
  out.zeros(size - used - kHead);
}

void add_dataset(Bytes& out, const FileDataset& dataset) {
  Header header(out);
  header.message(kDataspace, [&](Bytes& to) { add_dataspace(to, dataset.dims, false); });
  header.message(kDatatype, [&](Bytes& to) { add_type(to, dataset.type, dataset.text_bytes); });
  header.message(kFillValue, [&](Bytes& to) { add_fill(to, dataset); });
  header.message(kLayout, [&](Bytes& to) { add_layout(to, dataset); });
  if (!dataset.filters.empty())
    header.message(kFilters, [&](Bytes& to) { add_filters(to, dataset.filters); });
  if (!dataset.texts.empty()) add_attribute_info(header);
  for (const FileText& text : dataset.texts)
    header.message(kAttribute, [&](Bytes& to) { add_attribute(to, text); });
  header.close();
}

void add_group(Bytes& out, std::span<const FileLink> links,
               std::span<const FileAttribute> attributes) {
  Header header(out);
  header.message(kLinkInfo, [](Bytes& to) {
    to.zeros(2);  // version, flags
    to.number(kNowhere);
    to.number(kNowhere);
  });
  header.message(kGroupInfo, [](Bytes& to) { to.zeros(2); });
  if (!attributes.empty()) add_attribute_info(header);
  for (const FileAttribute& attribute : attributes)
    header.message(kAttribute, [&](Bytes& to) { add_attribute(to, attribute); });
  for (const FileLink& link : links) header.message(kLink, [&](Bytes& to) { add_link(to, link); });
  header.close();
}

}  // namespace tangere::h5
