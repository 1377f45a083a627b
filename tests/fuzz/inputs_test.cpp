// What fuzzing has found stays mended, and every seed is one that its parser accepts.
#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "tests/fuzz/target.h"

namespace catgs::fuzz {
namespace {

class FuzzInputs : public testing::TestWithParam<Target> {};

TEST_P(FuzzInputs, SeedsAreAccepted) {
  const auto seeds = GetParam().seeds();
  ASSERT_FALSE(seeds.empty());
  for (const auto& [name, bytes] : seeds) {
    EXPECT_LE(bytes.size(), GetParam().max_bytes) << name;
    EXPECT_NO_THROW(GetParam().parse(bytes_of(bytes))) << name;
  }
}

INSTANTIATE_TEST_SUITE_P(Parser, FuzzInputs, testing::ValuesIn(targets()),
                         [](const auto& target) { return target.param.name; });

TEST(FuzzFindings, StayMended) {
  int findings = 0;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(CATGS_FUZZ_FINDINGS)) {
    if (!entry.is_regular_file()) continue;
    SCOPED_TRACE(entry.path().string());
    ++findings;
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(in), {});
    try {
      target_called(entry.path().parent_path().filename().string()).parse(bytes_of(bytes));
    } catch (const InputError& refused) {
      EXPECT_STRNE(refused.what(), "");
    } catch (const std::exception& error) {
      ADD_FAILURE() << error.what();
    }
  }
  EXPECT_GT(findings, 0);
}

}  // namespace

/// Names a target in GoogleTest's messages.
void PrintTo(const Target& target, std::ostream* out) { *out << target.name; }

}  // namespace catgs::fuzz
