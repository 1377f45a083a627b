#include "render_core/base/command_line.h"

#include <cstdint>
#include <string>
#include <vector>

#include <CLI/CLI.hpp>
#include <gtest/gtest.h>

#include "render_core/base/error.h"

namespace catgs {
namespace {

class CommandLine : public testing::Test {
 protected:
  CommandLine() {
    app_.add_option("--port", port_);
    app_.add_flag("--open");
    app_.add_option("--token-file", token_file_);
    app_.add_option("--pose-hz", pose_hz_);
    CLI::App* synth = app_.add_subcommand("synth");
    synth->add_option("--gaussians", gaussians_);
    synth->add_option("--sizes", sizes_);
    synth->add_option("--lod", lod_);
  }

  /// What is wrong with these words; empty: nothing.
  std::string complaint(std::vector<const char*> words) {
    words.insert(words.begin(), "program");
    try {
      parse_command_line(app_, static_cast<int>(words.size()), words.data());
    } catch (const InputError& error) {
      return error.what();
    } catch (const CLI::ParseError& error) {
      return error.what();
    }
    return {};
  }

  CLI::App app_;
  int port_ = 0;
  unsigned pose_hz_ = 0;
  std::string token_file_;
  std::size_t gaussians_ = 0;
  std::vector<std::uint64_t> sizes_;
  int lod_ = 0;
};

TEST_F(CommandLine, NoUnsignedNumberIsTakenFromANegativeOne) {
  EXPECT_EQ(complaint({"synth", "--gaussians", "-5"}), "--gaussians: -5 is negative");
  EXPECT_EQ(complaint({"--pose-hz=-1"}), "--pose-hz: -1 is negative");
  EXPECT_EQ(complaint({"synth", "--sizes", "4", "-5"}), "--sizes: -5 is negative");
  EXPECT_EQ(complaint({"synth", "--gaussians", "5", "--lod", "-1"}), "");
  EXPECT_EQ(gaussians_, 5u);
  EXPECT_EQ(lod_, -1);
}

TEST_F(CommandLine, AnUnknownOptionIsNamedWithTheNearest) {
  EXPECT_EQ(complaint({"--prot", "8932"}), "unknown option --prot: did you mean --port?");
  EXPECT_EQ(complaint({"--prot=8932"}), "unknown option --prot: did you mean --port?");
  EXPECT_EQ(complaint({"synth", "--gausians", "5"}),
            "unknown option --gausians: did you mean --gaussians?");
  EXPECT_EQ(complaint({"--gausians", "5"}), "unknown option --gausians: --help lists them")
      << "of commands that were given";
  EXPECT_EQ(complaint({"--token", "x"}), "unknown option --token: did you mean --token-file?");
  EXPECT_EQ(complaint({"--zzzzzz"}), "unknown option --zzzzzz: --help lists them");
  EXPECT_EQ(complaint({"--port", "1", "word"}), "\"word\": is one word too many (see --help)");
}

TEST_F(CommandLine, AnUnknownCommandIsNamedWithTheNearest) {
  app_.require_subcommand(1);
  CLI::App* trace = app_.add_subcommand("trace");
  trace->require_subcommand(1);
  trace->add_subcommand("anchor");
  EXPECT_EQ(complaint({"snyth", "--gaussians", "5"}), "unknown command snyth: did you mean synth?");
  EXPECT_EQ(complaint({"zzzzzz"}), "unknown command zzzzzz: --help lists them");
  EXPECT_EQ(complaint({"trace", "anchr"}), "unknown command anchr: did you mean anchor?");
  EXPECT_EQ(complaint({"--port", "1"}), "A subcommand is required");
  EXPECT_EQ(complaint({"trace"}), "A subcommand is required");
}

}  // namespace
}  // namespace catgs
