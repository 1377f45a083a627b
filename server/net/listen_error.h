#pragma once

#include "server/net/net_server.h"

namespace catgs {

/// For an address at which libwebsockets could not listen; it says no more than that. Throws
/// InputError with `flag`, the system's reason and the remedy. `tls`: where it is not null, its
/// certificate and key are to blame where the address is not.
[[noreturn]] void throw_listen_error(const Endpoint& endpoint, const char* flag,
                                     const NetOptions* tls);

}  // namespace catgs
