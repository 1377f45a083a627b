#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>

#include "render_core/scene/formats/byte_source.h"

namespace catgs {

/// Decompressed bytes, one after the other, held in memory one buffer at a time.
class ByteStream {
 public:
  ByteStream() = default;
  virtual ~ByteStream() = default;
  ByteStream(const ByteStream&) = delete;
  ByteStream& operator=(const ByteStream&) = delete;

  /// Fills `to` from its start until the stream ends; returns the number of bytes. Throws
  /// InputError naming the offset in the compressed file when the data is damaged.
  virtual std::size_t read_up_to(std::span<std::byte> to) = 0;
  /// Fills `to`; throws also when the stream ends before.
  void read(std::span<std::byte> to);
  /// Compressed bytes consumed so far, for progress.
  [[nodiscard]] virtual std::uint64_t consumed() const = 0;

 private:
  [[noreturn]] virtual void fail(std::string_view what) const = 0;
};

/// The gzip stream that is the whole of `file`, which must outlive the stream.
std::unique_ptr<ByteStream> open_gzip(const ByteSource& file);

/// The zstd frames in `size` bytes of `file` from `offset` on.
std::unique_ptr<ByteStream> open_zstd(const ByteSource& file, std::uint64_t offset,
                                      std::uint64_t size);

}  // namespace catgs
