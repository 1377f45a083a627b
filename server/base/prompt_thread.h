#pragma once

namespace catgs {

/// Asks the kernel to run the calling thread soon after it wakes. It is for threads with
/// microseconds of work next to threads that compute all the time. It sets a shorter time slice,
/// which needs no privilege and takes no more of the processor. It has no effect before Linux 6.12.
void run_promptly() noexcept;

/// Lets other threads go first. It holds for this thread and those that it starts from now on.
void run_in_background() noexcept;

}  // namespace catgs
