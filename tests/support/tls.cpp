#include "tests/support/tls.h"

#include <cstdio>
#include <memory>
#include <stdexcept>

#include <openssl/bio.h>
#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <openssl/x509v3.h>

namespace catgs::test {
namespace {

template <auto Free>
struct FreeWith {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};

using File = std::unique_ptr<std::FILE, FreeWith<std::fclose>>;

File open_for_writing(const std::filesystem::path& path) {
  File file(std::fopen(path.c_str(), "w"));
  if (!file) throw std::runtime_error("cannot write " + path.string());
  return file;
}

}  // namespace

void write_self_signed(const std::filesystem::path& certificate, const std::filesystem::path& key,
                       long serial, const std::string& names) {
  const std::unique_ptr<EVP_PKEY, FreeWith<EVP_PKEY_free>> pair(EVP_EC_gen("P-256"));
  const std::unique_ptr<X509, FreeWith<X509_free>> x509(X509_new());
  ASN1_INTEGER_set(X509_get_serialNumber(x509.get()), serial);
  X509_gmtime_adj(X509_getm_notBefore(x509.get()), 0);
  X509_gmtime_adj(X509_getm_notAfter(x509.get()), 3600);
  X509_set_pubkey(x509.get(), pair.get());
  X509_NAME* name = X509_get_subject_name(x509.get());
  X509_NAME_add_entry_by_txt(name, "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>("localhost"), -1, -1, 0);
  X509_set_issuer_name(x509.get(), name);
  if (!names.empty()) {
    const std::unique_ptr<X509_EXTENSION, FreeWith<X509_EXTENSION_free>> extension(
        X509V3_EXT_conf_nid(nullptr, nullptr, NID_subject_alt_name, names.c_str()));
    if (!extension || X509_add_ext(x509.get(), extension.get(), -1) == 0)
      throw std::runtime_error("cannot name " + names);
  }
  if (X509_sign(x509.get(), pair.get(), EVP_sha256()) == 0)
    throw std::runtime_error("cannot sign a certificate");
  PEM_write_X509(open_for_writing(certificate).get(), x509.get());
  PEM_write_PrivateKey(open_for_writing(key).get(), pair.get(), nullptr, nullptr, 0, nullptr,
                       nullptr);
}

TlsReply tls_get(int port, const std::string& target) {
  const std::unique_ptr<SSL_CTX, FreeWith<SSL_CTX_free>> context(SSL_CTX_new(TLS_client_method()));
  constexpr unsigned char offered[] = "\x02h2\x08http/1.1";
  SSL_CTX_set_alpn_protos(context.get(), offered, sizeof offered - 1);
  const std::unique_ptr<BIO, FreeWith<BIO_free_all>> bio(BIO_new_ssl_connect(context.get()));
  BIO_set_conn_hostname(bio.get(), ("127.0.0.1:" + std::to_string(port)).c_str());
  if (BIO_do_connect(bio.get()) <= 0) throw std::runtime_error("no TLS connection");
  SSL* ssl = nullptr;
  BIO_get_ssl(bio.get(), &ssl);
  const unsigned char* protocol = nullptr;
  unsigned int length = 0;
  SSL_get0_alpn_selected(ssl, &protocol, &length);
  TlsReply reply;
  reply.protocol.assign(reinterpret_cast<const char*>(protocol), length);
  const std::unique_ptr<X509, FreeWith<X509_free>> shown(SSL_get1_peer_certificate(ssl));
  reply.serial = ASN1_INTEGER_get(X509_get0_serialNumber(shown.get()));
  const std::string request =
      "GET " + target + " HTTP/1.1\r\nHost: localhost\r\nConnection: close\r\n\r\n";
  BIO_write(bio.get(), request.data(), static_cast<int>(request.size()));
  char buffer[1024];
  for (int n; (n = BIO_read(bio.get(), buffer, sizeof buffer)) > 0;)
    reply.text.append(buffer, static_cast<std::size_t>(n));
  return reply;
}

}  // namespace catgs::test
