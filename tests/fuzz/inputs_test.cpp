// Findings of fuzzing stay fixed, inputs of the corpus reach their code, and mutants of all that
// break nothing. This runs without libFuzzer, with every compiler and sanitizer.
#include <cstdio>
#include <cstdlib>

#include <fmt/format.h>
#include <unistd.h>

#include "tests/fuzz/corpus.h"
#include "tests/fuzz/mutate.h"
#include "tests/fuzz/target.h"
#include "tests/support/test.h"

namespace catgs::fuzz {
namespace {

namespace fs = std::filesystem;

enum class Verdict { accepted, refused };

/// Anything but an acceptance or an InputError that says something is a failure.
Verdict parse(const Target& target, const std::string& input) {
  try {
    target.parse(bytes_of(input));
    return Verdict::accepted;
  } catch (const InputError& refused) {
    EXPECT_STRNE(refused.what(), "");
  } catch (const std::exception& error) {
    ADD_FAILURE() << error.what();
  }
  return Verdict::refused;
}

std::vector<std::string> corpus_of(const Target& target) {
  return read_corpus(fs::path(CATGS_FUZZ_CORPUS) / (target.name + ".tar.gz"));
}

/// Which mutants each target gets: the same few everywhere, or with CATGS_FUZZ_SECONDS, as
/// fuzz.smoke sets it, others in each run for that long. CATGS_FUZZ_SEED tries those of a run
/// again.
struct Mutants {
  std::uint64_t seed = 1;
  int most = 1000;
  std::chrono::steady_clock::time_point end = std::chrono::steady_clock::time_point::max();
};

Mutants asked_mutants() {
  Mutants mutants;
  if (const char* seconds = std::getenv("CATGS_FUZZ_SECONDS")) {
    mutants.seed = std::random_device()();
    mutants.most = std::numeric_limits<int>::max();
    mutants.end = std::chrono::steady_clock::now() +
                  std::chrono::milliseconds(std::lround(1000.0 * std::atof(seconds)));
  }
  if (const char* seed = std::getenv("CATGS_FUZZ_SEED"))
    mutants.seed = std::strtoull(seed, nullptr, 10);
  return mutants;
}

class FuzzInputs : public testing::TestWithParam<Target> {};

TEST_P(FuzzInputs, SeedsAreAccepted) {
  const auto seeds = GetParam().seeds();
  ASSERT_FALSE(seeds.empty());
  for (const auto& [name, bytes] : seeds) {
    EXPECT_LE(bytes.size(), GetParam().max_bytes) << name;
    EXPECT_NO_THROW(GetParam().parse(bytes_of(bytes))) << name;
  }
}

TEST_P(FuzzInputs, CorpusIsAcceptedOrRefused) {
  int accepted = 0;
  int refused = 0;
  for (const std::string& input : corpus_of(GetParam()))
    (parse(GetParam(), input) == Verdict::accepted ? accepted : refused) += 1;
  EXPECT_GT(accepted, 0);
  EXPECT_GT(refused, 0);
}

TEST_P(FuzzInputs, MutantsAreAcceptedOrRefused) {
  const Target& target = GetParam();
  std::vector<std::string> inputs = corpus_of(target);
  for (const auto& [name, bytes] : target.seeds()) inputs.push_back(bytes);
  // fuzz.smoke may run at the same time.
  const std::string found = fmt::format(CATGS_FUZZ_FOUND "/{}.{}", target.name, ::getpid());
  KeptInput kept(found);
  const Mutants mutants = asked_mutants();
  // At once: what ends the process leaves no other word.
  fmt::print("CATGS_FUZZ_SEED={}\n", mutants.seed);
  std::fflush(stdout);
  std::mt19937_64 random(mutants.seed);
  int tried = 0;
  while (!HasFailure() && tried < mutants.most &&
         (tried == 0 || std::chrono::steady_clock::now() < mutants.end)) {
    const std::string input =
        mutant({random, inputs, target.dictionary}, target.change, target.max_bytes);
    kept.keep(input);
    parse(target, input);
    ++tried;
  }
  RecordProperty("mutants", tried);
  if (!HasFailure()) return;
  kept.leave();
  ADD_FAILURE() << "by the input that is left in " << found << ", mutant " << tried
                << " of CATGS_FUZZ_SEED=" << mutants.seed;
}

INSTANTIATE_TEST_SUITE_P(Parser, FuzzInputs, testing::ValuesIn(targets()),
                         [](const auto& target) { return target.param.name; });

TEST(FuzzFindings, StayMended) {
  int findings = 0;
  for (const auto& entry : fs::recursive_directory_iterator(CATGS_FUZZ_FINDINGS)) {
    if (!entry.is_regular_file()) continue;
    SCOPED_TRACE(entry.path().string());
    ++findings;
    std::ifstream in(entry.path(), std::ios::binary);
    const std::string bytes(std::istreambuf_iterator<char>(in), {});
    parse(target_called(entry.path().parent_path().filename().string()), bytes);
  }
  EXPECT_GT(findings, 0);
}

}  // namespace

/// Names a target in GoogleTest's messages.
void PrintTo(const Target& target, std::ostream* out) { *out << target.name; }

}  // namespace catgs::fuzz
