#include "server/config/config.h"

#include <algorithm>
#include <cctype>
#include <stdexcept>
#include <utility>

#include <fmt/format.h>
#include <toml++/toml.h>

#include "render_core/base/error.h"
#include "render_core/base/nearest_name.h"
#include "server/base/required_file.h"

namespace catgs {
namespace {

using Values = std::vector<std::string>;

const Setting* find_setting(std::string_view name) {
  const auto& all = settings();
  const auto it = std::ranges::find(all, name, &Setting::name);
  return it == all.end() ? nullptr : &*it;
}

std::vector<std::string> setting_names() {
  std::vector<std::string> names;
  for (const auto& setting : settings()) names.push_back(setting.name);
  return names;
}

constexpr std::string_view variable_prefix = "CATGS_";

std::string variable_of(std::string_view setting_name) {
  std::string variable = std::string(variable_prefix).append(setting_name);
  for (char& c : variable)
    c = c == '-' ? '_' : static_cast<char>(std::toupper(static_cast<unsigned char>(c)));
  return variable;
}

/// Throws std::invalid_argument.
void set(const Setting& setting, const Values& values, const std::string& source,
         ServerConfig& config, ConfigSources& sources) {
  setting.set(config, values);
  sources[setting.name] = source;
}

/// From a source that is named after the setting.
void set_from(const std::string& source, const Setting& setting, const Values& values,
              ServerConfig& config, ConfigSources& sources) {
  try {
    set(setting, values, source, config, sources);
  } catch (const std::invalid_argument& error) {
    throw InputError(source, {}, error.what());
  }
}

Values split_at_commas(std::string_view text_value) {
  Values values;
  while (!text_value.empty()) {
    const auto comma = std::min(text_value.find(','), text_value.size());
    if (comma > 0) values.emplace_back(text_value.substr(0, comma));
    text_value.remove_prefix(std::min(comma + 1, text_value.size()));
  }
  return values;
}

std::string scalar_text(const toml::node& node) {
  if (const auto s = node.value_exact<std::string>()) return *s;
  if (const auto b = node.value_exact<bool>()) return *b ? "true" : "false";
  if (const auto i = node.value_exact<std::int64_t>()) return std::to_string(*i);
  if (const auto d = node.value_exact<double>()) return fmt::format("{}", *d);
  throw std::invalid_argument("a text, a number or true/false is expected");
}

Values toml_values(const toml::node& node) {
  Values values;
  if (const auto* array = node.as_array())
    for (const auto& item : *array) values.push_back(scalar_text(item));
  else
    values.push_back(scalar_text(node));
  return values;
}

}  // namespace

void apply_toml(const std::string& path, ServerConfig& config, ConfigSources& sources) {
  toml::table table;
  try {
    std::ifstream in = open_required_file("--config", path);
    table = toml::parse(in, path);
  } catch (const toml::parse_error& error) {
    const auto line = error.source().begin.line;
    throw InputError(line ? fmt::format("{}:{}", path, line) : path, {}, error.description());
  }
  for (const auto& [key, node] : table) {
    const std::string source = fmt::format("{}:{}", path, key.source().begin.line);
    const Setting* setting = find_setting(key.str());
    if (!setting)
      throw InputError(source, std::string(key.str()), "there is no such setting",
                       suggest_name(key.str(), setting_names(), "catgs-server --help lists them"));
    try {
      set(*setting, toml_values(node), source, config, sources);
    } catch (const std::invalid_argument& error) {
      throw InputError(source, setting->name, error.what());
    }
  }
}

void apply_environment(const std::function<const char*(const char*)>& lookup, ServerConfig& config,
                       ConfigSources& sources) {
  for (const auto& setting : settings()) {
    const std::string variable = variable_of(setting.name);
    const char* value = lookup(variable.c_str());
    if (!value) continue;
    const Values values =
        setting.kind == Setting::Kind::list ? split_at_commas(value) : Values{value};
    set_from(variable, setting, values, config, sources);
  }
}

std::string unknown_variables(const std::vector<std::string>& names) {
  Values known = setting_names();
  known.emplace_back("config");
  std::string unknown;
  for (const auto& name : names) {
    if (!name.starts_with(variable_prefix)) continue;
    const auto is_name = [&](const std::string& setting) { return variable_of(setting) == name; };
    if (std::ranges::any_of(known, is_name)) continue;
    std::string meant = name.substr(variable_prefix.size());
    for (char& c : meant)
      c = c == '_' ? '-' : static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
    const std::string nearest = nearest_name(meant, known);
    unknown += (unknown.empty() ? "" : ", ") + name;
    if (!nearest.empty()) unknown += fmt::format(" (did you mean {}?)", variable_of(nearest));
  }
  return unknown;
}

void apply_flag(const Setting& setting, const std::vector<std::string>& values,
                ServerConfig& config, ConfigSources& sources) {
  set_from("--" + setting.name, setting, values, config, sources);
}

std::string print_config(const ServerConfig& config, const ConfigSources& sources) {
  std::string out;
  for (const auto& setting : settings()) {
    const auto it = sources.find(setting.name);
    out += fmt::format("{} = {}  # {}\n", setting.name, setting.get(config),
                       it == sources.end() ? "default" : it->second);
  }
  return out;
}

}  // namespace catgs
