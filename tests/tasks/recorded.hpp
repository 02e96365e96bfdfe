// SPDX-License-Identifier: Apache-2.0
// Keeps what a rollout hands on, by the names of its channels.
#pragma once

#include <map>
#include <string>
#include <vector>

#include "engine/rows/channel.hpp"

namespace tangere::testing {

struct RecordedRow {
  std::int64_t step;
  std::vector<double> numbers;
  bool operator==(const RecordedRow&) const = default;
};

class Recorded : public RowSink {
 public:
  Recorded() = default;
  explicit Recorded(const Recording& recording) { expect(recording); }
  /// Names what follows.
  void expect(const Recording& recording) { channels_ = recording.channels; }

  void write(std::int64_t step, std::size_t channel, const Numbers& numbers) override {
    std::vector<RecordedRow>& rows = rows_[name(channel)];
    if (rows.empty() || rows.back().step != step) rows.push_back({step, {}});
    std::visit(
        [&](const auto& values) {
          for (const auto x : values) rows.back().numbers.push_back(static_cast<double>(x));
        },
        numbers);
  }

  [[nodiscard]] const std::string& name(std::size_t channel) const {
    return channels_.at(channel).name;
  }
  /// The rows of a channel; none: it has no row.
  [[nodiscard]] const std::vector<RecordedRow>& operator[](const std::string& name) const {
    static const std::vector<RecordedRow> none;
    const auto found = rows_.find(name);
    return found == rows_.end() ? none : found->second;
  }
  [[nodiscard]] const std::map<std::string, std::vector<RecordedRow>>& all() const { return rows_; }

 private:
  std::vector<Channel> channels_;
  std::map<std::string, std::vector<RecordedRow>> rows_;
};

}  // namespace tangere::testing
