#pragma once

#include <filesystem>
#include <string>

namespace catgs::test {

/// Writes a fresh self-signed P-256 certificate for localhost and its key, PEM. `names` are further
/// ones: "DNS:a.example,IP:192.0.2.1".
void write_self_signed(const std::filesystem::path& certificate, const std::filesystem::path& key,
                       long serial = 1, const std::string& names = {});

struct TlsReply {
  std::string protocol;  // negotiated by ALPN
  long serial = 0;       // of the server's certificate
  std::string text;      // status line, headers, body
};

/// GET over TLS from 127.0.0.1, the certificate unchecked, offering h2 and http/1.1.
TlsReply tls_get(int port, const std::string& target);

}  // namespace catgs::test
