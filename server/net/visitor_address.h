#pragma once

#include <string>
#include <vector>

namespace catgs {

/// The addresses of this machine's networks, IPv4 first, without loopback and link-local ones.
std::vector<std::string> machine_addresses();

/// Returns the host part of the address by which visitors reach a server that listens on `bind`.
/// For all interfaces, it is one of the machine's addresses. Where the certificate in the PEM file
/// does not cover that, it is a name that the certificate is for. `certificate` is empty without
/// TLS.
std::string visitor_host(const std::string& bind, const std::string& certificate,
                         const std::vector<std::string>& machine);

}  // namespace catgs
