#pragma once

#include <string>
#include <string_view>
#include <utility>

#include <fmt/format.h>
#include <spdlog/spdlog.h>

namespace catgs {

/// Programs learn from these what a log line is about. JSON has a field for each one that is not
/// empty (server/base/log.cpp).
struct LogFacts {
  std::string_view event{};    // what happened: one name for each kind of line
  std::string_view session{};  // as much of its id as tells a server's sessions apart
  std::string_view scene{};    // its id
  std::string_view address{};  // of the client
  std::string_view link{};     // id of the client's link
  std::string_view code{};     // why it failed: an ErrorCode's name or an HTTP status
};

/// Facts of the line that this thread is logging.
inline thread_local LogFacts logged_facts;

/// Adds facts to all lines of this thread for a scope. The texts outlive it.
class LogScope {
 public:
  explicit LogScope(const LogFacts& more) : outer_(logged_facts) {
    for (const auto fact : {&LogFacts::event, &LogFacts::session, &LogFacts::scene,
                            &LogFacts::address, &LogFacts::link, &LogFacts::code})
      if (!(more.*fact).empty()) logged_facts.*fact = more.*fact;
    constexpr std::size_t session_digits = 8;
    logged_facts.session = logged_facts.session.substr(0, session_digits);
  }
  ~LogScope() { logged_facts = outer_; }
  LogScope(const LogScope&) = delete;
  LogScope& operator=(const LogScope&) = delete;

 private:
  const LogFacts outer_;
};

/// " by link 3f0c91d27a5e", for people, or nothing.
inline std::string by_link(const LogFacts& facts) {
  return facts.link.empty() ? std::string() : fmt::format(" by link {}", facts.link);
}

/// Logs a line. The text says all to people; the facts say it to programs.
template <typename... Args>
void log_event(spdlog::level::level_enum level, const LogFacts& facts,
               fmt::format_string<Args...> text, Args&&... args) {
  if (!spdlog::should_log(level)) return;
  const LogScope about(facts);
  spdlog::log(level, std::string_view(fmt::format(text, std::forward<Args>(args)...)));
}
template <typename... Args>
void log_debug(const LogFacts& facts, fmt::format_string<Args...> text, Args&&... args) {
  log_event(spdlog::level::debug, facts, text, std::forward<Args>(args)...);
}
template <typename... Args>
void log_info(const LogFacts& facts, fmt::format_string<Args...> text, Args&&... args) {
  log_event(spdlog::level::info, facts, text, std::forward<Args>(args)...);
}
template <typename... Args>
void log_warning(const LogFacts& facts, fmt::format_string<Args...> text, Args&&... args) {
  log_event(spdlog::level::warn, facts, text, std::forward<Args>(args)...);
}
template <typename... Args>
void log_error(const LogFacts& facts, fmt::format_string<Args...> text, Args&&... args) {
  log_event(spdlog::level::err, facts, text, std::forward<Args>(args)...);
}

}  // namespace catgs
