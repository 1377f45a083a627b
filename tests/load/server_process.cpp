#include "tests/load/server_process.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <fstream>
#include <iterator>
#include <sstream>
#include <utility>

#include <boost/asio/io_context.hpp>
#include <boost/asio/ip/tcp.hpp>
#include <boost/beast/core/flat_buffer.hpp>
#include <boost/beast/core/tcp_stream.hpp>
#include <boost/beast/http.hpp>
#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "render_core/base/error.h"
#include "tests/load/server_metrics.h"

namespace catgs::load {
namespace {

using namespace std::chrono_literals;

constexpr auto start_patience = 10min;  // large scenes load slowly
constexpr auto stop_patience = 10s;
constexpr auto sample_interval = 500ms;

/// CPU seconds of a process, of all its threads; 0 once it is gone.
double process_cpu_s(const std::string& pid) {
  std::ifstream file("/proc/" + pid + "/stat");
  std::string text(std::istreambuf_iterator<char>(file), {});
  // The name may hold anything; what follows its bracket are numbers: state is field 3.
  std::istringstream fields(text.substr(std::min(text.rfind(')') + 2, text.size())));
  std::string skipped;
  for (int field = 3; field < 14; ++field) fields >> skipped;
  double user = 0.0, system = 0.0;
  fields >> user >> system;
  return (user + system) / static_cast<double>(sysconf(_SC_CLK_TCK));
}

double process_rss_mb(const std::string& pid) {
  std::ifstream file("/proc/" + pid + "/statm");
  double size = 0.0, resident = 0.0;
  file >> size >> resident;
  return 1e-6 * resident * static_cast<double>(sysconf(_SC_PAGESIZE));
}

/// CPU seconds that the machine's cores were busy.
double machine_cpu_s() {
  std::ifstream file("/proc/stat");
  std::string cpu;
  std::array<double, 8> times{};  // user nice system idle iowait irq softirq steal
  file >> cpu;
  for (double& time : times) file >> time;
  double busy = 0.0;
  for (const std::size_t i : {0u, 1u, 2u, 5u, 6u}) busy += times[i];
  return busy / static_cast<double>(sysconf(_SC_CLK_TCK));
}

/// Number behind `mark` in the text; 0 without one.
int number_behind(const std::string& text, const std::string& mark) {
  const std::size_t at = text.find(mark);
  return at == std::string::npos ? 0 : std::atoi(text.c_str() + at + mark.size());
}

}  // namespace

ServerProcess::ServerProcess(std::vector<std::string> command, std::filesystem::path log)
    : log_(std::move(log)) {
  for (const char* argument :
       {"--port", "0", "--admin-bind", "127.0.0.1:0", "--log-format", "human"})
    command.emplace_back(argument);
  std::vector<char*> arguments;
  for (std::string& argument : command) arguments.push_back(argument.data());
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t files;
  posix_spawn_file_actions_init(&files);
  posix_spawn_file_actions_addopen(&files, STDOUT_FILENO, log_.c_str(),
                                   O_WRONLY | O_CREAT | O_TRUNC, 0644);
  posix_spawn_file_actions_adddup2(&files, STDOUT_FILENO, STDERR_FILENO);
  const int error =
      posix_spawnp(&pid_, arguments.front(), &files, nullptr, arguments.data(), environ);
  posix_spawn_file_actions_destroy(&files);
  if (error != 0) {
    throw InputError(command.front(), "", std::generic_category().message(error),
                     "--server names the program");
  }
  try {
    wait_until_serving();
  } catch (...) {
    stop();
    throw;
  }
}

ServerProcess::~ServerProcess() { stop(); }

std::string ServerProcess::log_text() const {
  std::ifstream file(log_);
  return {std::istreambuf_iterator<char>(file), {}};
}

void ServerProcess::wait_until_serving() {
  const auto deadline = std::chrono::steady_clock::now() + start_patience;
  while (std::chrono::steady_clock::now() < deadline) {
    const std::string text = log_text();
    admin_port_ = number_behind(text, "metrics: http://127.0.0.1:");
    const int plain = number_behind(text, "open http://127.0.0.1:");
    const int tls = number_behind(text, "open https://127.0.0.1:");
    if (admin_port_ > 0 && plain + tls > 0) {
      url_ = fmt::format("{}://127.0.0.1:{}", tls > 0 ? "wss" : "ws", plain + tls);
      return;
    }
    int status = 0;
    if (waitpid(pid_, &status, WNOHANG) == pid_) {
      pid_ = -1;
      throw InputError("the server ended before it served", "", text,
                       "its log is " + log_.string());
    }
    std::this_thread::sleep_for(20ms);
  }
  throw InputError("the server does not serve", "", log_.string(), "its log says how far it came");
}

void ServerProcess::signal(int number) const {
  if (pid_ > 0) ::kill(pid_, number);
}

nlohmann::ordered_json ServerProcess::server_metrics() const {
  namespace beast = boost::beast;
  namespace http = beast::http;
  try {
    boost::asio::io_context io;
    beast::tcp_stream stream(io);
    stream.connect(
        {boost::asio::ip::address_v4::loopback(), static_cast<std::uint16_t>(admin_port_)});
    http::request<http::empty_body> request(http::verb::get, "/api/metrics", 11);
    request.set(http::field::host, fmt::format("127.0.0.1:{}", admin_port_));
    http::write(stream, request);
    beast::flat_buffer buffer;
    http::response<http::string_body> response;
    http::read(stream, buffer, response);
    return nlohmann::ordered_json::parse(response.body());
  } catch (const boost::system::system_error&) {
    return {};  // a server that a scenario has ended says nothing more
  }
}

void ServerProcess::begin_measuring() {
  before_ = server_metrics();
  sampler_ = std::jthread([this](const std::stop_token& stop) { sample(stop); });
}

void ServerProcess::end_measuring() {
  sampler_ = {};
  after_ = server_metrics();
}

void ServerProcess::sample(const std::stop_token& stop) {
  const std::string pid = std::to_string(pid_);
  // All of the machine: the generator may be held to some of them.
  const auto cores = static_cast<double>(std::max(1L, ::sysconf(_SC_NPROCESSORS_ONLN)));
  const auto begin = std::chrono::steady_clock::now();
  double at_s = 0.0, server_s = process_cpu_s(pid), own_s = process_cpu_s("self"),
         machine_s = machine_cpu_s();
  std::vector<UsageSample> usage;  // metrics() may be asked for names meanwhile
  while (!stop.stop_requested()) {
    std::this_thread::sleep_for(sample_interval);
    const double now_s =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    const double core_s = cores * (now_s - std::exchange(at_s, now_s));
    const auto share = [&](double& last, double current) {
      return std::max(0.0, current - std::exchange(last, current)) / core_s;
    };
    usage.push_back({.at_s = now_s,
                     .server_cpu = share(server_s, process_cpu_s(pid)),
                     .generator_cpu = share(own_s, process_cpu_s("self")),
                     .machine_cpu = share(machine_s, machine_cpu_s()),
                     .server_rss_mb = process_rss_mb(pid)});
  }
  usage_ = std::move(usage);
}

void ServerProcess::stop() {
  sampler_ = {};
  if (pid_ <= 0) return;
  ::kill(pid_, SIGCONT);
  ::kill(pid_, SIGTERM);
  const auto deadline = std::chrono::steady_clock::now() + stop_patience;
  int status = 0;
  while (waitpid(pid_, &status, WNOHANG) == 0) {
    if (std::chrono::steady_clock::now() > deadline) ::kill(pid_, SIGKILL);
    std::this_thread::sleep_for(20ms);
  }
  exit_code_ = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  pid_ = -1;
}

Metrics ServerProcess::metrics() const {
  const auto mean = [&](double from, double to, double UsageSample::*member) {
    const auto begin = static_cast<std::size_t>(from * static_cast<double>(usage_.size()));
    const auto end = static_cast<std::size_t>(to * static_cast<double>(usage_.size()));
    double sum = 0.0;
    for (std::size_t i = begin; i < end; ++i) sum += usage_[i].*member;
    return end > begin ? sum / static_cast<double>(end - begin) : std::nan("");
  };
  const double server = mean(0.0, 1.0, &UsageSample::server_cpu);
  const double generator = mean(0.0, 1.0, &UsageSample::generator_cpu);
  Metrics metrics = {{"server.cpu_percent", 100.0 * server},
                     {"generator.cpu_percent", 100.0 * generator},
                     {"machine.others_cpu_percent",
                      100.0 * (mean(0.0, 1.0, &UsageSample::machine_cpu) - server - generator)},
                     {"server.rss_mb", mean(0.75, 1.0, &UsageSample::server_rss_mb)},
                     // From the second quarter to the last: the first one fills pools and caches.
                     {"server.rss_growth_mb", mean(0.75, 1.0, &UsageSample::server_rss_mb) -
                                                  mean(0.25, 0.5, &UsageSample::server_rss_mb)},
                     {"server.exit_code", exit_code_}};
  for (auto& metric : change_between(before_, after_.empty() ? before_ : after_, "server."))
    metrics.push_back(std::move(metric));
  return metrics;
}

}  // namespace catgs::load
