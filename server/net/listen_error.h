#pragma once

#include "server/net/net_server.h"

namespace catgs {

/// For an address at which libwebsockets could not listen; it says no more than that. Throws
/// InputError with `flag`, the system's reason and the remedy. `tls`: a certificate and a key were
/// given, and are to blame where the address is not.
[[noreturn]] void throw_listen_error(const Endpoint& endpoint, const char* flag, bool tls);

}  // namespace catgs
