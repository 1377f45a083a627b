#pragma once

#include <filesystem>
#include <string>

#include <libwebsockets.h>

namespace catgs {

/// Loads a renewed certificate without a restart. New connections get it; open ones continue. The
/// files are checked once a second on the network thread. A pair that cannot be used (one of two
/// files replaced so far) leaves the old pair in force.
class CertificateWatch {
 public:
  /// Takes the files as the vhost has loaded them.
  CertificateWatch(lws_context* context, std::string certificate, std::string key);
  CertificateWatch(const CertificateWatch&) = delete;
  CertificateWatch& operator=(const CertificateWatch&) = delete;
  ~CertificateWatch();

 private:
  using Times = std::pair<std::filesystem::file_time_type, std::filesystem::file_time_type>;
  [[nodiscard]] Times times() const;
  void look();

  /// A libwebsockets timer with a pointer to its owner. The timer must be the first member.
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
