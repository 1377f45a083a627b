#pragma once

#include <stdexcept>
#include <string>
#include <string_view>

namespace catgs {

/// Bad input from outside: a file, a flag, a field. The message reads
/// `<source>: <where>: <what> (<remedy>)`, where `source` is a path or a flag and `where` is an
/// offset ("byte 1042") or a field ("property scale_0"). Empty parts are left out.
class InputError : public std::runtime_error {
 public:
  InputError(std::string_view source, std::string_view where, std::string_view what,
             std::string_view remedy = {})
      : std::runtime_error(compose(source, where, what, remedy)), source_(source), where_(where) {}

  [[nodiscard]] const std::string& source() const { return source_; }
  [[nodiscard]] const std::string& where() const { return where_; }

 private:
  static std::string compose(std::string_view source, std::string_view where, std::string_view what,
                             std::string_view remedy) {
    std::string message(source);
    if (!where.empty()) message.append(message.empty() ? "" : ": ").append(where);
    message.append(message.empty() ? "" : ": ").append(what);
    if (!remedy.empty()) message.append(" (").append(remedy).append(")");
    return message;
  }

  std::string source_, where_;
};

}  // namespace catgs
