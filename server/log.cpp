#include "server/log.h"

#include <atomic>
#include <chrono>
#include <cstdio>
#include <iterator>
#include <memory>
#include <mutex>
#include <string>
#include <utility>

#include <fmt/chrono.h>
#include <nlohmann/json.hpp>
#include <poll.h>
#include <spdlog/formatter.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/base_sink.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include "server/session/log_session.h"
#include "server/session/rate_limit.h"

namespace catgs {
namespace {

/// spdlog's patterns cannot escape a message, so JSON has a formatter of its own.
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
    if (!logged_session.empty()) line["session"] = logged_session;
    line["message"] = std::string(message.payload.data(), message.payload.size());
    // Text from clients may be no UTF-8.
    const std::string text =
        line.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace) + "\n";
    out.append(text.data(), text.data() + text.size());
  }
  [[nodiscard]] std::unique_ptr<formatter> clone() const override {
    return std::make_unique<JsonFormatter>();
  }
};

/// "session 1f2e3d4c: ", or nothing.
class SessionFlag final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg&, const std::tm&, spdlog::memory_buf_t& out) override {
    if (!logged_session.empty())
      fmt::format_to(std::back_inserter(out), "session {}: ", logged_session);
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<SessionFlag>();
  }
};

/// The message. Clients have a say in it: what would move a terminal's cursor or begin a line of
/// its own comes out as \\x1b.
class PrintableMessage final : public spdlog::custom_flag_formatter {
 public:
  void format(const spdlog::details::log_msg& message, const std::tm&,
              spdlog::memory_buf_t& out) override {
    for (const char c : message.payload) {
      const auto byte = static_cast<unsigned char>(c);
      if (byte < 0x20 || byte == 0x7f)
        fmt::format_to(std::back_inserter(out), "\\x{:02x}", byte);
      else
        out.push_back(c);
    }
  }
  [[nodiscard]] std::unique_ptr<custom_flag_formatter> clone() const override {
    return std::make_unique<PrintableMessage>();
  }
};

std::atomic<std::uint64_t> lines_lost{0};

/// Standard error, as long as it takes lines at once: a full disk costs lines and nothing else, and
/// whoever stops to read a pipe does not stop the sessions. The next line that gets through says
/// how many did not.
class PatientSink final : public spdlog::sinks::base_sink<std::mutex> {
 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    const std::string text = fmt::format("{} lines were lost: standard error took none", lost_);
    const bool told = lost_ == 0 || write({message.logger_name, spdlog::level::warn, text});
    if (told) lost_ = 0;
    if (told && write(message)) return;
    ++lost_;
    ++lines_lost;
  }
  void flush_() override { to_.flush(); }
  void set_formatter_(std::unique_ptr<spdlog::formatter> formatter) override {
    to_.set_formatter(std::move(formatter));
  }

 private:
  /// False: it was not taken.
  bool write(const spdlog::details::log_msg& message) {
    pollfd standard_error{STDERR_FILENO, POLLOUT, 0};
    if (::poll(&standard_error, 1, 0) != 1 || (standard_error.revents & POLLOUT) == 0) return false;
    to_.log(message);
    if (std::ferror(stderr) == 0) return true;
    std::clearerr(stderr);
    return false;
  }

  spdlog::sinks::stderr_color_sink_mt to_;  // writes through `stderr`, which has no buffer
  std::uint64_t lost_ = 0;
};

/// Leaves lines out where there are too many, and says how many: strangers can cause a line with
/// each connection, and somebody pays for the disk.
class BoundedSink final : public spdlog::sinks::base_sink<std::mutex> {
 public:
  explicit BoundedSink(std::shared_ptr<spdlog::sinks::sink> to) : to_(std::move(to)) {}

 protected:
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (!rate_.take(Clock::now())) {
      ++left_out_;
      return;
    }
    if (const auto count = std::exchange(left_out_, 0); count > 0) {
      const std::string text = fmt::format("{} lines were left out: there were too many", count);
      to_->log(spdlog::details::log_msg(message.logger_name, spdlog::level::warn, text));
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

  const std::shared_ptr<spdlog::sinks::sink> to_;
  RateLimit rate_{lines_per_second, burst, Clock::now()};
  std::uint64_t left_out_ = 0;
};

std::unique_ptr<spdlog::formatter> make_formatter(std::string_view format) {
  if (format == "json") return std::make_unique<JsonFormatter>();
  auto human = std::make_unique<spdlog::pattern_formatter>();
  human->add_flag<SessionFlag>('*').add_flag<PrintableMessage>('~').set_pattern(
      "%H:%M:%S.%e %^%l%$ %*%~");
  return human;
}

}  // namespace

void set_up_log(std::string_view format, std::string_view level) {
  std::shared_ptr<spdlog::sinks::sink> sink = std::make_shared<PatientSink>();
  const auto least = spdlog::level::from_str(std::string(level));
  // Who asks for debugging wants to see it all.
  if (least > spdlog::level::debug) sink = std::make_shared<BoundedSink>(std::move(sink));
  auto logger = std::make_shared<spdlog::logger>("catgs-server", std::move(sink));
  logger->set_formatter(make_formatter(format));
  logger->set_level(least);
  spdlog::set_default_logger(std::move(logger));
}

std::uint64_t log_lines_lost() { return lines_lost; }

}  // namespace catgs
