#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace catgs::fuzz {

/// The files of a .tar.gz. Throws std::runtime_error with the archive's name when it cannot be
/// read.
std::vector<std::string> read_corpus(const std::filesystem::path& archive);

/// A file with the input that is being tried: what ends the process leaves it there.
class KeptInput {
 public:
  /// Makes the file and its folder. Throws std::system_error.
  explicit KeptInput(const std::filesystem::path& path);
  /// Removes the file, unless leave() was called.
  ~KeptInput();
  KeptInput(const KeptInput&) = delete;
  KeptInput& operator=(const KeptInput&) = delete;

  /// Throws std::system_error.
  void keep(const std::string& input);
  void leave() { leaves_ = true; }

 private:
  std::filesystem::path path_;
  int descriptor_;
  bool leaves_ = false;
};

}  // namespace catgs::fuzz
