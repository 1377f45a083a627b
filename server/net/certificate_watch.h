#pragma once

#include <filesystem>
#include <string>

#include <libwebsockets.h>

namespace catgs {

/// Serves a renewed certificate without a restart: new connections get it, open ones go on. Looks
/// once a second, on the network thread, whether the files have changed. A pair that cannot be used
/// (one file of two was replaced so far) leaves the one before in force.
class CertificateWatch {
 public:
  /// The files as they were when the vhost was made with them.
  CertificateWatch(lws_context* context, std::string certificate, std::string key);
  CertificateWatch(const CertificateWatch&) = delete;
  CertificateWatch& operator=(const CertificateWatch&) = delete;
  ~CertificateWatch();

 private:
  using Times = std::pair<std::filesystem::file_time_type, std::filesystem::file_time_type>;
  [[nodiscard]] Times times() const;
  void look();

  /// libwebsockets' timer, with the way back to its owner; the timer comes first.
  struct Timer {
    lws_sorted_usec_list_t list{};
    CertificateWatch* owner = nullptr;
  };
  void look_later();

  lws_context* const context_;
  const std::string certificate_;
  const std::string key_;
  Times known_;
  Timer timer_;
};

}  // namespace catgs
