#pragma once

#include <exception>
#include <memory>
#include <vector>

#include <libwebsockets.h>

#include "server/base/clock.h"
#include "server/base/log_event.h"
#include "server/base/rate_limit.h"
#include "server/net/accept_gate.h"
#include "server/net/answered_connections.h"
#include "server/net/disk_jobs.h"
#include "server/net/lws_websocket.h"
#include "server/net/upload_slots.h"

namespace catgs {

constexpr double idle_rounds_per_second = 3'000.0;
constexpr double idle_round_burst = 3'000.0;

/// The state that callbacks need besides their site. The context's user pointer points to it.
struct Service {
  Service(const AcceptGate::Bounds& bounds, Background& background)
      : gate(bounds), disk(background, waker) {}

  std::shared_ptr<LwsWaker> waker = std::make_shared<LwsWaker>();
  std::vector<std::byte> scratch;  // outgoing bytes of the packet being written
  AcceptGate gate;
  int accepted = 0;                // connections, in this round of the service loop
  std::vector<lws*> held_ports{};  // accept no more in this round
  AnsweredConnections answered;
  int callbacks = 0;  // in this round of the service loop
  RateLimit idle_rounds{idle_rounds_per_second, idle_round_burst,
                        Clock::now()};  // rounds without a callback
  UploadSlots uploads{UploadSlots::small};
  UploadSlots large_uploads{UploadSlots::large};
  DiskJobs disk;
};

/// Call it between rounds of the service loop. libwebsockets 4.1.6 accepts connections for as long
/// as others come, which may be forever: TLS costs more than connecting does. So each round accepts
/// a few, and visitors' frames go out in between.
void accept_again(Service& service);

/// Call it between rounds of the service loop. libwebsockets 4.1.6 does not block while a socket
/// has input that it does not read, such as a websocket that it is closing. Such rounds make no
/// callback. Beyond a rate, each of them is followed by a pause.
void pause_where_nothing_happens(Service& service);

/// The protocols for libwebsockets: HTTP first, then "catgs.v1", then an empty entry. The context's
/// user pointer is the Service; each vhost's is its Site.
extern const lws_protocols service_protocols[];

/// Keeps exceptions out of C code. An exception only closes its own connection.
template <typename Function>
int guarded(Function&& function) {
  try {
    return function();
  } catch (const std::exception& error) {
    log_error({.event = "network_failed"}, "network: {}", error.what());
    return -1;
  }
}

}  // namespace catgs
