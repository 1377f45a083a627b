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
  /// Changes an input as its format is built, for formats where random bytes seldom pass the
  /// parser's first checks; null for others.
  Change change = nullptr;
  /// Longer inputs hold nothing new for this parser.
  std::size_t max_bytes = 4096;
};

// By the files of targets/.
std::vector<Target> gltf_targets();
std::vector<Target> levels_targets();
std::vector<Target> network_targets();
std::vector<Target> ply_targets();
std::vector<Target> scene_json_targets();
std::vector<Target> scene_size_targets();
std::vector<Target> sog_targets();
std::vector<Target> splat_spz_targets();
std::vector<Target> text_files_targets();
std::vector<Target> tree_targets();
std::vector<Target> walk_targets();

/// All of them.
const std::vector<Target>& targets();
/// Throws std::out_of_range with the names that there are.
const Target& target_called(std::string_view name);

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
