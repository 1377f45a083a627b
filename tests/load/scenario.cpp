#include "tests/load/scenario.h"

#include <algorithm>
#include <csignal>
#include <set>
#include <utility>

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include "render_core/base/error.h"
#include "render_core/base/nearest_name.h"
#include "tests/load/units.h"

namespace catgs::load {
namespace {

std::string_view kind_of(bool) { return "true or false"; }
std::string_view kind_of(std::int64_t) { return "a whole number"; }
std::string_view kind_of(const std::string&) { return "a text in quotes"; }

/// Takes the values of one table by name; what nobody took is a mistake.
class TableReader {
 public:
  TableReader(const std::string& path, const toml::table& table) : path_(path), table_(table) {}

  [[noreturn]] void refuse(const toml::node& node, std::string_view what,
                           std::string_view remedy = {}) const {
    throw InputError(path_, fmt::format("line {}", node.source().begin.line), what, remedy);
  }

  template <typename T>
  void take(std::string_view key, T& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto found = node->value_exact<T>();
    if (!found) refuse(*node, fmt::format("{} is not {}", key, kind_of(T())));
    value = *found;
  }

  void take(std::string_view key, int& value, int low, int high) {
    std::int64_t number = value;
    take(key, number);
    if (number < low || number > high) {
      refuse(*find(key), fmt::format("{} is not in {}…{}", key, low, high));
    }
    value = static_cast<int>(number);
  }

  void take(std::string_view key, double& value) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    const auto number = node->value<double>();  // whole numbers too
    if (!number) refuse(*node, fmt::format("{} is not a number", key));
    value = *number;
  }

  /// A duration as text: "500ms".
  void take_seconds(std::string_view key, double& seconds) {
    std::string text;
    take(key, text);
    if (!text.empty()) seconds = parse_duration_s(place(key), text);
  }

  /// A text, or a list of texts.
  void take(std::string_view key, std::vector<std::string>& values) {
    const toml::node* node = find(key);
    if (node == nullptr) return;
    values.clear();
    if (const auto text = node->value_exact<std::string>()) {
      values.push_back(*text);
      return;
    }
    const toml::array* array = node->as_array();
    if (array == nullptr) refuse(*node, fmt::format("{} is no list of texts", key));
    for (const toml::node& element : *array) {
      const auto text = element.value_exact<std::string>();
      if (!text) refuse(element, fmt::format("{} is no list of texts", key));
      values.push_back(*text);
    }
  }

  /// Tables under [[key]] or [key].
  std::vector<TableReader> tables(std::string_view key) {
    std::vector<TableReader> readers;
    const toml::node* node = find(key);
    if (node == nullptr) return readers;
    if (const toml::table* table = node->as_table()) readers.emplace_back(path_, *table);
    if (const toml::array* array = node->as_array()) {
      for (const toml::node& element : *array) {
        if (!element.is_table()) refuse(element, fmt::format("{} is no table", key));
        readers.emplace_back(path_, *element.as_table());
      }
    }
    if (readers.empty()) refuse(*node, fmt::format("{} is no table", key));
    return readers;
  }

  void finish() const {
    for (const auto& [key, node] : table_) {
      if (!taken_.contains(std::string(key.str()))) {
        const std::vector<std::string> names(taken_.begin(), taken_.end());
        refuse(node, fmt::format("nothing is called \"{}\" here", key.str()),
               suggest_name(key.str(), names, fmt::format("one of {}", fmt::join(names, ", "))));
      }
    }
  }

  [[nodiscard]] std::string place(std::string_view key) const {
    const toml::node* node = table_.get(key);
    return fmt::format("{}: line {}: {}", path_, node ? node->source().begin.line : 0, key);
  }

 private:
  const toml::node* find(std::string_view key) {
    taken_.emplace(key);
    return table_.get(key);
  }

