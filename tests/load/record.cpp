#include "tests/load/record.h"

#include <csignal>
#include <memory>

#include <boost/asio/co_spawn.hpp>
#include <boost/asio/detached.hpp>
#include <boost/asio/io_context.hpp>
#include <boost/asio/signal_set.hpp>
#include <boost/asio/ssl/context.hpp>
#include <boost/asio/steady_timer.hpp>
#include <fmt/format.h>

#include "render_core/base/error.h"
#include "tests/load/clock.h"
#include "tests/load/link_proxy.h"
#include "tests/load/pose_tap.h"
#include "tests/load/url.h"
#include "tests/load/wire_client.h"

namespace catgs::load {
namespace {

/// The poses of one connection, in time order.
class Recorder {
 public:
  /// Reads along with one more connection.
  LinkProxy::Tap tap() {
    const int connection = ++connections_;
    auto tap = std::make_shared<PoseTap>(
        [this, connection](const v1::PoseSample& sample) { take(connection, sample); });
    return [tap](std::span<const std::byte> bytes) { tap->read(bytes); };
  }

  Trajectory poses;

 private:
  void take(int connection, const v1::PoseSample& sample) {
    if (chosen_ == 0) {
      chosen_ = connection;
      begin_us_ = sample.client_time_us();
    }
    const std::int64_t time_us = sample.client_time_us() - begin_us_;
    if (connection != chosen_ || (!poses.empty() && time_us <= poses.back().time_us)) return;
    poses.push_back({time_us, from_wire(sample.world_from_camera())});
  }

  int connections_ = 0;
  int chosen_ = 0;
  std::int64_t begin_us_ = 0;
};

}  // namespace

Trajectory record_poses(const RecordOptions& options) {
  const Url url = parse_url(options.url);
  boost::asio::io_context io(1);
  boost::asio::ssl::context tls(boost::asio::ssl::context::tls_client);
  tls.set_default_verify_paths();
  tls.set_verify_mode(options.insecure ? boost::asio::ssl::verify_none
                                       : boost::asio::ssl::verify_peer);
  Recorder recorder;
  std::unique_ptr<LinkProxy> proxy;
  try {
    proxy = std::make_unique<LinkProxy>(io.get_executor(), url.host, url.port, LinkSettings(), 0,
                                        now_us(), options.listen);
  } catch (const boost::system::system_error& error) {
    throw InputError("--listen", std::to_string(options.listen), error.code().message(),
                     "choose another port");
  }
  if (url.tls) proxy->encrypt(tls);
  proxy->read_along([&] { return recorder.tap(); });
  boost::asio::co_spawn(io, proxy->run(), boost::asio::detached);
  boost::asio::signal_set stop(io, SIGINT, SIGTERM);
  stop.async_wait([&](const boost::system::error_code& error, int) {
    if (!error) io.stop();
  });
  boost::asio::steady_timer end(io);
  if (options.duration_s > 0.0) {
    end.expires_after(
        std::chrono::microseconds(static_cast<std::int64_t>(1e6 * options.duration_s)));
    end.async_wait([&](const boost::system::error_code&) { io.stop(); });
  }
  if (options.on_listening)
    options.on_listening(static_cast<std::uint16_t>(std::stoi(proxy->port())));
  io.run();
  return std::move(recorder.poses);
}

}  // namespace catgs::load
