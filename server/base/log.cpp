#include "server/base/log.h"

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <chrono>
#include <climits>
#include <cstdio>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <fmt/chrono.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <spdlog/details/os.h>
#include <spdlog/formatter.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "render_core/base/printable.h"
#include "server/base/log_event.h"
#include "server/base/rate_limit.h"

namespace catgs {
namespace {

/// A JSON formatter, because spdlog's patterns cannot escape a message.
class JsonFormatter final : public spdlog::formatter {
 public:
  void format(const spdlog::details::log_msg& message, spdlog::memory_buf_t& out) override {
    using namespace std::chrono;
    const auto us =
        duration_cast<microseconds>(message.time.time_since_epoch()).count() % 1'000'000;
    const auto level = spdlog::level::to_string_view(message.level);
    nlohmann::ordered_json line = {
        {"time", fmt::format("{:%Y-%m-%dT%H:%M:%S}.{:06}Z",
                             fmt::gmtime(system_clock::to_time_t(message.time)), us)},
        {"level", std::string(level.data(), level.size())}};
    constexpr std::pair<const char*, std::string_view LogFacts::*> fields[] = {
        {"event", &LogFacts::event}, {"session", &LogFacts::session},
        {"scene", &LogFacts::scene}, {"address", &LogFacts::address},
        {"link", &LogFacts::link},   {"code", &LogFacts::code}};
    for (const auto& [name, fact] : fields)
      if (!(logged_facts.*fact).empty()) line[name] = logged_facts.*fact;
    line["message"] = std::string(message.payload.data(), message.payload.size());
    // Text from clients may be invalid UTF-8 or move the cursor of a reader's terminal.
    constexpr bool ascii = true;
    const std::string text =
        line.dump(-1, ' ', ascii, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    out.append(text.data(), text.data() + text.size());
  }
  [[nodiscard]] std::unique_ptr<formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }
};

/// The level, in colour if standard error is a terminal with colours.
class LevelFlag final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& out) override {
    const auto name = spdlog::level::to_string_view(message.level);
    const std::string_view level(name.data(), name.size());
    if (coloured_)
      fmt::format_to(std::back_inserter(out), "\x1b[{}m{}\x1b[m", colour(message.level), level);
    else
      fmt::format_to(std::back_inserter(out), "{}", level);
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<LevelFlag>();
  }

 private:
  /// Bold red, bold yellow, green, cyan.
  static std::string_view colour(spdlog::level::level_enum level) {
    if (level >= spdlog::level::err) return "1;31";
    if (level == spdlog::level::warn) return "1;33";
    return level == spdlog::level::info ? "32" : "36";
  }
  const bool coloured_ =
      spdlog::details::os::in_terminal(stderr) && spdlog::details::os::is_color_terminal();
};

/// "session 1f2e3d4c: ", or nothing.
class SessionFlag final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg&, const std::tm&, spdlog::memory_buf_t& out) override {
    if (!logged_facts.session.empty())
      fmt::format_to(std::back_inserter(out), "session {}: ", logged_facts.session);
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<SessionFlag>();
  }
};

/// The message, which may contain clients' text.
class PrintableMessage final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& out) override {
    const std::string text = printable({message.payload.data(), message.payload.size()});
    out.append(text.data(), text.data() + text.size());
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PrintableMessage>();
  }
};

std::atomic<std::uint64_t> lines_lost{0};
std::atomic<bool> in_json{false};

/// True while this thread logs a refusal. Sinks run on the thread that logs.
thread_local bool logs_refusal = false;

/// A warning of the log itself. It is about nobody, whatever line it precedes.
class LogsOwnLine {
 public:
  explicit LogsOwnLine(std::string text) : text_(std::move(text)) {
    logged_facts = {.event = "log_lines_lost"};
  }
  ~LogsOwnLine() { logged_facts = about_; }
  LogsOwnLine(const LogsOwnLine&) = delete;
  LogsOwnLine& operator=(const LogsOwnLine&) = delete;
  [[nodiscard]] spdlog::details::log_msg message(spdlog::string_view_t logger) const {
    return {logger, spdlog::level::warn, text_};
  }

 private:
  const std::string text_;
  const LogFacts about_ = logged_facts;
};

