#include "render_core/tools/table.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <cstddef>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "render_core/base/error.h"

namespace catgs {
namespace {

using Json = nlohmann::ordered_json;

/// Names come from files and must not end a cell.
std::string cell(std::string_view name) {
  std::string escaped;
  for (const char c : name) {
    if (c == '|') escaped += '\\';
    escaped += c == '\n' ? ' ' : c;
  }
  return escaped;
}

void merge_notes(PaperTable& table, const std::vector<std::string>& notes) {
  for (const std::string& note : notes) {
    if (std::ranges::find(table.notes, note) == table.notes.end()) table.notes.push_back(note);
  }
}

}  // namespace

std::string text(const Number& number) {
  if (std::isnan(number.value)) return "–";
  if (std::isinf(number.value)) return "∞";
  std::string digits = fmt::format("{:.{}f}", number.value, number.decimals);
  const std::size_t whole_end = std::min(digits.find('.'), digits.size());
  const std::size_t whole_begin = digits[0] == '-' ? 1 : 0;
  for (std::size_t i = whole_end; i > whole_begin + 3; i -= 3) digits.insert(i - 3, 1, ',');
  return fmt::format("{}{}", digits, number.unit);
}

void add_column(PaperTable& table, std::string name, std::initializer_list<Number> numbers) {
  assert(numbers.size() == table.rows.size());
  table.columns.push_back(std::move(name));
  for (std::size_t r = 0; r < numbers.size(); ++r)
    table.rows[r].numbers.push_back(numbers.begin()[r]);
}

std::string markdown(const PaperTable& table) {
  std::string out;
  if (!table.title.empty()) out += fmt::format("**{}**\n\n", cell(table.title));
  out += fmt::format("| {} |", table.corner);
  for (const std::string& column : table.columns) out += fmt::format(" {} |", cell(column));
  out += "\n|---|";
  for (std::size_t i = 0; i < table.columns.size(); ++i) out += "---:|";
  out += '\n';
  for (const PaperTable::Row& row : table.rows) {
    out += fmt::format("| {} |", cell(row.name));
    for (const Number& number : row.numbers) out += fmt::format(" {} |", text(number));
    out += '\n';
  }
  if (!table.notes.empty()) out += '\n';
  for (const std::string& note : table.notes) out += fmt::format("- {}\n", note);
  return out;
}

Json to_json(const PaperTable& table) {
  Json rows = Json::object();
  for (const PaperTable::Row& row : table.rows) {
    Json& values = rows[row.name] = Json::object();
    for (std::size_t i = 0; i < row.numbers.size(); ++i) {
      const double value = row.numbers[i].value;
      values[table.columns[i]] = std::isfinite(value) ? Json(value) : Json();
    }
  }
  return {{"title", table.title}, {"rows", rows}, {"notes", table.notes}};
}

PaperTable joined(std::span<const PaperTable> tables) {
  assert(!tables.empty());
  PaperTable all = tables.front();
  for (const PaperTable& table : tables.subspan(1)) {
    assert(table.rows.size() == all.rows.size());
    all.columns.insert(all.columns.end(), table.columns.begin(), table.columns.end());
    for (std::size_t r = 0; r < all.rows.size(); ++r) {
      const auto& numbers = table.rows[r].numbers;
      all.rows[r].numbers.insert(all.rows[r].numbers.end(), numbers.begin(), numbers.end());
    }
    merge_notes(all, table.notes);
  }
  return all;
}

PaperTable averaged(std::span<const PaperTable> tables) {
  assert(!tables.empty());
  PaperTable mean = tables.front();
  for (std::size_t r = 0; r < mean.rows.size(); ++r) {
    for (std::size_t c = 0; c < mean.columns.size(); ++c) {
      double logarithms = 0.0;
      int count = 0;
      for (const PaperTable& table : tables) {
        const double value = table.rows[r].numbers[c].value;
        if (std::isnan(value)) continue;
        logarithms += std::log(value);
        ++count;
      }
      mean.rows[r].numbers[c].value = count > 0 ? std::exp(logarithms / count) : Number::nothing;
    }
  }
  for (const PaperTable& table : tables.subspan(1)) merge_notes(mean, table.notes);
  mean.title = fmt::format("Geometric mean of {} scenes", tables.size());
  return mean;
}

void add_rows(PaperTable& table, std::size_t behind, const Json& rows, std::string_view source) {
  assert(behind < table.rows.size());
  constexpr std::string_view remedy = "like {\"FlashGS\": {\"city\": 120.5}}";
  if (!rows.is_object()) throw InputError(source, "", "is not an object of rows", remedy);
  std::vector<PaperTable::Row> added;
  for (const auto& [name, values] : rows.items()) {
    if (!values.is_object()) throw InputError(source, name, "is not an object of columns", remedy);
    PaperTable::Row row{name, table.rows[behind].numbers};
    bool known = false;
    for (std::size_t c = 0; c < table.columns.size(); ++c) {
      row.numbers[c].value = Number::nothing;
      const auto value = values.find(table.columns[c]);
      if (value == values.end() || value->is_null()) continue;
      if (!value->is_number()) throw InputError(source, name, "is not a number everywhere", remedy);
      row.numbers[c].value = value->get<double>();
      known = true;
    }
    if (!known) {
      throw InputError(source, name, "has none of the columns",
                       fmt::format("they are called {}", fmt::join(table.columns, ", ")));
    }
    added.push_back(std::move(row));
  }
  table.rows.insert(table.rows.begin() + static_cast<std::ptrdiff_t>(behind) + 1, added.begin(),
                    added.end());
}

}  // namespace catgs
