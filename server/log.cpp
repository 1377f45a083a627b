#include "server/log.h"

#include <chrono>
#include <iterator>
#include <memory>
#include <string>

#include <fmt/chrono.h>
#include <nlohmann/json.hpp>
#include <spdlog/formatter.h>
#include <spdlog/pattern_formatter.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include "server/session/log_session.h"

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

std::unique_ptr<spdlog::formatter> make_formatter(std::string_view format) {
  if (format == "json") return std::make_unique<JsonFormatter>();
  auto human = std::make_unique<spdlog::pattern_formatter>();
  human->add_flag<SessionFlag>('*').set_pattern("%H:%M:%S.%e %^%l%$ %*%v");
  return human;
}

}  // namespace

void set_up_log(std::string_view format, std::string_view level) {
  auto logger = spdlog::stderr_color_mt("catgs-server");
  logger->set_formatter(make_formatter(format));
  logger->set_level(spdlog::level::from_str(std::string(level)));
  spdlog::set_default_logger(std::move(logger));
}

}  // namespace catgs
