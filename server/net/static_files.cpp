#include "server/net/static_files.h"

#include <array>
#include <fstream>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <zlib.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

constexpr std::size_t max_files = 4096;
constexpr std::size_t max_total_bytes = 256u << 20;
constexpr std::size_t min_gzip_bytes = 1024;

struct MimeType {
  std::string_view extension;
  std::string_view type;
  bool compressible;
};

constexpr std::array mime_types = {
    MimeType{".html", "text/html; charset=utf-8", true},
    MimeType{".js", "text/javascript; charset=utf-8", true},
    MimeType{".mjs", "text/javascript; charset=utf-8", true},
    MimeType{".css", "text/css; charset=utf-8", true},
    MimeType{".json", "application/json", true},
    MimeType{".map", "application/json", true},
    MimeType{".webmanifest", "application/manifest+json", true},
    MimeType{".wasm", "application/wasm", true},
    MimeType{".svg", "image/svg+xml", true},
    MimeType{".txt", "text/plain; charset=utf-8", true},
    MimeType{".png", "image/png", false},
    MimeType{".jpg", "image/jpeg", false},
    MimeType{".webp", "image/webp", false},
    MimeType{".ico", "image/x-icon", false},
    MimeType{".woff2", "font/woff2", false},
};

MimeType mime_type_of(const std::filesystem::path& path) {
  const std::string extension = path.extension().string();
  for (const auto& type : mime_types)
    if (type.extension == extension) return type;
  return {"", "application/octet-stream", false};
}

std::string read_file(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::string bytes(std::istreambuf_iterator<char>(in), {});
  if (!in.good() && !in.eof()) throw InputError(path.string(), {}, "cannot be read");
  return bytes;
}

/// Null when compression fails or saves nothing.
std::shared_ptr<const std::string> gzip(const std::string& bytes) {
  constexpr int gzip_window_bits = 15 + 16;
  z_stream stream{};
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, gzip_window_bits, 8,
                   Z_DEFAULT_STRATEGY) != Z_OK)
    return nullptr;
  std::string out(deflateBound(&stream, bytes.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(bytes.data()));
  stream.avail_in = static_cast<uInt>(bytes.size());
  stream.next_out = reinterpret_cast<Bytef*>(out.data());
  stream.avail_out = static_cast<uInt>(out.size());
  const bool finished = deflate(&stream, Z_FINISH) == Z_STREAM_END;
  out.resize(stream.total_out);
  deflateEnd(&stream);
  if (!finished || out.size() >= bytes.size()) return nullptr;
  return std::make_shared<const std::string>(std::move(out));
}

}  // namespace

std::filesystem::path built_client() {
  namespace fs = std::filesystem;
  std::error_code error;
  const fs::path bin = fs::read_symlink("/proc/self/exe", error).parent_path();
  for (const char* folder : {"../share/catgs/web", "../web_client/dist"})
    if (fs::exists(bin / folder / "index.html", error)) return bin / folder;
  return {};
}

StaticFiles::StaticFiles(const std::filesystem::path& folder) {
  namespace fs = std::filesystem;
  const std::string source = "--client-dir " + folder.string();
  std::error_code error;
  fs::recursive_directory_iterator it(folder, error);
  if (error) throw InputError(source, {}, error.message(), "give the folder of the built client");
  std::size_t total = 0;
  for (const auto& entry : it) {
    if (!entry.is_regular_file()) continue;
    total += entry.file_size();
    if (files_.size() >= max_files || total > max_total_bytes)
      throw InputError(
          source, {}, fmt::format("more than {} files or {} MiB", max_files, max_total_bytes >> 20),
          "this is not a built client");
    std::string body = read_file(entry.path());
    const auto mime = mime_type_of(entry.path());
    const std::string name = (fs::path("/") / fs::relative(entry.path(), folder)).generic_string();
    File file;
    file.content_type = mime.type;
    file.cache_control =
        name.starts_with("/assets/") ? "public, max-age=31536000, immutable" : "no-cache";
    file.etag = etag_of(body);
    if (mime.compressible && body.size() >= min_gzip_bytes) file.gzip_body = gzip(body);
    file.body = std::make_shared<const std::string>(std::move(body));
    files_.emplace(name, std::move(file));
  }
  if (!files_.contains("/index.html"))
    throw InputError(source, {}, "no index.html in it", "give the folder of the built client");
}

HttpResponse StaticFiles::respond(const HttpRequest& request) const {
  const auto it = files_.find(request.path == "/" ? std::string_view("/index.html") : request.path);
  if (it == files_.end()) return text_response(404, "404: there is no such page here\n");
  return respond_with(it->second, request);
}

HttpResponse StaticFiles::respond_with_head(const HttpRequest& request,
                                            std::string_view head) const {
  const File& index = files_.at("/index.html");
  std::string body = *index.body;
  const auto end = body.find("</head>");
  if (end == std::string::npos) return respond_with(index, request);
  body.insert(end, head);
  File page{index.content_type, index.cache_control, etag_of(body), nullptr, nullptr};
  if (request.accepts_gzip) page.gzip_body = gzip(body);
  page.body = std::make_shared<const std::string>(std::move(body));
  return respond_with(page, request);
}

HttpResponse StaticFiles::respond_with(const File& file, const HttpRequest& request) {
  HttpResponse response;
  response.content_type = file.content_type;
  response.cache_control = file.cache_control;
  response.etag = file.etag;
  if (request.if_none_match == file.etag) {
    response.status = 304;
    return response;
  }
  response.gzip = request.accepts_gzip && file.gzip_body;
  response.body = response.gzip ? file.gzip_body : file.body;
  return response;
}

}  // namespace catgs
