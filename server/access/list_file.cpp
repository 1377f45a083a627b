#include "server/access/list_file.h"

#include <system_error>
#include <utility>

#include <fmt/format.h>

#include "server/base/required_file.h"

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

std::vector<ListFile::Entry> ListFile::read() {
  look(read_);  // before it is read: what is written meanwhile is a change
  std::ifstream in = open_required_file(flag_, path_);
  std::vector<Entry> entries;
  int number = 0;
  for (std::string line; std::getline(in, line);) {
    ++number;
    while (!line.empty() && (line.back() == '\r' || line.back() == ' ')) line.pop_back();
    if (line.empty() || line.front() == '#') continue;
    entries.push_back({fmt::format("{}:{}", source(), number), std::move(line)});
  }
  return entries;
}

}  // namespace catgs
