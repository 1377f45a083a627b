#pragma once

// CLI11's classes for headers. CLI/CLI.hpp compiles its validators once in each file that includes
// it, which takes some seconds, so only files that define options include it.
namespace CLI {
class App;
class Error;
class Option;
}  // namespace CLI
