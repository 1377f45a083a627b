#include "server/net/visitor_address.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <memory>
#include <optional>

#include <arpa/inet.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netdb.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/x509v3.h>

#include "server/net/http.h"

namespace catgs {
namespace {

using Certificate = std::unique_ptr<X509, decltype(&X509_free)>;

/// Null if the file holds none: whoever serves by it says so.
Certificate read_certificate(const std::string& path) {
  const std::unique_ptr<std::FILE, decltype(&std::fclose)> file(std::fopen(path.c_str(), "re"),
                                                                std::fclose);
  Certificate certificate(file ? PEM_read_X509(file.get(), nullptr, nullptr, nullptr) : nullptr,
                          X509_free);
  ERR_clear_error();
  return certificate;
}

/// The first name in it that visitors of other machines may use.
std::optional<std::string> name_in(const X509& certificate) {
  const std::unique_ptr<GENERAL_NAMES, decltype(&GENERAL_NAMES_free)> names(
      static_cast<GENERAL_NAMES*>(
          X509_get_ext_d2i(&certificate, NID_subject_alt_name, nullptr, nullptr)),
      GENERAL_NAMES_free);
  for (int i = 0; names && i < sk_GENERAL_NAME_num(names.get()); ++i) {
    const GENERAL_NAME* const name = sk_GENERAL_NAME_value(names.get(), i);
    if (name->type != GEN_DNS) continue;
    const ASN1_STRING* const text = name->d.dNSName;
    std::string host(reinterpret_cast<const char*>(ASN1_STRING_get0_data(text)),
                     static_cast<std::size_t>(ASN1_STRING_length(text)));
    if (!is_loopback(host) && !host.starts_with("*.")) return host;
  }
  return std::nullopt;
}

std::string in_brackets(const std::string& host) {
  return host.find(':') != std::string::npos ? "[" + host + "]" : host;
}

}  // namespace

std::vector<std::string> machine_addresses() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) return {};
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> all(first, ::freeifaddrs);
  std::vector<std::string> found;
  for (const int family : {AF_INET, AF_INET6})
    for (const ifaddrs* at = all.get(); at; at = at->ifa_next) {
      if (!at->ifa_addr || at->ifa_addr->sa_family != family || (at->ifa_flags & IFF_UP) == 0)
        continue;
      const socklen_t size = family == AF_INET ? sizeof(sockaddr_in) : sizeof(sockaddr_in6);
      std::array<char, NI_MAXHOST> text{};
      if (::getnameinfo(at->ifa_addr, size, text.data(), text.size(), nullptr, 0, NI_NUMERICHOST))
        continue;
      const std::string address = text.data();
      const bool link_local = address.starts_with("169.254.") || address.starts_with("fe80:");
      if (!is_loopback(address) && !link_local) found.push_back(address);
    }
  return found;
}

std::string visitor_host(const std::string& bind, const std::string& certificate,
                         const std::vector<std::string>& machine) {
  if (is_loopback(bind)) return in_brackets(bind);
  const bool all = bind == "0.0.0.0" || bind == "::";
  const std::vector<std::string> addresses = all ? machine : std::vector{bind};
  if (const auto shown =
          certificate.empty() ? Certificate(nullptr, X509_free) : read_certificate(certificate)) {
    const auto covered = std::ranges::find_if(addresses, [&](const std::string& address) {
      return X509_check_ip_asc(shown.get(), address.c_str(), 0) == 1;
    });
    if (covered != addresses.end()) return in_brackets(*covered);
    if (const auto name = name_in(*shown)) return *name;
  }
  return addresses.empty() ? "localhost" : in_brackets(addresses.front());
}

}  // namespace catgs
