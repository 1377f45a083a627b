#include "server/access/list_file.h"

#include <cstddef>
#include <sstream>
#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "render_core/base/error.h"
#include "render_core/scene/formats/byte_source.h"

namespace catgs {

ListFile::ListFile(std::string_view flag, std::filesystem::path path)
    : flag_(flag), path_(std::move(path)) {}

std::string ListFile::source() const { return fmt::format("{} {}", flag_, path_.string()); }

bool ListFile::look(State& state) const {
  std::error_code missing_time, missing_size;
  state.written = std::filesystem::last_write_time(path_, missing_time);
  state.bytes = std::filesystem::file_size(path_, missing_size);
  return !missing_time && !missing_size;
}

bool ListFile::changed() const {
  State now;
  return given() && look(now) && now != read_;
}

bool ListFile::is_news(std::string_view error) {
  return std::exchange(error_, std::string(error)) != error;
}

/// Waits for no writer of a pipe that has taken the file's place.
std::string ListFile::text() const {
  constexpr std::uint64_t max_bytes = 16 << 20;
  try {
    const std::vector<std::byte> bytes = FileSource(path_).read_all(max_bytes);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  } catch (const InputError& error) {
    throw InputError(flag_, {}, error.what(),
                     "check the path and that the server's user may read the file");
  }
}

std::vector<ListFile::Entry> ListFile::read() {
  State now;
  look(now);                           // before it is read: what is written meanwhile is a change
  const std::string content = text();  // throws: it is read again, since it has changed
  read_ = now;
  error_.clear();
  const bool is_blank = content.find_first_not_of(" \t\r\n") == std::string::npos;
  if (is_blank && had_text_)
    throw InputError(
        source(), {}, "was emptied",
        "if nothing in it is meant to count any more, write a line such as \"# none\"");
  std::istringstream in(content);
  std::vector<Entry> entries;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    if (line.empty() || line.front() == '#') continue;
    entries.push_back({fmt::format("{}:{}", source(), number), std::move(line)});
  }
  had_text_ = !is_blank;
  return entries;
}

}  // namespace catgs
