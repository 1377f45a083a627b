#pragma once

#include <string_view>

namespace catgs {

/// The session that the log lines of this thread are about; empty: none. The log's formatters put
/// it into every line (server/base/log.cpp).
inline thread_local std::string_view logged_session;

/// Names it for a scope, by as much of its id as tells a server's sessions apart. `id` outlives the
/// scope.
class LogSession {
 public:
  explicit LogSession(std::string_view id) : outer_(logged_session) {
    logged_session = id.substr(0, 8);
  }
  ~LogSession() { logged_session = outer_; }
  LogSession(const LogSession&) = delete;
  LogSession& operator=(const LogSession&) = delete;

 private:
  std::string_view outer_;
};

}  // namespace catgs
