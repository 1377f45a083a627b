#include "render_core/scene/formats/decompress.h"

#include <algorithm>
#include <string_view>
#include <vector>

#include <fmt/format.h>
#include <zlib.h>
#include <zstd.h>

#include "render_core/base/error.h"

namespace catgs {

namespace {

constexpr std::size_t buffer_bytes = 256 * 1024;

/// Hands out a range of a file in pieces.
class Input {
 public:
  Input(const ByteSource& file, std::uint64_t offset, std::uint64_t size)
      : file_(file), begin_(offset), next_(offset), end_(offset + size) {}

  /// The next piece; empty at the end of the range.
  std::span<std::byte> next() {
    const auto piece =
        std::span(buffer_).first(std::min<std::uint64_t>(buffer_bytes, end_ - next_));
    file_.read(next_, piece);
    next_ += piece.size();
    return piece;
  }

  [[nodiscard]] std::uint64_t handed_out() const { return next_ - begin_; }

  /// `unused`: bytes of the newest piece that were not looked at.
  [[noreturn]] void fail(std::size_t unused, std::string_view what) const {
    throw InputError(file_.name(), fmt::format("byte {}", next_ - unused), what,
                     "the file is damaged or cut off");
  }

 private:
  const ByteSource& file_;
  std::uint64_t begin_, next_, end_;
  std::vector<std::byte> buffer_ = std::vector<std::byte>(buffer_bytes);
};

class GzipStream final : public ByteStream {
 public:
  explicit GzipStream(const ByteSource& file) : input_(file, 0, file.size()) {
    constexpr int gzip_only = 16;
    if (inflateInit2(&stream_, gzip_only + MAX_WBITS) != Z_OK) throw std::bad_alloc();
  }
  ~GzipStream() override { inflateEnd(&stream_); }

  std::size_t read_up_to(std::span<std::byte> to) override {
    constexpr std::size_t max_step = std::size_t{1} << 30;  // zlib counts with 32 bits
    std::size_t filled = 0;
    while (filled < to.size() && !ended_) {
      const auto step = std::min(to.size() - filled, max_step);
      stream_.next_out = reinterpret_cast<Bytef*>(to.data() + filled);
      stream_.avail_out = static_cast<uInt>(step);
      inflate_some();
      filled += step - stream_.avail_out;
    }
    return filled;
  }

  [[nodiscard]] std::uint64_t consumed() const override {
    return input_.handed_out() - stream_.avail_in;
  }

 private:
  [[noreturn]] void fail(std::string_view what) const override {
    input_.fail(stream_.avail_in, what);
  }

  void inflate_some() {
    if (stream_.avail_in == 0) {
      const auto piece = input_.next();
      stream_.next_in = reinterpret_cast<Bytef*>(piece.data());
      stream_.avail_in = static_cast<uInt>(piece.size());
    }
    const int result = inflate(&stream_, Z_NO_FLUSH);
    if (result == Z_STREAM_END)
      ended_ = true;
    else if (result == Z_BUF_ERROR)
      fail("the gzip stream is cut off");
    else if (result == Z_MEM_ERROR)
      throw std::bad_alloc();
    else if (result != Z_OK)
      fail(fmt::format("bad gzip data: {}", stream_.msg ? stream_.msg : "cannot be continued"));
  }

  Input input_;
  z_stream stream_{};
  bool ended_ = false;
};

class ZstdStream final : public ByteStream {
 public:
  ZstdStream(const ByteSource& file, std::uint64_t offset, std::uint64_t size)
      : input_(file, offset, size), stream_(ZSTD_createDStream(), &ZSTD_freeDStream) {
    if (!stream_) throw std::bad_alloc();
  }

  std::size_t read_up_to(std::span<std::byte> to) override {
    ZSTD_outBuffer out{to.data(), to.size(), 0};
    while (out.pos < out.size) {
      if (in_.pos == in_.size) {
        const auto piece = input_.next();
        in_ = {piece.data(), piece.size(), 0};
      }
      const std::size_t before = out.pos, taken = in_.pos;
      const std::size_t result = ZSTD_decompressStream(stream_.get(), &out, &in_);
      if (ZSTD_isError(result)) fail(fmt::format("bad zstd data: {}", ZSTD_getErrorName(result)));
      if (out.pos == before && in_.pos == taken) break;
    }
    return out.pos;
  }

  [[nodiscard]] std::uint64_t consumed() const override {
    return input_.handed_out() - (in_.size - in_.pos);
  }

 private:
  [[noreturn]] void fail(std::string_view what) const override {
    input_.fail(in_.size - in_.pos, what);
  }

  Input input_;
  std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream_;
  ZSTD_inBuffer in_{nullptr, 0, 0};
};

}  // namespace

void ByteStream::read(std::span<std::byte> to) {
  if (const std::size_t filled = read_up_to(to); filled < to.size())
    fail(fmt::format("the compressed data ends {} bytes early", to.size() - filled));
}

std::unique_ptr<ByteStream> open_gzip(const ByteSource& file) {
  return std::make_unique<GzipStream>(file);
}

std::unique_ptr<ByteStream> open_zstd(const ByteSource& file, std::uint64_t offset,
                                      std::uint64_t size) {
  return std::make_unique<ZstdStream>(file, offset, size);
}

}  // namespace catgs