  const std::string& path_;
  const toml::table& table_;
  std::set<std::string> taken_;
};

GroupOptions read_group(TableReader& reader, const std::filesystem::path& folder) {
  GroupOptions group;
  reader.take("name", group.name);
  reader.take("sessions", group.sessions, 1, 1000);
  reader.take_seconds("start", group.start_s);
  reader.take_seconds("ramp", group.ramp_s);
  reader.take_seconds("end", group.end_s);
  reader.take("scene", group.scene);
  reader.take("traces", group.traces);
  for (std::string& trace : group.traces) trace = (folder / trace).string();
  reader.take("anchor", group.anchor);
  reader.take("script", group.script.script);
  int seed = 1;
  reader.take("seed", seed, 0, 1'000'000'000);
  group.script.seed = static_cast<std::uint64_t>(seed);
  reader.take("sizes", group.sizes);
  reader.take("moving-size", group.moving_size);
  reader.take_seconds("move-for", group.move_for_s);
  reader.take_seconds("rest-for", group.rest_for_s);
  reader.take("fps", group.fps, 1, 240);
  reader.take("pose-hz", group.pose_hz, 0, 1000);
  reader.take("max-bitrate-kbps", group.max_bitrate_kbps, 0, 200'000);
  reader.take("fixed-quality", group.fixed_quality);
  double fov_deg = group.fov_y_deg;
  reader.take("fov-deg", fov_deg);
  group.fov_y_deg = static_cast<float>(fov_deg);
  std::string link;
  reader.take("link", link);
  if (!link.empty()) group.link = parse_link(reader.place("link"), link);
  reader.take("decode", group.decode);
  reader.take("only-pictures", group.only_pictures);
  reader.take_seconds("decode-time", group.decode_time_s);
  reader.take("acks", group.acknowledge);
  reader.take("flood-hz", group.flood_hz, 0, 100'000);
  reader.take_seconds("reconnect-every", group.reconnect_every_s);
  reader.take_seconds("stall-at", group.stall_at_s);
  reader.take_seconds("stall-for", group.stall_for_s);
  reader.finish();
  return group;
}

ServerSignal read_signal(TableReader& reader) {
  constexpr std::pair<std::string_view, int> names[] = {
      {"STOP", SIGSTOP}, {"CONT", SIGCONT}, {"TERM", SIGTERM}, {"HUP", SIGHUP}, {"KILL", SIGKILL}};
  ServerSignal signal;
  std::string name;
  reader.take("signal", name);
  reader.take_seconds("at", signal.at_s);
  reader.finish();
  const auto found = std::ranges::find(names, name, &std::pair<std::string_view, int>::first);
  if (found == std::end(names)) {
    throw InputError(reader.place("signal"), "", fmt::format("unknown signal \"{}\"", name),
                     "STOP, CONT, TERM, HUP or KILL");
  }
  signal.number = found->second;
  return signal;
}

}  // namespace

Scenario read_scenario(const std::filesystem::path& path) {
  const std::string name = path.string();
  const toml::table table = [&] {
    try {
      return toml::parse_file(name);
    } catch (const toml::parse_error& error) {
      throw InputError(name, fmt::format("line {}", error.source().begin.line),
                       error.description());
    }
  }();
  Scenario scenario;
  TableReader reader(name, table);
  reader.take("title", scenario.title);
  reader.take_seconds("duration", scenario.load.duration_s);
  reader.take("require", scenario.requirements);
  reader.take("check-scene", scenario.check_scene);
  reader.take("pictures", scenario.pictures, 1, 256);
  for (TableReader& held : reader.tables("held")) {
    held.take("pose-to-frame-p95-ms", scenario.bounds.pose_to_frame_p95_ms);
    held.take("pose-age-p95-ms", scenario.bounds.pose_age_p95_ms);
    held.take("psnr-db", scenario.bounds.psnr_db);
    held.finish();
  }
  for (TableReader& server : reader.tables("server")) {
    server.take("args", scenario.server_args);
    for (TableReader& signal : server.tables("signals")) {
      scenario.signals.push_back(read_signal(signal));
    }
    server.finish();
  }
  for (TableReader& clients : reader.tables("clients")) {
    scenario.load.groups.push_back(read_group(clients, path.parent_path()));
  }
  reader.finish();
  if (scenario.load.groups.empty()) throw InputError(name, "", "has no [[clients]]");
  return scenario;
}

}  // namespace catgs::load
