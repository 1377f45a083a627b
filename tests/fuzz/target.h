#pragma once

#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "render_core/base/error.h"
#include "render_core/scene/formats/byte_source.h"
#include "render_core/scene/formats/load_context.h"
#include "render_core/scene/gaussian_cloud.h"
#include "tests/fuzz/mutate.h"

namespace catgs::fuzz {

using Bytes = std::span<const std::byte>;

/// One parser under attack.
struct Target {
  std::string name;
  /// Feeds one input to the parser. Throws InputError when the parser refuses it; ends the process
  /// by require() when a promise of the parser is broken; anything else that it does is a bug.
  void (*parse)(Bytes input);
  /// Inputs that the parser accepts, by file name: where mutation begins.
  std::map<std::string, std::string> (*seeds)();
  /// Words of the format, which mutation would hardly find by itself.
  std::vector<std::string> dictionary;
  /// Changes an input as its format is built, where bytes alone seldom make what a parser goes on
  /// to read; null where they do.
  Change change = nullptr;
  /// Longer inputs hold nothing new for this parser.
  std::size_t max_bytes = 4096;
};

/// All of them; a new one is added here and in CMakeLists.txt.
const std::vector<Target>& targets();
/// Throws std::out_of_range with the names that there are.
const Target& target_called(std::string_view name);

Target ply();
Target compressed_ply();
Target splat();
Target spz();
Target sog();
Target zip();
Target webp();
Target lod_tree();
Target streamed_sog();
Target scene_size();
Target sidecar();
Target cameras();
Target tours();
Target sent_sidecar();
Target tum();
Target colmap();
Target config();
Target client_message();
Target http();
Target token();
Target signed_token();

/// Ends the process with `what` unless `promise` holds: libFuzzer keeps the input.
void require(bool promise, const char* what);

/// One thread, so that a run is the same each time.
const LoadContext& one_thread();

/// What every reader of scenes promises, and what sanitize() makes of it.
void require_sound(GaussianCloud cloud);

/// Numbers that std::sort, where it meets them in this order, cannot part in halves: it makes a
/// heap of them, which mutation would hardly see happen.
std::vector<std::size_t> hard_to_sort(std::size_t count);
/// Gaussians at such places.
GaussianCloud cloud_hard_to_sort();

std::string text_of(Bytes input);
Bytes bytes_of(const std::string& text);

/// A file in memory, for parsers that open theirs by name.
class FileInMemory {
 public:
  explicit FileInMemory(Bytes content = {});
  ~FileInMemory();
  FileInMemory(const FileInMemory&) = delete;
  FileInMemory& operator=(const FileInMemory&) = delete;

  void rewrite(Bytes content);
  [[nodiscard]] std::string path() const;

 private:
  int descriptor_;
};

}  // namespace catgs::fuzz
