#pragma once

#include <iosfwd>
#include <map>
#include <string>

namespace catgs {

/// Writes files as the entries of a zip archive, by name and not compressed. The bytes depend on
/// the files alone.
void write_zip(const std::map<std::string, std::string>& files, std::ostream& to);

}  // namespace catgs
