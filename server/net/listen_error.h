#pragma once

#include "server/net/net_server.h"

namespace catgs {

/// Explains why libwebsockets could not listen at an address, which it does not tell itself. Throws
/// InputError with `flag`, the system's reason and the remedy. If the address is usable and `tls`
/// is not null, its certificate or key is to blame.
[[noreturn]] void throw_listen_error(const Endpoint& endpoint, const char* flag,
                                     const NetOptions* tls);

}  // namespace catgs
