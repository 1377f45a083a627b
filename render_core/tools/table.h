#pragma once

#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

namespace catgs {

/// A number of a table: NaN where nothing was measured, infinite where that is the result.
struct Number {
  static constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

  double value = nothing;
  int decimals = 1;
  std::string_view unit{};  // printed behind it
};

/// Numbers under named columns.
struct PaperTable {
  struct Row {
    std::string name;
    std::vector<Number> numbers;  // one per column
  };

  std::string title;   // what it is about; "" where the columns say it
  std::string corner;  // above the names of the rows: what is counted
  std::vector<std::string> columns;
  std::vector<Row> rows;
  std::vector<std::string> notes;  // how to read it
};

/// "1,234.5 px"; a dash for NaN.
std::string text(const Number& number);

/// A Markdown table, with its notes behind.
std::string markdown(const PaperTable& table);

/// {"title", "rows": {row: {column: value}}, "notes"}; null for what is not finite.
nlohmann::ordered_json to_json(const PaperTable& table);

/// One table of the columns of all; they have the same rows. A note of several is kept once.
PaperTable joined(std::span<const PaperTable> tables);

/// One table of the geometric means of all, which have the same rows and columns; what a table
/// lacks does not count.
PaperTable averaged(std::span<const PaperTable> tables);

/// Adds rows that were measured elsewhere, {row: {column: value}}, behind row `behind`, written
/// like its numbers. `source` names them in the InputError for anything else and for a row none of
/// whose columns is in the table, which is a misspelt name.
void add_rows(PaperTable& table, std::size_t behind, const nlohmann::ordered_json& rows,
              std::string_view source);

}  // namespace catgs
