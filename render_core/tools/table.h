#pragma once

#include <initializer_list>
#include <limits>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

namespace catgs {

/// A number of a table. NaN: not measured. Infinite values are results.
struct Number {
  static constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

  double value = nothing;
  int decimals = 1;
  std::string_view unit{};  // printed after it
};

/// Numbers under named columns.
struct PaperTable {
  struct Row {
    std::string name;
    std::vector<Number> numbers{};  // one per column
  };

  std::string title{};   // the subject; "" where the columns say it
  std::string corner{};  // above the names of the rows: what the rows are
  std::vector<std::string> columns{};
  std::vector<Row> rows{};
  std::vector<std::string> notes{};  // how to read the table
};

/// The number for people, such as "1,234.5 px"; a dash for NaN.
std::string text(const Number& number);

/// Adds a column with a number for each row.
void add_column(PaperTable& table, std::string name, std::initializer_list<Number> numbers);

/// A Markdown table followed by its notes.
std::string markdown(const PaperTable& table);

/// {"title", "rows": {row: {column: value}}, "notes"}; null for values that are not finite.
nlohmann::ordered_json to_json(const PaperTable& table);

/// Joins the columns of tables that have the same rows. A note of several tables is kept once.
PaperTable joined(std::span<const PaperTable> tables);

/// The geometric means of tables that have the same rows and columns. Missing values do not count.
PaperTable averaged(std::span<const PaperTable> tables);

/// Adds rows that were measured elsewhere, {row: {column: value}}, after row `behind`, formatted
/// like its numbers. Throws an InputError that names `source` for any other shape, and for a row
/// with no column of the table, which is a misspelt name.
void add_rows(PaperTable& table, std::size_t behind, const nlohmann::ordered_json& rows,
              std::string_view source);

}  // namespace catgs
