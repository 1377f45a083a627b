#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace catgs {

/// A text file that a setting names, with an entry on each line. Blank lines and those that begin
/// with # are none.
class ListFile {
 public:
  /// An empty path: there is no such file, and it never changes. Nothing is read yet.
  ListFile(std::string_view flag, std::filesystem::path path);

  struct Entry {
    std::string place;  // "--token-file tokens:3", for errors
    std::string text;
  };
  /// Throws InputError that names flag and path if the file cannot be read, or was emptied since:
  /// a loss of its content is no new content. A comment is one.
  std::vector<Entry> read();
  /// True if it was written or replaced since it was read. A file that is missing has not changed.
  [[nodiscard]] bool changed() const;
  /// True for an error of read() that the last one did not throw.
  bool is_news(std::string_view error);
  [[nodiscard]] bool given() const { return !path_.empty(); }
  /// "--token-file tokens"
  [[nodiscard]] std::string source() const;

 private:
  struct State {
    std::filesystem::file_time_type written{};
    std::uintmax_t bytes = 0;
    bool operator==(const State&) const = default;
  };
  /// False: the file cannot be looked at.
  bool look(State& state) const;
  [[nodiscard]] std::string text() const;

  const std::string flag_;
  const std::filesystem::path path_;
  State read_;
  bool had_text_ = false;  // when it was read last
  std::string error_;      // since then
};

}  // namespace catgs
