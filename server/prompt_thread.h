#pragma once

namespace catgs {

/// Asks the kernel to run the calling thread soon after it wakes: for threads that hand work on in
/// microseconds, beside others that compute for as long as they are let. It takes no more of the
/// processor for that, and no privilege: a shorter time slice, whose turn comes sooner. Kernels
/// before 6.12 have one slice for all; nothing changes there.
void run_promptly() noexcept;

}  // namespace catgs
