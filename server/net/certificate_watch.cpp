#include "server/net/certificate_watch.h"

#include <memory>
#include <type_traits>
#include <utility>

#include <openssl/err.h>
#include <openssl/ssl.h>

#include "server/base/log_event.h"

namespace catgs {
namespace {

constexpr lws_usec_t look_every_us = 1'000'000;

/// libwebsockets would combine the new certificate with the old key, so the pair is tested first.
/// Opening a pipe would wait for its writer.
bool usable(const std::string& certificate, const std::string& key) {
  std::error_code error;
  for (const std::string& file : {certificate, key})
    if (!std::filesystem::is_regular_file(file, error)) return false;
  const std::unique_ptr<SSL_CTX, decltype(&SSL_CTX_free)> trial(SSL_CTX_new(TLS_server_method()),
                                                                SSL_CTX_free);
  const bool ok = trial &&
                  SSL_CTX_use_certificate_chain_file(trial.get(), certificate.c_str()) == 1 &&
                  SSL_CTX_use_PrivateKey_file(trial.get(), key.c_str(), SSL_FILETYPE_PEM) == 1 &&
                  SSL_CTX_check_private_key(trial.get()) == 1;
  ERR_clear_error();
  return ok;
}

}  // namespace

CertificateWatch::CertificateWatch(lws_context* context, std::string certificate, std::string key)
    : context_(context),
      certificate_(std::move(certificate)),
      key_(std::move(key)),
      known_(times()) {
  timer_.owner = this;
  look_later();
}

CertificateWatch::~CertificateWatch() { lws_sul_cancel(&timer_.list); }

CertificateWatch::Times CertificateWatch::times() const {
  std::error_code missing;  // for the moment: it differs from any time there was
  return {std::filesystem::last_write_time(certificate_, missing),
          std::filesystem::last_write_time(key_, missing)};
}

void CertificateWatch::look_later() {
  static_assert(std::is_standard_layout_v<Timer>);
  lws_sul_schedule(
      context_, 0, &timer_.list,
      [](lws_sorted_usec_list_t* list) { reinterpret_cast<Timer*>(list)->owner->look(); },
      look_every_us);
}

void CertificateWatch::look() {
  look_later();
  const Times now = times();
  if (now == known_) return;
  known_ = now;
  if (!usable(certificate_, key_)) {
    log_warning({.event = "certificate"},
                "--tls-cert and --tls-key have changed and do not fit together: those read before "
                "stay in force until they do");
    return;
  }
  if (lws_tls_cert_updated(context_, certificate_.c_str(), key_.c_str(), nullptr, 0, nullptr, 0) !=
      0)
    log_error({.event = "certificate"}, "--tls-cert: the renewed certificate could not be taken");
  else
    log_info({.event = "certificate"}, "--tls-cert: the renewed certificate is in force");
}

}  // namespace catgs
