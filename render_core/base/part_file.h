#pragma once

#include <filesystem>
#include <fstream>

namespace catgs {

/// A file that is written whole or not at all: it is called by its name with `.part` appended until
/// finish(), so what was there before stays where the writing fails. Pipes and devices are written
/// as they are. Throws InputError.
class PartFile {
 public:
  explicit PartFile(const std::filesystem::path& path);
  ~PartFile();
  PartFile(const PartFile&) = delete;
  PartFile& operator=(const PartFile&) = delete;

  [[nodiscard]] std::ostream& stream() { return file_; }
  /// Gives the file its name.
  void finish();

 private:
  std::filesystem::path path_, target_, part_;
  std::ofstream file_;
};

/// Throws InputError where no PartFile of this name could be begun: to be asked before work that
/// only ends in one. Leaves everything as it was.
void check_writable(const std::filesystem::path& path);

}  // namespace catgs