/// Writes to standard error without blocking. A full disk costs lines only, and a paused reader of
/// a pipe does not stop the sessions. The next line that succeeds tells how many were lost. A line
/// has at most PIPE_BUF bytes, because a pipe takes so many at once and in one piece.
class PromptSink final : public spdlog::sinks::base_sink<std::mutex> {
 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (lost_ > 0) {
      const LogsOwnLine own(fmt::format("{} log lines were dropped: stderr was blocked", lost_));
      if (write(own.message(message.logger_name))) lost_ = 0;
    }
    if (lost_ == 0 && write(message)) return;
    ++lost_;
    ++lines_lost;
  }
  void flush_() override {}  // nothing is buffered

 private:
  static constexpr std::size_t max_line_bytes = PIPE_BUF;

  /// False: the line was not written, or only in part.
  bool write(const spdlog::details::log_msg& message) {
    pollfd standard_error{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&standard_error, 1, 0) != 1 || (standard_error.revents & POLLOUT) == 0) return false;
    spdlog::memory_buf_t line;
    if (torn_) line.push_back('\n');
    append(message, line);
    ssize_t taken = 0;
    do taken = ::write(STDERR_FILENO, line.data(), line.size());
    while (taken < 0 && errno == EINTR);
    if (taken > 0) torn_ = static_cast<std::size_t>(taken) < line.size();
    return taken == static_cast<ssize_t>(line.size());
  }

  /// Cuts a line that is too long. The format decides how bytes are escaped.
  void append(const spdlog::details::log_msg& message, spdlog::memory_buf_t& line) const {
    const std::size_t before = line.size();
    const std::string mark = fmt::format("... ({} bytes)", message.payload.size());
    spdlog::details::log_msg cut = message;
    std::string text;
    std::size_t kept = message.payload.size();
    for (;;) {
      formatter_->format(cut, line);
      if (line.size() <= max_line_bytes || kept == 0) return;
      const std::size_t excess = line.size() - max_line_bytes + mark.size();
      kept -= std::min(excess, (kept + 1) / 2);
      text = shortened({message.payload.data(), message.payload.size()}, kept) + mark;
      cut.payload = text;
      line.resize(before);
    }
  }

  std::uint64_t lost_ = 0;
  bool torn_ = false;  // the disk was full in the middle of a line
};

/// Limits the rate of lines and tells how many were omitted. Strangers can cause a line with each
/// connection, and disk space costs money. Refusals have a smaller rate of their own, so that they
/// hide no other lines. Errors are few and never omitted.
class BoundedSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit BoundedSink(std::shared_ptr<spdlog::sinks::sink> to) : to_(std::move(to)) {}

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    const bool is_error = message.level >= spdlog::level::err;
    if (!is_error && !(logs_refusal ? refusals_ : rate_).take(Clock::now())) {
      ++left_out_;
      ++lines_lost;
      return;
    }
    if (left_out_ > 0 && notes_.take(Clock::now())) {
      const LogsOwnLine own(
          fmt::format("{} lines were left out: there were too many", std::exchange(left_out_, 0)));
      to_->log(own.message(message.logger_name));
    }
    to_->log(message);
  }
  void flush_() override { to_->flush(); }
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    to_->set_formatter(std::move(formatter));
  }

 private:
  static constexpr double lines_per_second = 50.0;
  static constexpr double burst = 500.0;
  static constexpr double refusals_per_second = 10.0;
  static constexpr double refusal_burst = 100.0;
  static constexpr double notes_per_second = 1.0;  // notes on omitted lines

  const std::shared_ptr<spdlog::sinks::sink> to_;
  RateLimit rate_{lines_per_second, burst, Clock::now()};
  RateLimit refusals_{refusals_per_second, refusal_burst, Clock::now()};
  RateLimit notes_{notes_per_second, 1.0, Clock::now()};
  std::uint64_t left_out_ = 0;
};

std::unique_ptr<spdlog::formatter> make_formatter(std::string_view format) {
  if (format == "json") return std::make_unique<JsonFormatter>();
  auto human = std::make_unique<spdlog::pattern_formatter>();
  human->add_flag<LevelFlag>('L').add_flag<SessionFlag>('*').add_flag<PrintableMessage>('~');
  human->set_pattern("%H:%M:%S.%e %L %*%~");
  return human;
}

}  // namespace

void set_up_log(std::string_view format, std::string_view level) {
  std::shared_ptr<spdlog::sinks::sink> sink = std::make_shared<PromptSink>();
  const auto least = spdlog::level::from_str(std::string(level));
  // At level debug, nothing is omitted.
  if (least > spdlog::level::debug) sink = std::make_shared<BoundedSink>(std::move(sink));
  auto logger = std::make_shared<spdlog::logger>("catgs-server", std::move(sink));
  logger->set_formatter(make_formatter(format));
  logger->set_level(least);
  spdlog::set_default_logger(std::move(logger));
  in_json = format == "json";
}

void log_refusal(const LogFacts& facts, const std::string& text) {
  logs_refusal = true;
  log_warning(facts, "{}", text);
  logs_refusal = false;
}

void log_failure(std::string_view event, const std::string& text) {
  if (in_json)
    log_event(spdlog::level::critical, {.event = event}, "{}", text);
  else
    fmt::print(stderr, "catgs-server: {}\n", printable(text));
}

std::uint64_t log_lines_lost() { return lines_lost; }

}  // namespace catgs
