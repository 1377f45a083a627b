#pragma once

#include <filesystem>
#include <string>

namespace catgs::test {

/// Writes a fresh self-signed P-256 certificate for localhost and its key, PEM.
void write_self_signed(const std::filesystem::path& certificate, const std::filesystem::path& key);

struct TlsReply {
  std::string protocol;  // negotiated by ALPN
  std::string text;      // status line, headers, body
};

/// GET over TLS from 127.0.0.1, the certificate unchecked, offering h2 and http/1.1.
TlsReply tls_get(int port, const std::string& target);

}  // namespace catgs::test
