#pragma once

#include <iosfwd>

namespace catgs {

/// `catgs-server selftest`: encodes a moving picture with every encoder at several sizes, decodes
/// it, compares and times, and prints a table; for an encoder that is not usable it prints why.
/// Returns 0 when every usable encoder passed and there is one, else 1.
int run_selftest(std::ostream& out);

}  // namespace catgs
